"""Base of the techniques that gather light from reflective shadow maps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.params import Params, Prepared
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.rsm.rsm_maps import MapSampling, RsmMaps
from ssgi_cl.techniques.source import camera_of, check_size
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms

LEAST_REACH, MOST_REACH = 1e-7, 1e9
"""Scene units: distances of a scene from its light. The fourth powers of 1e-2 of the one, and of
the other, are float32 numbers."""

Q = TypeVar("Q", bound=Params)


class RsmTechnique(Prepared[Q], ABC):
    """Gathering from maps, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: of the technique; by default its defaults.
        margin: (rows, columns) by which the G-buffers exceed the result on every side.
    """

    name: ClassVar[str]
    """Of the pass that is skipped without light."""
    defaults: ClassVar[type[Any]]
    """The dataclass of its parameters."""

    def __init__(self, runtime: Runtime, size: Size, params: Q | None = None, margin: Size = (0, 0)) -> None:
        self._params = params or self.defaults()
        self.runtime = runtime
        self.size = size
        self.margin = margin
        self._maps = RsmMaps(runtime, self._sampling(self._params))
        self._dark: Plane | None = None
        self._prepare()

    @abstractmethod
    def _prepare(self) -> None:
        """Compile the kernels, and allocate what they write."""

    @abstractmethod
    def _sampling(self, params: Q) -> MapSampling:
        """Return the sampling of each map."""

    def _set(self, params: Q) -> None:
        self._maps.set(self._sampling(params))

    @property
    @abstractmethod
    def computed(self) -> float:
        """Share of all pixels that the latest run gathered for. Waits for the device."""

    def run(self, gbuffer: DeviceGBuffer, rsms: DeviceRsm | Sequence[DeviceRsm]) -> Plane:
        """Queue the passes; return the plane of irradiance, 3 images in W/m^2.

        Nothing is allocated after the first call with maps of one size, and what depends on the
        maps alone is made when they change.

        Args:
            gbuffer: what the camera sees; its front layer alone counts, and not its margin.
            rsms: a map, or several, whose light is summed; without any the result is 0.

        Raises:
            ValueError: a G-buffer of another size or margin, an empty one, a map whose faces do
                not suit the pattern, or surfaces beyond `LEAST_REACH` and `MOST_REACH`.
        """
        check_size(gbuffer, self.size, self.margin)
        camera = camera_of(gbuffer)
        maps = (rsms,) if isinstance(rsms, DeviceRsm) else tuple(rsms)
        if not maps:
            self.runtime.skip(self.name, "no light")
            self._dark = self._dark or self.runtime.plane(3, self.size)
            return self._dark
        for rsm in maps:
            rsm.check_scale("gathering", LEAST_REACH, MOST_REACH)
        self._maps.prepare(maps)
        return self._gathered(gbuffer, camera)

    @abstractmethod
    def _gathered(self, gbuffer: DeviceGBuffer, camera: Camera) -> Plane:
        """Queue the passes over the maps that were prepared; return the plane of irradiance."""

    def __call__(
        self,
        gbuffer: GBuffer | DeviceGBuffer,
        rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return irradiance [rows, columns, 3] float32 in W/m^2, written to `out` if given."""
        device, maps = on_device(gbuffer, self.runtime), on_device_rsms(rsms, self.runtime)
        if out is None:
            out = np.empty((*self.size, 3), np.float32)
        with self.runtime.frame():
            self.run(device, maps).download(np.moveaxis(out, -1, 0))
        return out
