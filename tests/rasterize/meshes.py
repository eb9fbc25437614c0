"""Scenes of few triangles for the tests of the rasterisers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core.scene import Scene


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
