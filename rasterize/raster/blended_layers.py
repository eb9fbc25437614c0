"""Surfaces that are seen through, as layers in front of those that are not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer

MOST_LAYERS = 8
"""In front of each other in a pixel, at most; what lies behind the last is not drawn."""


class BlendedLayers:
    """Draws one layer after another, prepared for images of one size.

    Depth peeling (Everitt 2001, "Interactive Order-Independent Transparency"): a layer is the
    nearest surface behind the layer before, and in front of what is not seen through.

    Args:
        runtime: the device.
        size: (rows, columns) of the images, which have no margin.
        matt: whether albedo has the reflectance of lobes in it, for what draws no lobes.
    """

    def __init__(self, runtime: Runtime, size: Size, *, matt: bool) -> None:
        self.runtime = runtime
        self._matt = matt
        self._rasterizer = Rasterizer(runtime, size, shaded=False, matt=matt)
        self._target = DeviceGBuffer(runtime, size, world="until derived")
        self._found = runtime.array(np.zeros(1, np.int32))

    def drawn(self, scene: DeviceScene, camera: Camera, front: DeviceGBuffer) -> Iterator[DeviceGBuffer]:
        """Yield the layers, nearest first; each is there until the next is asked for.

        Reads 12 bytes back for each layer, and for one more that has nothing.

        Args:
            scene: of surfaces that are seen through.
            camera: what sees them.
            front: the G-buffer of the others.
        """
        rasterizer, target = self._rasterizer, self._target
        behind: DeviceArray | None = None
        for _ in range(MOST_LAYERS):
            rasterizer.render(scene, camera, behind=behind)
            behind = rasterizer.depths
            self._found.upload(np.zeros(1, np.int32))
            rasterizer.hide_behind(front, self._found)
            if not self._found.download()[0]:
                break
            target.set_camera(camera)
            target.has_facets = True
            target.emits = scene.emits
            target.mirrors = scene.glossy and not self._matt
            target.take_world()
            rasterizer.write_every(1, scene, target)
            rasterizer.write_opacity(scene, target)
            if target.mirrors:
                rasterizer.write_gloss(1, scene, target.specular, target.gloss)
            target.derive()
            yield target
        rasterizer.release()
