"""What glossy surfaces reflect, as a part of the stage that sums up all light."""

from __future__ import annotations

from collections.abc import Sequence

from ssgi_cl.core.lights import Light
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.indirect.occupancy_grid import Occupancy
from ssgi_cl.techniques.indirect.radiosity import Radiosity
from ssgi_cl.techniques.indirect.reflections import Reflections
from ssgi_cl.techniques.shading.light_data import ShadowMap


class Lobes:
    """Adds what lobes reflect to radiance.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        radiosity: knows what surfaces send that are not seen.
    """

    def __init__(self, runtime: Runtime, size: Size, radiosity: Radiosity) -> None:
        self.runtime = runtime
        self._size = size
        self._radiosity = radiosity
        self._reflections: Reflections | None = None

    def needs(self, gbuffer: DeviceGBuffer) -> Plane | None:
        """Return the plane that `run` reads irradiance over pi from, None if it adds nothing."""
        if not gbuffer.mirrors:
            self.runtime.skip("reflect trace", "no surface of the scene is glossy")
            return None
        return self.runtime.transient.plane(3, self._size)

    def run(
        self,
        gbuffer: DeviceGBuffer,
        radiance: Plane,
        light: Plane,
        lights: Sequence[Light],
        shadows: Sequence[ShadowMap | None],
        occupancy: Occupancy,
    ) -> None:
        """Queue the passes; see `Reflections.run`. `light` is what `needs` returned, filled."""
        volume = self._radiosity.volume
        assert volume is not None  # noqa: S101  radiosity ran before
        if self._reflections is None:
            self._reflections = Reflections(self.runtime, self._size)
        self._reflections.run(
            gbuffer, radiance, light=light, lights=lights, shadows=shadows, occupancy=occupancy, volume=volume
        )
