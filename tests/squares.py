"""Scenes of squares across the z axis, such as panes before a wall."""

from __future__ import annotations

from typing import Any

import numpy as np

from ssgi_cl.core.scene import Material, Scene


def squares(*parts: tuple[float, float, float, Material], **rest: Any) -> Scene:
    """Return squares across the z axis: middle along x, z, half the side, material."""
    corners = np.float32([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    points = np.concatenate([corners * s + np.float32([x, 0, z]) for x, z, s, _ in parts])
    count = len(parts)
    faces = [[4 * i + k for k in t] for i in range(count) for t in ((0, 1, 2), (0, 2, 3))]
    return Scene(
        positions=points,
        normals=np.tile(np.float32([0, 0, 1]), (4 * count, 1)),
        uvs=np.tile(np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]), (count, 1)),
        colors=np.ones_like(points),
        triangles=np.asarray(faces, np.int32),
        material_ids=np.repeat(np.arange(count, dtype=np.int32), 2),
        materials=tuple(part[3] for part in parts),
        **rest,
    )
