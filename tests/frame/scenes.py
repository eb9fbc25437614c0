"""Scenes of triangles with constant materials, such as a cube that is seen from inside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import ssgi_cl as gi
from ssgi_cl.core.scene import Material, Scene

MAPS: dict[str, Any] = {"shadow_size": 64, "rsm_size": 64}
"""Small maps of lights, for frames whose shadows need no sharp edge; much less work than the default ones."""

CORNERS = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Sides of the cube of `CORNERS`, which face inwards; +z is the last."""


def scene_of(points: Any, triangles: Any, *materials: Material, ids: Sequence[int] | None = None) -> Scene:
    """Return a scene; its normals are those of the triangles, all of the first material without `ids`."""
    points = np.asarray(points, np.float32)
    return Scene(
        positions=points,
        normals=np.zeros_like(points),
        uvs=points[:, :2].copy(),
        colors=np.ones_like(points),
        triangles=np.asarray(triangles, np.int32),
        material_ids=np.zeros(len(triangles), np.int32) if ids is None else np.asarray(ids, np.int32),
        materials=materials,
    )


def halves(quads: Any) -> list[tuple[int, int, int]]:
    """Return two triangles for each quadrilateral."""
    return [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def matt(albedo: float, emission: float = 0.0) -> Material:
    return Material(albedo=(albedo,) * 3, emission=(emission,) * 3)


def cube(albedo: float, emission: float = 0.0, *, sides: int = 6) -> Scene:
    """Return a cube from -1 to 1, closed or without its last sides (+z and then -z)."""
    return scene_of(CORNERS, halves(QUADS[:sides]), matt(albedo, emission))


def inside(width: int, height: int) -> gi.Camera:
    """Return a camera within the cube."""
    return gi.Camera.look_at((0.6, -0.2, 0.5), (-1.0, -0.3, -0.8), yfov=1.2, width=width, height=height)
