"""Scenes of which some has moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.scene import Scene


@checked_keywords
def moved(scene: Scene, transform: ArrayLike, *, vertices: ArrayLike | None = None) -> Scene:
    """Return a scene of the same triangles, some of whose vertices have moved.

    Args:
        scene: as it was.
        transform: [4, 4] rigid motion or another affine map, world space to world space.
        vertices: which: [vertices] bool, or their numbers; by default all.

    Raises:
        TypeError: the scene is none, or `vertices` are not numbers or bool.
        ValueError: a matrix that is singular or projective, or a vertex that is not there.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene (see ssgi_cl.rasterize.load_scene)")
    matrix = checks.matrix4("transform", transform)
    turn = matrix[:3, :3]
    if not np.array_equal(matrix[3], [0, 0, 0, 1]) or abs(np.linalg.det(turn)) < 1e-12:
        raise ValueError(f"transform is {matrix.tolist()}: expected an invertible affine map, last row 0 0 0 1")
    count = len(scene.positions)
    chosen = np.arange(count) if vertices is None else checks.as_array("vertices", vertices)
    if chosen.dtype == np.bool_ and chosen.shape == (count,):
        chosen = np.flatnonzero(chosen)
    if chosen.dtype.kind not in "iu" or chosen.ndim != 1:
        raise TypeError(f"vertices is {chosen.dtype} {chosen.shape}: expected {count} bool, or numbers of vertices")
    if chosen.size and not (chosen.min() >= 0 and chosen.max() < count):
        raise ValueError(f"vertices are {chosen.min()} to {chosen.max()}: expected 0 to {count - 1}")
    positions, normals = scene.positions.copy(), scene.normals.copy()
    shift = turn @ scene.origin + matrix[:3, 3] - scene.origin
    positions[chosen] = positions[chosen].astype(np.float64) @ turn.T + shift
    turned = normals[chosen].astype(np.float64) @ np.linalg.inv(turn)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    normals[chosen] = turned / np.where(length > 0.0, length, 1.0)
    return replace(scene, positions=positions, normals=normals)
