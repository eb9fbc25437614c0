"""The back ends of directional occlusion, made from its parameters."""

from __future__ import annotations

from dataclasses import replace

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.bitmask_ao import MOST_TAPS
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, coarse_size
from ssgi_cl.techniques.indirect.ssdo_bitmask import SsdoBitmask
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.indirect.ssdo_points import SsdoPoints
from ssgi_cl.techniques.tiles import OpenTiles

BackEnd = SsdoBitmask | SsdoPoints


def back_end(
    runtime: Runtime,
    size: Size,
    params: SsdoParams,
    margin: Size,
    layers: int,
    *,
    kept: bool = False,
) -> BackEnd:
    """Return what gathers light for G-buffers of such a shape; see `Ssdo`.

    `kept` asks for what auxiliary cameras need: sectors that are covered, or directions that met
    something.
    """
    if params.method == "bitmask":
        bitmask = params.bitmask()
        # Taps are spread over the arrays: in wider ones they keep their distances.
        wider = 1.0 + sum(border / length for border, length in zip(margin, size, strict=True))
        taps = min(round(bitmask.taps * wider), MOST_TAPS)
        return SsdoBitmask(
            runtime, size, replace(bitmask, taps=taps), margin, layers, masks=kept
        )
    return SsdoPoints(
        runtime, size, RESOLUTIONS[params.resolution], params.points(), kept=kept
    )


class SenderOpenness:
    """A of surfaces that send the sky's light, at a quarter of the size.

    A receiver takes the mean over many of them, so neither size nor noise shows. Without it closed
    rooms send several times the light they should. With directions (all methods but
    "bitmask"), of the front layer alone.

    Attributes:
        step: pixels of the G-buffer from one of the result to the next.
    """

    step = RESOLUTIONS["quarter"]

    def __init__(
        self, runtime: Runtime, size: Size, params: SsdoParams, margin: Size, layers: int
    ) -> None:
        self._back: BackEnd
        if params.method != "bitmask":
            coarse = coarse_size(size, self.step)
            self._back = SsdoPoints(runtime, coarse, 1, params.points(), reduced=True)
        else:
            low = replace(params, resolution="quarter", bent_normals=False)
            self._back = back_end(runtime, size, low, margin, layers)
        self._reduced: ReducedGBuffer | None = None

    def run(self, gbuffer: DeviceGBuffer, tiles: OpenTiles | None = None) -> Plane:
        """Queue the passes; return a plane whose first image is A.

        `tiles` are open as far as a back end of this step looks; see `SsdoBitmask.gather`.
        """
        if self._reduced is None:
            self._reduced = ReducedGBuffer(gbuffer, self.step)
        self._reduced.update(gbuffer)
        return self._back.gather(gbuffer, self._reduced, None, None, tiles)
