"""Surfaces that are seen through, as a part of the stage that sums up all light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.blended_layers import BlendedLayers
from ssgi_cl.rasterize.view import device_scene


class Blended:
    """Adds surfaces that are seen through to radiance, each layer shaded like what is behind it.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        matt: see `BlendedLayers`.
    """

    def __init__(self, runtime: Runtime, size: Size, *, matt: bool) -> None:
        self.runtime = runtime
        self._size = size
        self._matt = matt
        self._layers: BlendedLayers | None = None

    def run(
        self,
        scene: Scene,
        camera: Camera,
        front: DeviceGBuffer,
        radiance: Plane,
        shaded: Callable[[DeviceGBuffer], Plane],
        *,
        overwritten: Sequence[Plane | None],
    ) -> None:
        """Queue the passes.

        Args:
            scene: all of it.
            camera: what sees it.
            front: the G-buffer of surfaces that are not seen through.
            radiance: of those, changed in place; 3 images, W m^-2 sr^-1.
            shaded: queues the passes of a layer; returns its radiance, which may be in `radiance`.
            overwritten: planes that `shaded` writes to, which get their contents back.
        """
        part = scene_parts(scene).blended
        if part is None:
            return
        if self._layers is None:
            self._layers = BlendedLayers(self.runtime, self._size, matt=self._matt)
        planes = [radiance, *(plane for plane in overwritten if plane is not None)]
        copies: list[Plane] = []
        over, through = (self.runtime.transient.plane(3, self._size) for _ in range(2))
        try:
            for layer in self._layers.drawn(device_scene(part, self.runtime), camera, front):
                first = not copies
                if first:
                    copies = [self._copy(plane) for plane in planes]
                self._blend(
                    0 if first else 1,
                    shaded(layer),
                    over,
                    through,
                    opacity=layer.opacity,
                    transmitted=layer.transmitted,
                )
            if copies:
                self._blend(2, copies[0], over, through)
                copies[0] = over
        finally:
            for plane, copy in zip(planes, copies, strict=False):
                plane.copy_image(0, copy, plane.count)

    def _copy(self, plane: Plane) -> Plane:
        copy = self.runtime.transient.plane(plane.count, plane.size)
        copy.copy_image(0, plane, plane.count)
        return copy

    def _blend(self, step: int, radiance: Plane, over: Plane, through: Plane, **layer: Any) -> None:
        self.runtime.kernel("blended/blended.cl", {"BLENDED_STEP": step}).run(
            "blend", self._size, radiance=radiance, **layer, over=over, through=through
        )
