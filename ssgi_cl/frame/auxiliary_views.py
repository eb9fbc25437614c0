"""Views of auxiliary cameras: where they stand, and their G-buffers one after the other."""

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
"""Default rows and columns of each camera, as a share of the main one's."""
AT_LIGHTS = 0.5
"""Most cameras that stand at lights, as a share of all."""


class AuxiliaryViews:
    """Auxiliary cameras of a frame, and their G-buffers.

    Up to half of them stand at spot and directional lights, in their order: such a camera sees
    every surface that the light reaches, and so all that reflects it. The others stand where
    `auxiliary_cameras` says. Point lights have none: each would need six, and light of
    neighbouring rooms would leak through walls that no camera sees.

    Args:
        runtime: the device.
        count: of cameras.
        size: of each, as a share of the main one's, in (0, 1].
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
        """Queue the passes of each camera in turn and yield its G-buffer.

        G-buffers of one size share their memory: use one before asking for the next. A camera that
        sees nothing yields none. Cameras stay as long as scene, camera and lights are the same.
        """
        alone = [light for light in lights if isinstance(light, (SpotLight, DirectionalLight))]
        made_of = scene.key, camera, tuple(alone[: int(AT_LIGHTS * self.count)])
        if not same(self._made_of, made_of):
            self._made_of = None
            side = max(1, round(self.size * math.sqrt(camera.height * camera.width)))
            at_lights = [each for light in made_of[2] for each in light_cameras(light, scene.bounds, side)]
            more = auxiliary_cameras(camera, seen, self.count - len(at_lights), size=self.size)
            self._cameras = at_lights + more
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
