"""The grid of seen surfaces, and lines of sight through it, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.sight_grid import LIFT

Doubles = NDArray[np.float64]

ENDS = 3.0
"""Cells at both ends of a line that are not looked at; VPL_ENDS in kernels/vpl/grid.clh."""
SLOPE = 0.015
"""Cells by which a line may sink towards a surface at its ends; VPL_SLOPE there."""


class SightGridReference:
    """Which of cells^3 cubes hold one of the points.

    Args:
        inside: [n, 3] points that the grid has to span: receivers and lights.
        points: [m, 3] points of surfaces, in the same space, whose axes are the grid's.
        cells: along a side.
        steps: points at which a line is looked at.

    Attributes:
        held: [cells, cells, cells] by z, y, x.
    """

    def __init__(self, inside: Doubles, points: Doubles, cells: int, steps: int) -> None:
        low, high = inside.min(axis=0), inside.max(axis=0)
        self.steps = steps
        self.cell = (high - low).max() / (cells - 6)
        self.corner = low - 3.0 * self.cell
        self.held = np.zeros((cells, cells, cells), np.bool_)
        index = np.floor((points - self.corner) / self.cell).astype(np.int64)
        x, y, z = index[((index >= 0) & (index < cells)).all(axis=-1)].T
        self.held[z, y, x] = True

    def hidden(
        self, point: Doubles, normal: Doubles, light: Doubles, axis: Doubles, phase: float
    ) -> NDArray[np.bool_]:
        """Return [n] whether a surface is met between points [n, 3] and a light."""
        start = (point - self.corner) / self.cell + LIFT * normal
        way = (light - self.corner) / self.cell + LIFT * axis - start
        length = np.linalg.norm(way, axis=-1)
        ends = np.minimum(ENDS / np.maximum(length, 1e-3), 0.5)
        met = np.zeros(len(point), np.bool_)
        for i in range(self.steps):
            share = ends + (1.0 - 2.0 * ends) * (i + phase) / self.steps
            x, y, z = np.floor(start + way * share[:, None]).astype(np.int64).T
            met |= self.held[z, y, x]
        rises = np.sum(way * normal, axis=-1) > -SLOPE
        falls = way @ axis < SLOPE
        followed: NDArray[np.bool_] = met & rises & falls & (length > 2.0 * ENDS)
        return followed
