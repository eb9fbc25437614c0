"""The grid of seen surfaces, and lines of sight through it, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.sight_grid import BLOCK, LIFT

Doubles = NDArray[np.float64]

ENDS = 5.0
"""Cells at both ends of a line that are not looked at; VPL_ENDS in kernels/vpl/grid.clh."""
SLOPE = 0.015
"""Cells by which a line may sink towards a surface at its ends; VPL_SLOPE there."""
STEPS = 4
"""Points of a piece of a line that lies in one block; VPL_STEPS there."""


class SightGridReference:
    """Which of cells^3 cubes hold one of the points.

    Args:
        inside: [n, 3] points that the grid has to span: receivers and lights.
        points: [m, 3] points of surfaces, in the same space, whose axes are the grid's.
        cells: along a side.

    Attributes:
        held: [cells, cells, cells] by z, y, x.
    """

    def __init__(self, inside: Doubles, points: Doubles, cells: int) -> None:
        low, high = inside.min(axis=0), inside.max(axis=0)
        self.cell = (high - low).max() / (cells - 6)
        self.corner = low - 3.0 * self.cell
        self.held = np.zeros((cells, cells, cells), np.bool_)
        index = np.floor((points - self.corner) / self.cell).astype(np.int64)
        x, y, z = index[((index >= 0) & (index < cells)).all(axis=-1)].T
        self.held[z, y, x] = True

    def hidden(
        self, point: Doubles, normal: Doubles, light: Doubles, axis: Doubles
    ) -> NDArray[np.bool_]:
        """Return [n] whether a surface is met between points [n, 3] and a light.

        Blocks of 4 x 4 x 4 cells cut a line into pieces, of each of which `STEPS` points are looked
        at.
        """
        start = (point - self.corner) / self.cell + LIFT * normal
        way = (light - self.corner) / self.cell + LIFT * axis - start
        length = np.linalg.norm(way, axis=-1)
        ends = np.minimum(ENDS / np.maximum(length, 1e-3), 0.5)
        planes = np.arange(BLOCK, len(self.held), BLOCK)
        slope = np.where(np.abs(way) < 1e-9, 1e-9, way)
        cuts = ((planes - start[..., None]) / slope[..., None]).reshape(len(point), -1)
        cuts = np.concatenate([ends[:, None], cuts, 1.0 - ends[:, None]], axis=1)
        cuts = np.sort(np.clip(cuts, ends[:, None], 1.0 - ends[:, None]), axis=1)
        met = np.zeros(len(point), np.bool_)
        for i in range(STEPS):
            share = cuts[:, :-1] + np.diff(cuts, axis=1) * (i + 0.5) / STEPS
            x, y, z = np.moveaxis(
                np.floor(start[:, None] + way[:, None] * share[..., None]).astype(np.int64), -1, 0
            )
            # Pieces of no length lie on the sides of cells, where rounding decides.
            met |= (self.held[z, y, x] & (np.diff(cuts, axis=1) > 1e-9)).any(axis=1)
        rises = np.sum(way * normal, axis=-1) > -SLOPE
        falls = way @ axis < SLOPE
        followed: NDArray[np.bool_] = met & rises & falls & (length > 2.0 * ENDS)
        return followed
