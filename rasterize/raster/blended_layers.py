"""Surfaces that are seen through, as layers in front of those that are not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import Floats, GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, WorldNormals
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, downloaded

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
        world: see `DeviceGBuffer`.
    """

    def __init__(self, runtime: Runtime, size: Size, *, matt: bool, world: WorldNormals = "until derived") -> None:
        self.runtime = runtime
        self._matt = matt
        self._rasterizer = Rasterizer(runtime, size, shaded=False, matt=matt)
        self._target = DeviceGBuffer(runtime, size, world=world)
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


@dataclass(frozen=True, eq=False)
class BlendedLayer:
    """Surfaces that are seen through.

    Attributes:
        gbuffer: what they are, as of any surfaces.
        opacity: [rows, columns] float32, the share of the surface that is there, in [0, 1].
        transmitted: [rows, columns, 3] float32, what passes of the light behind, in [0, 1].
    """

    gbuffer: GBuffer
    opacity: Floats
    transmitted: Floats


@serialised
def blended_layers(scene: Scene, camera: Camera, *, runtime: Runtime | None = None) -> tuple[BlendedLayer, ...]:
    """Draw the surfaces that are seen through, in layers in front of those that are not.

    The radiance that reaches the eye is `opacity` times that of the nearest layer, plus
    `transmitted` times that of all behind it, and so on (Porter and Duff 1984, "Compositing
    Digital Images").

    Depth peeling (Everitt 2001, "Interactive Order-Independent Transparency"). Departs: at most 8
    layers.

    Args:
        scene: of which materials that blend or transmit are drawn; others hide what is behind them.
        camera: whose size is that of the images.
        runtime: the device; by default the fastest found.

    Returns:
        The layers, nearest first; none where nothing is seen through.

    Raises:
        TypeError: an argument of the wrong type.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene")
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    parts, runtime, size = scene_parts(scene), runtime or Runtime.open(), camera.size
    if parts.blended is None:
        return ()
    opaque: Rasterizer = runtime.prepared((blended_layers, size), lambda: Rasterizer(runtime, size))
    technique: BlendedLayers = runtime.prepared(
        (BlendedLayers, size), lambda: BlendedLayers(runtime, size, matt=False, world="kept")
    )
    with runtime.frame():
        front = opaque.render(device_scene(parts.solid, runtime), camera)
        return tuple(
            BlendedLayer(
                downloaded(layer), layer.opacity.download()[0], np.moveaxis(layer.transmitted.download(), 0, -1)
            )
            for layer in technique.drawn(device_scene(parts.blended, runtime), camera, front)
        )
