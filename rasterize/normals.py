"""Vertex normals for meshes that bring none: smooth, but split at sharp creases."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

DEFAULT_CREASE_ANGLE = math.radians(40.0)
"""Radians; faces that meet at a sharper angle keep an edge between them."""

_EDGES_OF_A_LINE = 3
"""Further faces along one line that a face is compared with (two coincident sheets share a line)."""


def crease_normals(
    positions: NDArray[np.float64], triangles: NDArray[np.int64], crease_angle: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Compute a normal for every corner of every triangle.

    Two triangles are smooth neighbours if they share an edge (by position, not by index) and their
    normals differ by at most `crease_angle`. The corners round a point that smooth neighbours
    connect form a group and share one normal: the mean of their face normals, weighted by the
    angle of the triangle at the point, so that it doesn't depend on how a flat face was cut.

    Args:
        positions: [vertices, 3] float64, scene units, finite where used.
        triangles: [triangles, 3] indices of vertices, none of zero area.
        crease_angle: radians, in [0, pi].

    Returns:
        [triangles, 3, 3] float64 unit normals, and [triangles, 3] int64, the same number for
        corners of one group and different numbers otherwise.
    """
    points = weld(positions)[triangles]
    corners = positions[triangles]
    faces = face_normals(corners)
    first, second = _smooth_corner_pairs(points, faces, math.cos(crease_angle) - 1e-9)
    groups = _connected(first, second, 3 * len(triangles))

    weights = _corner_angles(corners).ravel()
    repeated = np.repeat(faces, 3, axis=0)
    sums = np.stack(
        [np.bincount(groups, weights=weights * repeated[:, axis], minlength=len(groups)) for axis in range(3)], axis=1
    )[groups]
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    # Faces that cancel out have no mean direction: each keeps its own.
    fine = lengths > 1e-9
    normals = np.where(fine, sums / np.where(fine, lengths, 1.0), repeated)
    return normals.reshape(-1, 3, 3), groups.reshape(-1, 3)


def face_normals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [triangles, 3] unit normals of `corners` [triangles, 3, 3]; none has zero area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit: NDArray[np.float64] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return unit


def weld(positions: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return [vertices] int64: the same number for vertices at the very same position."""
    order = np.lexsort(positions.T)
    ordered = positions[order]
    starts = np.any(ordered[1:] != ordered[:-1], axis=1)
    numbers = np.empty(len(positions), dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(starts)])
    return numbers


def _corner_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    angles = np.empty(corners.shape[:2])
    for corner in range(3):
        left = corners[:, (corner + 1) % 3] - corners[:, corner]
        right = corners[:, (corner + 2) % 3] - corners[:, corner]
        sine = np.linalg.norm(np.cross(left, right), axis=1)
        angles[:, corner] = np.arctan2(sine, np.einsum("ij,ij->i", left, right))
    return angles


def _smooth_corner_pairs(
    points: NDArray[np.int64], faces: NDArray[np.float64], least_cosine: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of corner numbers (3 * triangle + corner) that smooth edges connect."""
    corner = np.arange(points.size).reshape(points.shape)
    start, end = points, np.roll(points, -1, axis=1)
    corner_start, corner_end = corner, np.roll(corner, -1, axis=1)
    # The same end first on both sides of an edge, whichever way round each triangle runs.
    turned = start > end
    low, high = np.where(turned, end, start).ravel(), np.where(turned, start, end).ravel()
    at_low = np.where(turned, corner_end, corner_start).ravel()
    at_high = np.where(turned, corner_start, corner_end).ravel()

    line = low * (int(points.max()) + 1) + high
    order = np.argsort(line, kind="stable")
    line, at_low, at_high = line[order], at_low[order], at_high[order]
    first, second = [], []
    for lag in range(1, _EDGES_OF_A_LINE + 1):
        pair = np.flatnonzero(line[lag:] == line[:-lag])
        cosine = np.einsum("ij,ij->i", faces[at_low[pair] // 3], faces[at_low[pair + lag] // 3])
        pair = pair[cosine >= least_cosine]
        first += [at_low[pair], at_high[pair]]
        second += [at_low[pair + lag], at_high[pair + lag]]
    return np.concatenate(first), np.concatenate(second)


def _connected(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return for each of `count` nodes the least node that the given pairs connect it with."""
    label = np.arange(count)
    while True:
        left, right = label[first], label[second]
        differ = left != right
        if not differ.any():
            return label
        first, second, left, right = first[differ], second[differ], left[differ], right[differ]
        # Hang the greater root below the lesser one, then shorten all the paths.
        np.minimum.at(label, np.maximum(left, right), np.minimum(left, right))
        while True:
            shorter = label[label]
            if np.array_equal(shorter, label):
                break
            label = shorter
