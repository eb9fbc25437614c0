"""What extra cameras see of a scene, drawn one after the other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Light, SpotLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.skips import same
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.shadow_map import light_cameras
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.ssdo.ssdo_views import auxiliary_cameras

SIZE = 0.5
"""Rows and columns of each camera, in parts of the first one's, by default."""
AT_LAMPS = 0.5
"""Share of the cameras, at most, that stand at lights."""

AtLight = SpotLight | DirectionalLight
"""A light that one camera sees all of."""


class AuxiliaryViews:
    """Places cameras and draws what they see.

    Up to half of them stand at spot and directional lights, in their order: such a camera sees
    every surface that the light shines on, and so all that sends its light on. The others stand
    where `auxiliary_cameras` says; point lights would need six each, and what those see of next
    rooms leaks through walls that no camera sees.

    Args:
        runtime: the device.
        count: of cameras.
        size: of each, in parts of the first one's; > 0, at most 1.
    """

    def __init__(self, runtime: Runtime, count: int, size: float = SIZE) -> None:
        self.runtime = runtime
        self.count = count
        self.size = size
        self._rasterizers: dict[Size, Rasterizer] = {}
        self._made_of: tuple[object, ...] | None = None
        self._cameras: list[Camera] = []

    def drawn(
        self, scene: Scene, camera: Camera, seen: DeviceGBuffer, lights: Sequence[Light] = ()
    ) -> Iterator[DeviceGBuffer]:
        """Queue the passes of each camera in turn and give its G-buffer.

        Those of one size are drawn into the same memory: use one before asking for the next. A
        camera that sees nothing gives none.
        Cameras stay where they are as long as scene, camera and lights are the same.
        """
        punctual_lights: tuple[AtLight, ...] = tuple(
            light for light in lights if isinstance(light, (SpotLight, DirectionalLight))
        )[: int(AT_LAMPS * self.count)]
        made_of = scene.key, camera, punctual_lights
        if not same(self._made_of, made_of):
            self._made_of = None
            self._cameras = self._places(scene, camera, seen, punctual_lights)
            self._made_of = made_of
        for extra in self._cameras:
            if extra.size not in self._rasterizers:
                self._rasterizers[extra.size] = Rasterizer(
                    self.runtime, extra.size, regions=True, world="until derived"
                )
            target = self._rasterizers[extra.size].render(device_scene(scene, self.runtime), extra)
            if target.region is not None and target.region.empty:
                self.runtime.skip("auxiliary view", "the camera sees no triangle")
                target.release_world()
                continue
            target.derive()
            target.release_world()
            yield target

    def _places(
        self, scene: Scene, camera: Camera, seen: DeviceGBuffer, punctual_lights: Sequence[AtLight]
    ) -> list[Camera]:
        side = max(1, round(self.size * math.sqrt(camera.height * camera.width)))
        at_lights = [each for light in punctual_lights for each in light_cameras(light, scene.bounds, side)]
        more = self.count - len(at_lights)
        return at_lights + auxiliary_cameras(camera, seen, more, size=self.size)
