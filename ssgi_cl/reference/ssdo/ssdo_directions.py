"""Numpy reference of the direction sets of SSDO in float64, generated from their definition."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
Image = tuple[tuple[int, ...], bytes]
"""Shape of an array of doubles, and its bytes: by these, results are kept."""

ROWS, COLUMNS = 16, 4
"""Size of the tile in which no two pixels have the same directions."""

UP, AROUND = 64, 128
"""Steps of height and of angle in which the sphere is divided into cells of equal area."""


@dataclass(frozen=True, eq=False)
class Directions:
    """For each pixel of the tile: [16, 4, count, ...].

    Attributes:
        direction: [..., 3] unit vectors, world space; each stands for its opposite too.
        length: in (0, 1): the position of the taps.
        solid_angle: of either side, steradians.
        light: [..., 2, 3] integral of the sky's radiance over the cells that are nearest to the
            direction, and to its opposite, W/m^2; None without a sky.
    """

    direction: Doubles
    length: Doubles
    solid_angle: Doubles
    light: Doubles | None


def directions(count: int, sky: Doubles | None = None, *, equal: bool = False) -> Directions:
    """Return the directions of all pixels of the tile, computed one after the other, and kept.

    Args:
        count: of each pixel.
        sky: [rows, columns, 3] radiance by latitude and longitude, or None.
        equal: whether all are evenly distributed, each with the solid angle 2 pi / count.
    """
    return _computed(count, None if sky is None else (np.shape(sky), sky.tobytes()), equal)


@lru_cache(maxsize=8)
def _computed(count: int, sky: Image | None, equal: bool) -> Directions:
    flux = np.zeros((UP, AROUND, 3)) if sky is None else _flux(sky)
    density = np.ones((UP // 2, AROUND))
    if sky is not None and not equal:
        bright = np.empty(density.shape)
        for row, column in np.ndindex(density.shape):
            opposite = flux[UP - 1 - row, (column + AROUND // 2) % AROUND]
            bright[row, column] = flux[row, column].sum() + opposite.sum()
        if bright.sum() > 0.0:
            density = 0.5 + 0.5 * bright / bright.mean()
    centre_up = 1.0 - (2.0 * np.arange(UP) + 1.0) / UP
    centre_turn = (np.arange(AROUND) + 0.5) / AROUND - 0.5
    cells = _towards(*np.meshgrid(centre_up, centre_turn, indexing="ij")).reshape(-1, 3)
    root = _root_of_r3()
    shape = (ROWS, COLUMNS, count)
    result = Directions(
        np.empty((*shape, 3)), np.empty(shape), np.empty(shape), None if sky is None else np.zeros((*shape, 2, 3))
    )
    for y, x in np.ndindex(ROWS, COLUMNS):
        first = 4 * _bayer(y % 4, x) + (0, 2, 1, 3)[y // 4]
        for number in range(count):
            # The R sequence in three dimensions (Roberts 2018), its points counted from 1.
            u, v, w = np.mod((first + 64 * number + 1.0) * root ** -np.arange(1.0, 4.0), 1.0)
            result.direction[y, x, number] = _placed(density, u, v)
            result.length[y, x, number] = 0.0005 + 0.999 * w
        along = cells @ result.direction[y, x].T
        owner = np.abs(along).argmax(axis=1)
        for number in range(count):
            mine = owner == number
            share = max(float(np.count_nonzero(mine)), 1e-3) / len(cells)
            result.solid_angle[y, x, number] = 2.0 * np.pi * (1.0 / count if equal else share)
            if result.light is not None:
                ahead = along[:, number] >= 0.0
                own = flux.reshape(-1, 3)
                result.light[y, x, number] = (own[mine & ahead].sum(0), own[mine & ~ahead].sum(0))
    return result


def _bayer(row: int, column: int) -> int:
    """Return the number of a pixel in Bayer's order of 4 x 4."""
    two = ((0, 2), (3, 1))
    return 4 * two[row % 2][column % 2] + two[row // 2][column // 2]


def _root_of_r3() -> float:
    """Return the real root of g^4 = g + 1."""
    roots = np.roots([1.0, 0.0, 0.0, -1.0, -1.0])
    real: Doubles = roots.real[np.abs(roots.imag) < 1e-9]
    return float(real.max())


def _placed(density: Doubles, u: float, v: float) -> Doubles:
    """Return the direction of the upper hemisphere that u, v in [0, 1) sample from a density."""
    rows = density.sum(axis=1)
    row, up = _found(rows, u)
    column, along = _found(density[row], v)
    turn = (column + along) / AROUND - 0.5
    return _towards(np.array(1.0 - (row + up) / (UP // 2)), np.array(turn))


def _found(weights: Doubles, u: float) -> tuple[int, float]:
    """Return the element at which the cumulative sum reaches the fraction u, and how far into it."""
    left = u * float(weights.sum())
    for number, weight in enumerate(weights.tolist()):
        if left < weight:
            return number, left / weight
        left -= weight
    return len(weights) - 1, 1.0


def _towards(up: Doubles, turn: Doubles) -> Doubles:
    ring = np.sqrt(np.maximum(1.0 - up**2, 0.0))
    angle = 2.0 * np.pi * turn
    return np.stack([ring * np.sin(angle), up, -ring * np.cos(angle)], axis=-1)


@lru_cache(maxsize=8)
def _flux(image: Image) -> Doubles:
    """Return [64, 128, 3]: radiance times solid angle of each cell of the sphere, W/m^2.

    Texels are divided into pieces of at most half a cell, each counted in the cell of its centre.
    """
    shape, texels = image
    sky, (height, width, _) = np.frombuffer(texels).reshape(shape), shape
    down, across = -(-2 * UP // height), -(-2 * AROUND // width)
    result = np.zeros((UP, AROUND, 3))
    edges = np.cos(np.linspace(0.0, np.pi, height * down + 1))
    for fine_row in range(height * down):
        middle = 0.5 * (edges[fine_row] + edges[fine_row + 1])
        row = min(max(int((1.0 - middle) * 0.5 * UP), 0), UP - 1)
        size = (edges[fine_row] - edges[fine_row + 1]) * 2.0 * np.pi / (width * across)
        for fine_column in range(width * across):
            column = fine_column * AROUND // (width * across)
            result[row, column] += size * sky[fine_row // down, fine_column // across]
    return result
