"""Small depth maps over a whole scene, one for each direction of light, and who reads which."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import TILE_ORDER
from ssgi_cl.core.scene import box_corners

Doubles = NDArray[np.float64]

PATTERN = 16
"""Sets of samples: each pixel of 4 x 4 takes another one."""
TURNS = 8
"""Turns about the direction of which the one with the smallest map is taken."""


def sample_views(directions: Doubles, bounds: Doubles, texels: int) -> tuple[Doubles, Doubles]:
    """Return views along directions over all of a box.

    Args:
        directions: [n, 3] to the light, unit length.
        bounds: [2, 3] least and greatest corner of the box.
        texels: along the side of a map.

    Returns:
        [n, 3, 4] matrices that take a point to (column, row, depth) of the map, depth > 0 along the
        light's way; and [n] the diagonal of a texel, in the units of the box.
    """
    corners = box_corners(bounds)
    extent = float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0
    least = 1e-4 * extent  # of a map's side: a flat scene seen edge on
    number = np.arange(len(directions))
    right = np.cross(np.eye(3)[np.abs(directions).argmin(axis=1)], directions)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(directions, right)
    angle = np.arange(TURNS) * (0.5 * math.pi / TURNS)
    cosine, sine = (turn[:, None, None] for turn in (np.cos(angle), np.sin(angle)))
    axes = np.stack([cosine * right + sine * up, cosine * up - sine * right], axis=2)  # [turns, n, 2, 3]
    at = axes @ corners.T
    low, side = at.min(axis=3), np.maximum(np.ptp(at, axis=3), least)
    best = side.prod(axis=2).argmin(axis=0), number
    scale = (texels - 2.0) / side[best]  # an empty texel all round
    views = np.empty((len(directions), 3, 4))
    views[:, :2, :3] = axes[best] * scale[..., None]
    views[:, :2, 3] = 1.0 - low[best] * scale
    views[:, 2, :3] = -directions
    views[:, 2, 3] = 1e-3 * extent + (directions @ corners.T).max(axis=1)
    return views, np.linalg.norm(1.0 / scale, axis=1)


def interleaved(count: int) -> NDArray[np.int64]:
    """Return which samples each pixel of a 4 x 4 tile takes: [count / 16, 4, 4] numbers.

    Of each 16 neighbours in the list every pixel takes one, so that each has some of everywhere.
    From one 16 to the next the order changes, so that no pixel has the same end of all.
    """
    groups = np.arange(count // PATTERN)[:, None, None]
    numbers: NDArray[np.int64] = PATTERN * groups + (TILE_ORDER ^ (groups * 11 % PATTERN))
    return numbers
