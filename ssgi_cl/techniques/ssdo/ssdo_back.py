"""The back ends of directional occlusion, made from its parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.bitmask_ao import MOST_TAPS
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, coarse_size
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams, SsdoPoints

BackEnd = SsdoBitmask | SsdoPoints


def back_params(params: SsdoParams, size: Size, margin: Size) -> SsdoBitmaskParams | PointsParams:
    """Return the parameters of the back end for G-buffers of such a size and margin."""
    if params.method != "bitmask":
        return params.points()
    bitmask = params.bitmask()
    # Taps are spread over the arrays: in wider ones they keep their distances.
    wider = 1.0 + sum(border / length for border, length in zip(margin, size, strict=True))
    return replace(bitmask, taps=min(round(bitmask.taps * wider), MOST_TAPS))


def back_end(
    runtime: Runtime, size: Size, params: SsdoParams, margin: Size, layers: int, *, kept: bool = False
) -> BackEnd:
    """Return what gathers light for G-buffers of such a shape; see `Ssdo`.

    `kept` asks for what auxiliary cameras need: sectors that are covered, or directions that met
    something.
    """
    own = back_params(params, size, margin)
    if isinstance(own, SsdoBitmaskParams):
        return SsdoBitmask(runtime, size, own, margin, layers, masks=kept)
    return SsdoPoints(runtime, size, RESOLUTIONS[params.resolution], own, kept=kept)


def set_back(back: BackEnd, params: SsdoBitmaskParams | PointsParams) -> None:
    """Bring the values of parameters to a back end that was made for such ones."""
    own: Any = back  # the two are of the same method
    own.params = params


class SenderVisibility:
    """A of surfaces that send the sky's light, at a quarter of the size.

    A receiver takes the mean over many of them, so neither size nor noise shows. Without it closed
    rooms send several times the light they should. With directions (all methods but
    "bitmask"), of the front layer alone.

    Attributes:
        step: pixels of the G-buffer from one of the result to the next.
    """

    step = RESOLUTIONS["quarter"]

    def __init__(self, runtime: Runtime, size: Size, params: SsdoParams, margin: Size, layers: int) -> None:
        self._shape = size, margin
        self._back: BackEnd
        own = self._params(params)
        if isinstance(own, SsdoBitmaskParams):
            self._back = SsdoBitmask(runtime, size, own, margin, layers)
        else:
            coarse = coarse_size(size, self.step)
            self._back = SsdoPoints(runtime, coarse, 1, own, reduced=True)
        self._reduced: ReducedGBuffer | None = None

    def _params(self, params: SsdoParams) -> SsdoBitmaskParams | PointsParams:
        low = replace(params, resolution="quarter", bent_normals=False)
        return back_params(low, *self._shape)

    def set(self, params: SsdoParams) -> None:
        """Take the values of other parameters of the same shape."""
        set_back(self._back, self._params(params))

    def run(self, gbuffer: DeviceGBuffer) -> Plane:
        """Queue the passes; return a plane whose first image is A."""
        if self._reduced is None:
            self._reduced = ReducedGBuffer(gbuffer, self.step)
        self._reduced.update(gbuffer)
        return self._back.run(gbuffer, self._reduced)
