"""The grid of seen surfaces, and lines of sight through it, in float64."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.techniques.sight_grid import LIFT

Doubles = NDArray[np.float64]

ENDS = 5.0
"""Cells at both ends of a line that are not looked at; VPL_ENDS in kernels/vpl/grid.clh."""
SLOPE = 0.015
"""Cells by which a line may sink towards a surface at its ends; VPL_SLOPE there."""
STEPS = 4
"""Points of a piece of a line that lies in one block; VPL_STEPS there."""
APART = 16.0
"""Cells between two pixels that are filled; VPL_MOST_APART in kernels/vpl/vpl_occupy.cl."""
BEND = 0.5
"""Of the step to the next pixel, by which steps of one surface may differ; VPL_BEND there."""


class SightGridReference:
    """Which of cells^3 cubes hold a point of a surface, or of a line between neighbours on one.

    Args:
        inside: [n, 3] points that the grid has to span: receivers and lights.
        images: [rows, columns, 3] points of surfaces, in the same space, whose axes are the grid's;
            nan where nothing is.
        cells: along a side.

    Attributes:
        held: [cells, cells, cells] by z, y, x.
    """

    def __init__(self, inside: Doubles, images: Sequence[Doubles], cells: int) -> None:
        low, high = inside.min(axis=0), inside.max(axis=0)
        self.cell = (high - low).max() / (cells - 6)
        self.corner = low - 3.0 * self.cell
        self.held = np.zeros((cells, cells, cells), np.bool_)
        for image in images:
            at = (image - self.corner) / self.cell
            points = [at.reshape(-1, 3), _between(at), _between(at.swapaxes(0, 1))]
            found = np.concatenate(points)
            index = np.floor(found[np.isfinite(found).all(axis=-1)]).astype(np.int64)
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


def seen_surfaces(gbuffer: GBuffer, rsms: Sequence[ReflectiveShadowMap]) -> list[Doubles]:
    """Return the images of points in view space that the grid marks: of all layers and maps."""
    images = [
        (gbuffer.camera.unproject(np.where(np.isfinite(layer), layer, 1.0)), layer)
        for layer in np.reshape(gbuffer.depth, (-1, *np.shape(gbuffer.depth)[-2:]))
    ]
    images += [(np.asarray(rsm.position, np.float64), np.asarray(rsm.depth)) for rsm in rsms]
    view = gbuffer.camera.view
    return [
        np.where(np.isfinite(depth)[..., None], at, np.nan) @ view[:3, :3].T + view[:3, 3]
        for at, depth in images
    ]


def _between(at: Doubles) -> Doubles:
    """Return [n, 3] points between neighbours along the second axis that lie on one surface.

    In cells. A silhouette departs from the line to the pixel before, and to the one behind.
    """
    padded = np.pad(at, ((0, 0), (1, 1), (0, 0)), constant_values=np.nan)
    bends = np.sum(np.diff(padded, 2, axis=1) ** 2, axis=-1)
    bends[np.isnan(bends)] = np.inf
    start, step = at[:, :-1], np.diff(at, axis=1)
    joined = np.minimum(bends[:, :-1], bends[:, 1:]) < BEND**2 * np.sum(step**2, axis=-1)
    apart = np.abs(step).max(axis=-1)
    points = [np.empty((0, 3))]
    for i in range(1, int(APART)):
        chosen = joined & (apart > max(i, 1.0)) & (apart < APART)
        share = i / (np.floor(apart[chosen]) + 1.0)
        points.append(start[chosen] + step[chosen] * share[:, None])
    return np.concatenate(points)
