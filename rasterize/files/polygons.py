"""Cutting polygons into triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError

_MOST_CONCAVE_CORNERS = 1000
"""Clipping ears takes time with the square of the corners."""

_OTHER_DIAGONAL = np.array([[3, 0, 1], [1, 2, 3]])
"""Of a quadrilateral whose fan folds over."""


def triangulate(counts: NDArray[np.int64], points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut polygons into triangles: fans where a fan fits, clipped ears where it is concave.

    Args:
        counts: [polygons], the number of corners of each; those below 3 give no triangle.
        points: [sum of counts, 3] float64, the corners of one polygon after the other.

    Returns:
        [triangles, 3] indices of rows of `points`, and [triangles], the polygon of each; in the
        order of the polygons.

    Raises:
        SceneError: a concave polygon has too many corners to be cut in reasonable time.
    """
    starts = np.cumsum(counts) - counts
    triangles: list[NDArray[np.int64]] = [np.zeros((0, 3), dtype=np.int64)]
    owners: list[NDArray[np.int64]] = [np.zeros(0, dtype=np.int64)]
    for count in np.unique(counts[counts >= 3]):
        polygons = np.flatnonzero(counts == count)
        step = np.arange(1, count - 1)
        fan = np.stack([np.zeros_like(step), step, step + 1], axis=1)
        corners = starts[polygons, None, None] + fan
        if count > 3:
            concave = _fan_folds_over(points[corners])
            if count == 4:  # the other diagonal then
                corners[concave] = starts[polygons[concave], None, None] + _OTHER_DIAGONAL
                concave[:] = False
            for polygon in polygons[concave]:
                outline = np.arange(starts[polygon], starts[polygon] + count)
                corners[np.searchsorted(polygons, polygon)] = _clip_ears(outline, points)
        triangles.append(corners.reshape(-1, 3))
        owners.append(np.repeat(polygons, count - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


def _fan_folds_over(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return [polygons] bool: some triangle of the fan [polygons, triangles, 3, 3] is reversed."""
    with np.errstate(invalid="ignore", over="ignore"):
        normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        facing = np.einsum("ptk,pk->pt", normals, normals.sum(axis=1))
    folds: NDArray[np.bool_] = (facing < 0).any(axis=1)
    return folds


def _clip_ears(outline: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return [corners - 2, 3]: the polygon cut by taking off ears (Meisters 1975)."""
    if len(outline) > _MOST_CONCAVE_CORNERS:
        raise SceneError(f"a concave polygon has {len(outline)} corners: cut it into triangles")
    corners = points[outline]
    spokes = corners - corners[0]
    normal = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
    # Flat coordinates that keep the turn: drop the axis along which the polygon is thinnest.
    axis = int(np.abs(normal).argmax())
    flat = corners[:, [(axis + 1) % 3, (axis + 2) % 3]] * [np.sign(normal[axis]), 1.0]
    left = list(range(len(outline)))
    state = [_is_ear(flat, left, i) for i in left]
    ears = []
    while len(left) > 3:
        ear = state.index(True) if True in state else 0
        ears.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear], state[ear]
        # Only the two neighbours have other neighbours now; what was inside no ear still isn't.
        for place in (ear - 1, ear % len(left)):
            state[place] = _is_ear(flat, left, place % len(left))
    cut: NDArray[np.int64] = outline[np.array([*ears, left])]
    return cut


def _is_ear(flat: NDArray[np.float64], left: list[int], place: int) -> bool:
    names = [left[place - 1], left[place], left[(place + 1) % len(left)]]
    a, b, c = flat[names]
    if _turn(a, b, c) <= 0:
        return False
    others = flat[[name for name in left if name not in names]]
    inside = (_turn(a, b, others) >= 0) & (_turn(b, c, others) >= 0) & (_turn(c, a, others) >= 0)
    return not bool(np.any(inside))


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    turn: NDArray[np.float64] = (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
    return turn
