"""What extra cameras see of a scene, drawn one after the other."""

from __future__ import annotations

from collections.abc import Iterator

from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.extra_cameras import extra_cameras
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.view import device_scene
from ssgi_cl.runtime import Runtime


class FurtherViews:
    """Places cameras and draws what they see.

    Args:
        runtime: the device.
        count: of cameras.
    """

    def __init__(self, runtime: Runtime, count: int) -> None:
        self.runtime = runtime
        self.count = count
        self._rasterizer: Rasterizer | None = None
        self._placed: tuple[Scene, Camera, list[Camera]] | None = None

    def drawn(
        self, scene: Scene, camera: Camera, seen: DeviceGBuffer
    ) -> Iterator[DeviceGBuffer]:
        """Queue the passes of each camera in turn and give its G-buffer.

        All are drawn into the same memory: use one before asking for the next. Cameras stay where
        they are as long as scene and camera are the same.
        """
        placed = self._placed
        if placed is None or placed[0] is not scene or placed[1] is not camera:
            placed = self._placed = scene, camera, extra_cameras(camera, seen, self.count)
        for extra in placed[2]:
            if self._rasterizer is None:
                self._rasterizer = Rasterizer(self.runtime, extra.size)
            target = self._rasterizer.render(device_scene(scene, self.runtime), extra)
            target.derive()
            yield target
