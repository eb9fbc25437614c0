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
    views, diagonals = np.zeros((len(directions), 3, 4)), np.zeros(len(directions))
    for number, to_light in enumerate(directions):
        other = np.eye(3)[np.abs(to_light).argmin()]
        right = np.cross(other, to_light)
        right /= np.linalg.norm(right)
        up = np.cross(to_light, right)
        angle = np.arange(TURNS) * (0.5 * math.pi / TURNS)
        u = np.cos(angle)[:, None] * right + np.sin(angle)[:, None] * up
        v = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * right
        at = np.stack([corners @ u.T, corners @ v.T])  # [2, corners, turns]
        low, high = at.min(axis=1), at.max(axis=1)
        side = np.maximum(high - low, least)
        best = int((side[0] * side[1]).argmin())
        scale = (texels - 2.0) / side[:, best]  # an empty texel all round
        axes = np.stack([u[best], v[best]])
        depth = corners @ -to_light
        views[number, :2, :3] = axes * scale[:, None]
        views[number, :2, 3] = 1.0 - low[:, best] * scale
        views[number, 2, :3] = -to_light
        views[number, 2, 3] = 1e-3 * extent - depth.min()
        diagonals[number] = float(np.linalg.norm(1.0 / scale))
    return views, diagonals


def interleaved(count: int) -> NDArray[np.int64]:
    """Return which samples each pixel of a 4 x 4 tile takes: [count / 16, 4, 4] numbers.

    Of each 16 neighbours in the list every pixel takes one, so that each has some of everywhere.
    From one 16 to the next the order changes, so that no pixel has the same end of all.
    """
    groups = np.arange(count // PATTERN)[:, None, None]
    numbers: NDArray[np.int64] = PATTERN * groups + (TILE_ORDER ^ (groups * 11 % PATTERN))
    return numbers
