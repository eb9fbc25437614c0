"""Levels of points of `techniques.multires.multires_grid`, and interpolation between, in float64."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.filters.bilateral import off_plane
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

if TYPE_CHECKING:
    from ssgi_cl.techniques.multires.multires_grid import MultiresGridParams

BESIDE = ((0, -1), (0, 1), (-1, 0), (1, 0))
"""Rows and columns to neighbours, two in the row, two in the column."""
LEAST = 1e-9
"""Least sum of weights: MULTIRES_LEAST."""
BEGINS, ENDS, NO_SECOND_DIFFERENCE, BEYOND = 0.8, 1.1, 0.15, 1.4
"""Those of MULTIRES_ in kernels/multires/multires_interpolate.cl."""
UNKNOWN = 1e30
"""A slope of which nothing is known; MULTIRES_UNKNOWN in kernels/multires/points.clh."""

Integers = NDArray[np.int_]


def multires_grid_reference(
    gbuffer: GBuffer, truth: ArrayLike, bound: float, params: MultiresGridParams
) -> tuple[NDArray[np.float64], NDArray[np.int_]]:
    """Return what interpolation makes of an image computed at some of its pixels.

    Args:
        gbuffer: of the image.
        truth: [rows, columns, channels], >= 0: what a pixel gets if it is computed.
        bound: what errors stay below, in the unit of `truth`; inf: geometry decides.
        params: see `MultiresGridParams`.

    Returns:
        Values [rows, columns, channels], and [rows, columns] the step of the level that computed a
        pixel, 0 where it was interpolated or nothing is.
    """
    view = SurfaceView.of(gbuffer)
    image = np.asarray(truth, np.float64)
    there = np.isfinite(view.inner(view.depth))
    steps = np.where(there, 1, 0)
    coarsest = params.coarsest
    spacings = [coarsest >> level for level in range(coarsest.bit_length())]
    values = np.where(there[..., None], image, 0.0)[::coarsest, ::coarsest]
    computed = np.zeros(view.size, int)
    computed[::coarsest, ::coarsest] = coarsest * steps[::coarsest, ::coarsest]
    for step in spacings[1:]:
        level = _Level(view, step, params)
        guess, share = level.interpolate(values, bound * bound_share(step))
        here = there[::step, ::step]
        values = guess + share[..., None] * (image[::step, ::step] - guess)
        values = np.where(here[..., None], values, 0.0)
        computed[::step, ::step] += step * (here & (share > 0.0))
    return values, computed


def bound_share(step: int) -> float:
    """Return the largest error at points `step` pixels apart over that asked for: 4 / step."""
    return 4.0 / step


@dataclass(frozen=True)
class _Level:
    """Points `step` pixels apart, which get their values from those twice as far apart."""

    view: SurfaceView
    step: int
    params: MultiresGridParams

    def weight(self, at: tuple[Integers, Integers], to: tuple[Integers, Integers]) -> Doubles:
        """Return how well pixels (rows, columns) `to` fit those `at`; 0 outside the image."""
        view = self.view
        depth, normal = view.inner(view.depth), view.inner(view.normal)
        rows, columns = (view.inner(centre) for centre in view.centres())
        y, x = (np.clip(to[i], 0, view.size[i] - 1) for i in (0, 1))
        there = (y == to[0]) & (x == to[1]) & np.isfinite(depth[y, x]) & np.isfinite(depth[at])
        own = np.where(np.isfinite(depth[at]), depth[at], 1.0)
        off = off_plane(
            view, rows[y, x], columns[y, x], np.where(there, depth[y, x], 1.0), (rows[at], columns[at], own, normal[at])
        )
        cosine = np.sum(normal[at] * normal[y, x], axis=-1)
        fit = (
            1.0
            - (off / self.params.plane_tolerance) ** 2
            - (1.0 - cosine) / (1.0 - math.cos(self.params.normal_tolerance))
        )
        return np.where(there, np.maximum(fit, 0.0), 0.0) ** 2

    def gradient(self, values: Doubles, bound: float) -> tuple[Doubles, Doubles]:
        """Return the slope and the bend at the coarse points."""
        twice = 2 * self.step
        row, column = _places(values.shape[0], values.shape[1])
        last = (values.shape[0] - 1, values.shape[1] - 1)
        own = (row * twice, column * twice)
        ends = [(column == 0) | (column == last[1]), (row == 0) | (row == last[0])]
        beside, fits = [], []
        for down, right in BESIDE:
            y, x = row + down, column + right
            # Past the first and the last column lies nothing, past rows their nearest again.
            inside = ((x >= 0) & (x <= last[1]))[..., None]
            near = values[np.clip(y, 0, last[0]), np.clip(x, 0, last[1])]
            beside.append(np.where(inside, near, 0.0))
            # A fit is lost where the neighbour's pixel lies outside the image.
            fits.append(self.weight(own, (y * twice, x * twice)) > 0.0)
        apart = [np.abs(values - other).max(-1) for other in beside]
        slopes, second_differences = [], []
        for a, b in ((0, 1), (2, 3)):
            most = np.maximum(np.where(fits[a], apart[a], 0.0), np.where(fits[b], apart[b], 0.0))
            slopes.append(np.where(fits[a] | fits[b], most, UNKNOWN))
            second_difference = np.abs(beside[a] + beside[b] - 2.0 * values).max(-1)
            second_differences.append(np.where(fits[a] & fits[b], second_difference, np.where(ends[a // 2], 0.0, -1.0)))
        spread = np.max(apart, axis=0)
        even = spread <= bound
        unknown = even | (np.minimum(*second_differences) < 0.0) | (ends[0] & ends[1])
        return (np.where(even, spread, np.maximum(*slopes)), np.where(unknown, -1.0, np.maximum(*second_differences)))

    def interpolate(self, values: Doubles, bound: float) -> tuple[Doubles, Doubles]:
        """Return values at this level's points, and which share of them is to be computed."""
        rows, columns = (-(-length // self.step) for length in self.view.size)
        size = (rows, columns)
        row, column = _places(rows, columns)
        own = (row * self.step, column * self.step)
        slope, second_difference = self.gradient(values, bound)
        odd_row, odd = row % 2, column % 2
        total, slopes, widest = np.zeros(size), np.zeros(size), np.zeros(size)
        mean = np.zeros((*size, values.shape[-1]))
        least = np.full(size, np.inf)
        second_differences = np.full(size, -1.0)
        first = values[row // 2, column // 2]
        for down in (0, 1):
            for right in (0, 1):
                counts = (down <= odd_row) & (right <= odd)
                y, x = row // 2 + down, column // 2 + right
                near = (np.minimum(y, values.shape[0] - 1), np.minimum(x, values.shape[1] - 1))
                inside = (x < values.shape[1])[..., None]
                corner = np.where(inside, values[near], 0.0)
                weight = self.weight(own, (y * 2 * self.step, x * 2 * self.step))
                weight = np.where(counts, weight, 0.0)
                total += weight
                mean += weight[..., None] * corner
                least = np.where(counts, np.minimum(least, weight), least)
                apart = np.abs(corner - first).max(-1)
                widest = np.where(counts, np.maximum(widest, apart), widest)
                fits = weight > 0.0
                slopes = np.where(fits, np.maximum(slopes, slope[near]), slopes)
                second_differences = np.where(
                    fits, np.maximum(second_differences, second_difference[near]), second_differences
                )
        lines = odd_row + odd
        mean /= np.where(total > 0.0, total, 1.0)[..., None]
        weight_imbalance = 1.0 - least / np.where(total > 0.0, total, 1.0) * 2.0**lines
        curved = np.minimum(second_differences * lines / 16.0, 0.5 * widest)
        straight = np.where(second_differences >= 0.0, curved, NO_SECOND_DIFFERENCE * widest)
        lean = 0.5 * weight_imbalance
        error = np.where(least > 0.0, straight + lean * widest, lean * slopes * BEYOND)
        tilted = (0.25 + 0.5 * weight_imbalance) * widest
        error = np.where(least > 0.0, np.minimum(error, tilted), error)
        itself = lines == 0
        share = np.where(total > LEAST, faded(error, bound), 1.0)
        return np.where(itself[..., None], first, mean), np.where(itself, 0.0, share)


def faded(error: Doubles, bound: float) -> Doubles:
    """Return how much of a value is computed: 0 up to a part of the bound, 1 a little above it."""
    if bound in (0.0, math.inf):
        return np.full_like(error, bound == 0.0)
    return np.clip((error / bound - BEGINS) / (ENDS - BEGINS), 0.0, 1.0)


def _places(rows: int, columns: int) -> tuple[Integers, Integers]:
    """Return row and column of every point."""
    row, column = np.indices((rows, columns))
    return row, column
