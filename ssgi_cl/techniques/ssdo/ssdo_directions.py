"""Directions of SSDO: fixed in the world, with what they stand for.

A direction and its opposite are one: a receiver takes the one on its own side. Each stands for
the part of the sphere that is nearer to it than to any other of its set, and the sky's light from
there is one number, whatever the sky looks like. A sky may also have a say in where directions lie:
then more of them are where it is bright.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import TILE_ORDER, r_points

Doubles = NDArray[np.float64]

SETS = (16, 4)
"""Rows and columns of a tile, each pixel of which has directions of its own. Kernels take columns
modulo 4 together; rows cost nothing, and the more sets the less is common to all tiles."""

BLOCK_ORDER = (0, 2, 1, 3)
"""Of the blocks of 4 x 4 pixels of a tile."""

CELLS = (64, 128)
"""Rows and columns of the equal parts of the sphere that are shared out to directions."""

EVEN = 0.5
"""Share of directions that lie evenly, however bright the sky is elsewhere."""


LEAST_CELLS = 1e-3
"""What a direction counts as having that is the nearest one to none: no solid angle is 0."""


@dataclass(frozen=True, eq=False)
class DirectionSets:
    """The directions of each pixel of a tile.

    Attributes:
        direction: [16, 4, count, 3] world space, unit length, one of each pair of opposite ones.
        length: [16, 4, count] a number in (0, 1) for each: where its taps lie.
        solid_angle: [16, 4, count] of each side, steradians.
        light: [16, 4, count, 2, 3] integral of the sky's radiance over the solid angle of the
            direction and of its opposite, W/m^2; None without a sky.
    """

    direction: Doubles
    length: Doubles
    solid_angle: Doubles
    light: Doubles | None


def direction_sets(count: int, sky: Doubles | None = None, *, equal: bool = False) -> DirectionSets:
    """Return the directions of a tile.

    Args:
        count: directions of a pixel.
        sky: [rows, columns, 3] radiance, a latitude-longitude image as `Environment` has it, or
            None.
        equal: whether directions lie evenly whatever the sky is, and all stand for 2 pi / count, as
            in equation 1 of Ritschel, Grosch and Seidel 2009.
    """
    return _even_sets(count, equal) if sky is None else _sets(count, sky, equal)


@lru_cache(maxsize=8)
def _even_sets(count: int, equal: bool) -> DirectionSets:
    return _sets(count, None, equal)


def _sets(count: int, sky: Doubles | None, equal: bool) -> DirectionSets:
    rows, columns = CELLS
    flux = None if sky is None else cell_flux(sky)
    density = np.ones((rows // 2, columns))
    if flux is not None and not equal:
        bright = flux.sum(axis=-1)
        # A direction and its opposite: turned by half a turn, and from above to below.
        bright = bright + np.roll(bright[::-1], columns // 2, axis=1)
        half = bright[: rows // 2]
        if half.sum() > 0.0:
            density = EVEN + (1.0 - EVEN) * half / half.mean()
    each_set = SETS[0] * SETS[1]
    first = np.concatenate([4 * TILE_ORDER + block for block in BLOCK_ORDER])
    points = r_points(0, each_set * count, 3)[first[..., None] + each_set * np.arange(count)]
    direction = _directions(density, points[..., 0], points[..., 1])
    cells = cell_centres().reshape(-1, 3)
    own = np.zeros((*SETS, count))
    light = None if flux is None else np.zeros((*SETS, count, 2, 3))
    each = 4.0 * np.pi / len(cells)
    for place in np.ndindex(SETS):
        along = cells @ direction[place].T
        nearest = np.argmax(np.abs(along), axis=1)
        cells_each = np.bincount(nearest, minlength=count)
        own[place] = np.maximum(cells_each, LEAST_CELLS) * (0.5 * each)
        if light is not None and flux is not None:
            opposite = along[np.arange(len(cells)), nearest] < 0.0
            np.add.at(light[place], (nearest, opposite.astype(int)), flux.reshape(-1, 3))
    if equal:
        own[:] = 2.0 * np.pi / count
    return DirectionSets(direction, points[..., 2] * (1.0 - 1e-3) + 5e-4, own, light)


def cell_centres() -> Doubles:
    """Return [rows, columns, 3]: directions of the middles of `CELLS`, world space."""
    rows, columns = CELLS
    up = 1.0 - 2.0 * (np.arange(rows)[:, None] + 0.5) / rows
    return _towards(up, ((np.arange(columns) + 0.5) / columns - 0.5)[None])


def cell_flux(sky: Doubles) -> Doubles:
    """Return [rows, columns, 3]: the integral of a sky's radiance over each of `CELLS`, W/m^2."""
    rows, columns = CELLS
    again = [-(-2 * CELLS[axis] // sky.shape[axis]) for axis in (0, 1)]
    fine = np.repeat(np.repeat(sky, again[0], axis=0), again[1], axis=1)
    edges = np.cos(np.linspace(0.0, np.pi, fine.shape[0] + 1))
    solid_angle = (edges[:-1] - edges[1:]) * 2.0 * np.pi / fine.shape[1]
    up = 0.5 * (edges[:-1] + edges[1:])
    row = np.clip(((1.0 - up) * 0.5 * rows).astype(int), 0, rows - 1)
    column = np.arange(fine.shape[1]) * columns // fine.shape[1]
    at = (row[:, None] * columns + column).ravel()
    flux = [np.bincount(at, (fine[..., c] * solid_angle[:, None]).ravel(), minlength=rows * columns) for c in range(3)]
    return np.stack(flux, axis=-1).reshape(rows, columns, 3).astype(np.float64)


def _directions(density: Doubles, u: Doubles, v: Doubles) -> Doubles:
    """Return directions [..., 3] of the upper half from u, v in [0, 1), as dense as `density`."""
    rows, columns = density.shape
    by_row = density.sum(axis=1)
    row, up = _inverted(by_row, u)
    shift = np.zeros(v.shape)
    for number in range(rows):
        here = row == number
        column, part = _inverted(density[number], v[here])
        shift[here] = (column + part) / columns - 0.5
    return _towards(1.0 - (row + up) / rows, shift)


def _inverted(density: Doubles, u: Doubles) -> tuple[NDArray[np.int_], Doubles]:
    """Return the part that a share u of the sum falls into, and how far into it, in [0, 1]."""
    ends = np.cumsum(density)
    wanted = u * ends[-1]
    part = np.minimum(np.searchsorted(ends, wanted, side="right"), len(density) - 1)
    before = ends[part] - density[part]
    return part, np.clip((wanted - before) / density[part], 0.0, 1.0)


def _towards(up: Doubles, turn: Doubles) -> Doubles:
    """Return directions of a height above the horizon and a share of a turn from -z to +x."""
    ring = np.sqrt(np.maximum(1.0 - up * up, 0.0))
    angle = 2.0 * np.pi * turn
    return np.stack(np.broadcast_arrays(ring * np.sin(angle), up, -ring * np.cos(angle)), axis=-1)
