"""Directions over the hemisphere, jittered in strata, for the points of a tile."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TILE = 8
"""Points along a tile's side; a power of two."""
SEED = 7


def hemisphere_ways(rays: int) -> NDArray[np.float32]:
    """Return [n, 3, TILE^2] directions of unit length, z up, in proportion to the cosine.

    n is r (rays // r), with r the integer part of the square root of `rays`. Those of one of the TILE^2 points of a
    tile are jittered within n strata of equal weight; those of all points together lie one in each of n TILE^2 strata.
    Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
    """
    rows, random = math.isqrt(rays), np.random.default_rng(SEED)
    columns = rays // rows
    row, column = np.divmod(np.arange(rows * columns), columns)
    within = np.stack([random.permutation(TILE * TILE) for _ in row])
    down, right = np.divmod(within, TILE)
    x, y = (
        2.0 * (stratum[:, None] + (part + random.random(within.shape)) / TILE) / strata - 1.0
        for stratum, part, strata in ((column, right, columns), (row, down, rows))
    )
    wide = np.abs(x) > np.abs(y)
    radius, other = np.where(wide, x, y), np.where(wide, y, x)
    turn = math.pi / 4.0 * other / np.where(radius == 0.0, 1.0, radius)
    angle = np.where(wide, turn, math.pi / 2.0 - turn)
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    return np.stack([u, v, np.sqrt(np.maximum(1.0 - radius * radius, 0.0))], axis=1).astype(np.float32)
