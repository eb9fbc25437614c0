"""Scenes of few triangles, and their pictures, for the tests of the rasterisers."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer
from ssgi_cl.rasterize.scenes import make_scene

made = cache(make_scene)
"""A built-in or generated scene, made once for all tests."""


def slow_but(name: str, *fast: str) -> Any:
    """Return a parameter that is for the slow tests, unless it is one of these."""
    return pytest.param(name, marks=[pytest.mark.slow] * (name not in fast))


WIDTH, HEIGHT = 240, 180
FLOOR = ((-6, -1, 1), (6, -1, 1), (6, -1, -12), (-6, -1, -12))


def scene_of(
    positions: ArrayLike,
    triangles: ArrayLike | None = None,
    *,
    normals: ArrayLike = (0.0, 0.0, 1.0),
    uvs: ArrayLike = (0.0, 0.0),
    colors: ArrayLike = (1.0, 1.0, 1.0),
    material_ids: ArrayLike = 0,
    **rest: Any,
) -> Scene:
    """Make a scene, of separate triangles by default; a single row stands for all vertices or triangles."""
    points = np.asarray(positions, np.float32)
    corners = np.asarray(np.arange(len(points)).reshape(-1, 3) if triangles is None else triangles, np.int32)

    def rows(values: ArrayLike, width: int) -> np.ndarray:
        return np.broadcast_to(np.asarray(values, np.float32), (len(points), width))

    return Scene(
        positions=points,
        normals=rows(normals, 3),
        uvs=rows(uvs, 2),
        colors=rows(colors, 3),
        triangles=corners,
        material_ids=np.broadcast_to(np.asarray(material_ids, np.int32), len(corners)),
        **rest,
    )


def quad(corners: ArrayLike, **more: Any) -> Scene:
    """Make a scene of one quadrangle."""
    return scene_of(corners, [(0, 1, 2), (0, 2, 3)], **more)


def facing(half: float, depth: float) -> list[tuple[float, float, float]]:
    """Return the corners of a square that a camera at 0 sees when it looks down -z."""
    return [(-half, -half, -depth), (half, -half, -depth), (half, half, -depth), (-half, half, -depth)]


def slanted(**more: Any) -> Scene:
    """Make a floor that runs from below a camera at 0 to far ahead."""
    return quad(FLOOR, **more)


def ahead(width: int = WIDTH, height: int = HEIGHT, **more: float) -> Camera:
    """Return a camera at 0 that looks down -z."""
    return Camera.look_at((0, 0, 0), (0, 0, -1), width=width, height=height, **more)  # type: ignore[arg-type]


def depth_of(result: GBuffer) -> NDArray[np.float32]:
    return np.asarray(result.depth)


def front_depth(scene: Scene, camera: Camera, runtime: Runtime) -> NDArray[np.float32]:
    """Return the depth [rows, columns] that a camera sees."""
    return depth_of(gbuffer(scene, camera, runtime=runtime))


def there(result: GBuffer) -> NDArray[np.bool_]:
    return np.isfinite(depth_of(result))


def assert_same_bits(one: GBuffer, other: GBuffer) -> None:
    for name in ("depth", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
