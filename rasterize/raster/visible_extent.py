"""The size of what a camera sees, from a depth map of a few thousand pixels."""

from __future__ import annotations

import math

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.seen_extent import seen_extent
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.extent import Extent
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene

ROWS, COLUMNS = 72, 96
"""Of the depth map, whatever the size of the camera's image."""

_BESIDE = 2.0
"""Diagonals of the subject's box, at most: what stands beside it may be as large."""


class _Latest:
    """The extent that a scene had last, the camera that saw it, and the largest one."""

    def __init__(self, scene: Scene) -> None:
        self.camera = b""
        self.extent = 0.0
        self.largest = min(Extent.of(scene).diagonal, _BESIDE * Extent.of_subject(scene).diagonal)


@serialised
def visible_extent(scene: Scene, camera: Camera, *, runtime: Runtime) -> float:
    """Return the diagonal of the picture at the distance of what is seen, in scene units.

    The distance is the harmonic mean of depths: what is near counts most, a distant backdrop
    little, and no single pixel makes it jump when the camera moves. Never more than the diagonal
    of the scene's box, nor twice that of its subject (see `Extent.of_subject`); so much is also
    returned where nothing is seen.

    Args:
        scene: it keeps the result for the latest camera.
        camera: its size in pixels does not matter.
        runtime: the device that draws the depth map.
    """
    latest: _Latest = runtime.prepared((_Latest, scene.key), lambda: _Latest(scene), of=scene)
    key = camera.view.tobytes() + camera.projection.tobytes() + camera.depth_range.encode()
    if latest.camera != key:
        latest.extent = min(_extent(scene, camera, runtime), latest.largest)
        latest.camera = key
    return latest.extent


def _extent(scene: Scene, camera: Camera, runtime: Runtime) -> float:
    """Return the diagonal of the picture at the distance of what is seen, inf if nothing is."""
    return seen_extent(camera, np.empty(0) if camera.is_orthographic else _depths(scene, camera, runtime))


def _depths(scene: Scene, camera: Camera, runtime: Runtime) -> np.ndarray:
    """Return the depths of all pixels, float64; inf where nothing is."""
    small = Camera(
        view=camera.view, projection=camera.projection, width=COLUMNS, height=ROWS, depth_range=camera.depth_range
    )
    drawn = device_scene(scene, runtime)
    rasterizer: Rasterizer = runtime.prepared(
        (Rasterizer, visible_extent), lambda: Rasterizer(runtime, small.size, shaded=False)
    )
    plane = runtime.transient.plane(1, small.size, math.inf)
    with runtime.frame():
        rasterizer.render(drawn, small)
        rasterizer.write_depth(plane)
        rasterizer.release()
        depth = plane.download().ravel().astype(np.float64)
    return depth
