"""Occupancy grid, and shadow rays through it, in float64."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap

Doubles = NDArray[np.float64]

LIFT, MESH_LIFT = 1.9, 1.5
"""Cells above their surfaces at which rays begin and end: seen surfaces, triangles."""
ENDS = 5.0
"""Cells at either end whose surfaces count only if the ray leaves them; OCCUPANCY_ENDS in
kernels/occupancy/grid.clh."""
TOWARDS = 3
"""Cells towards the eye that a ray starts from a surface at most; OCCUPANCY_TOWARDS there."""
SLOPE = 0.015
"""Cells by which a line may sink towards a surface at its ends; OCCUPANCY_SLOPE there."""
APART = 16.0
"""Cells between two pixels that are filled; PIXEL_MOST_APART in kernels/occupancy/occupancy_pixels.cl."""
BEND = 0.5
"""Difference between steps of one surface, over the step to the next pixel; PIXEL_BEND there."""


class OccupancyGridReference:
    """Occupied cells of cells^3 cubes.

    Without `triangles` cells that hold a point of a surface, or of a line between neighbours on
    one; with them, those that they occupy, see `voxelized`.

    Args:
        inside: [n, 3] points that the grid has to span: receivers and lights.
        images: [rows, columns, 3] points of surfaces, in the same space, whose axes are the grid's;
            nan where nothing is.
        cells: along a side.
        triangles: [n, 3, 3] corners in the same space.

    Attributes:
        held: [cells, cells, cells] by z, y, x.
        lift: cells above their surfaces at which rays begin and end.
    """

    def __init__(
        self, inside: Doubles, images: Sequence[Doubles], cells: int, triangles: Doubles | None = None
    ) -> None:
        low, high = inside.min(axis=0), inside.max(axis=0)
        self.cell = (high - low).max() / (cells - 6)
        self.corner = low - 3.0 * self.cell
        self.held = np.zeros((cells, cells, cells), np.bool_)
        self.lift = LIFT if triangles is None else MESH_LIFT
        if triangles is not None:
            self.occupy(triangles)
            return
        for image in images:
            at = (image - self.corner) / self.cell
            points = [at.reshape(-1, 3), _between(at), _between(at.swapaxes(0, 1))]
            found = np.concatenate(points)
            index = np.floor(found[np.isfinite(found).all(axis=-1)]).astype(np.int64)
            x, y, z = index[((index >= 0) & (index < cells)).all(axis=-1)].T
            self.held[z, y, x] = True

    def occupy(self, triangles: Doubles) -> None:
        """Mark the cells that triangles [n, 3, 3] occupy."""
        for triangle in (triangles - self.corner) / self.cell:
            x, y, z = voxelized(triangle, len(self.held)).T
            self.held[z, y, x] = True

    def hidden(
        self, point: Doubles, normal: Doubles, light: Doubles, axis: Doubles, eye: Doubles | None = None
    ) -> NDArray[np.bool_]:
        """Return [n] whether a surface blocks the ray from points [n, 3] to a light or [n, 3].

        All cells that a ray crosses are visited. Occupied ones up to the first empty one don't
        count, nor those from the last empty one on, up to `ENDS` cells from either end. With
        directions [n, 3] to the `eye`, rays start as many cells towards it as it takes to be in an
        empty one, at most `TOWARDS`.
        """
        start = (point - self.corner) / self.cell + self.lift * normal
        if eye is not None:
            start = self._towards(start, eye)
        way = (light - self.corner) / self.cell + self.lift * axis - start
        length = np.linalg.norm(way, axis=-1)
        ends = np.minimum(ENDS / np.maximum(length, 1e-3), 0.5)[:, None]
        planes = np.arange(1, len(self.held))
        slope = np.where(np.abs(way) < 1e-9, 1e-9, way)
        cuts = ((planes - start[..., None]) / slope[..., None]).reshape(len(point), -1)
        cuts = np.pad(np.sort(np.clip(cuts, 0.0, 1.0), axis=1), ((0, 0), (1, 1)))
        cuts[:, -1] = 1.0
        enter = cuts[:, :-1]
        middle = 0.5 * (enter + cuts[:, 1:])
        x, y, z = np.moveaxis(np.floor(start[:, None] + way[:, None] * middle[..., None]).astype(np.int64), -1, 0)
        # Pieces of no length lie on the sides of cells, where rounding decides.
        real = np.diff(cuts, axis=1) * length[:, None] > 1e-9
        full, empty = real & self.held[z, y, x], real & ~self.held[z, y, x]
        free = np.logical_or.accumulate(empty | (real & (enter >= ends)), axis=1)
        blocking = full & free
        behind = np.logical_or.accumulate(empty[:, ::-1], axis=1)[:, ::-1]
        met = (blocking & (behind | (enter < 1.0 - ends))).any(axis=1)
        rises = np.sum(way * normal, axis=-1) > -SLOPE
        followed: NDArray[np.bool_] = met & rises & (np.sum(way * axis, axis=-1) < SLOPE)
        return followed

    def _towards(self, start: Doubles, eye: Doubles) -> Doubles:
        """Return points [n, 3] in cells, moved in directions [n, 3] out of occupied cells."""
        for _ in range(TOWARDS):
            x, y, z = np.floor(start).astype(np.int64).T
            start = start + np.where(self.held[z, y, x][:, None], eye, 0.0)
            start = np.clip(start, 0.0, len(self.held) - 0.01)
        return start


def voxelized(triangle: Doubles, cells: int) -> NDArray[np.int64]:
    """Return [n, 3] the cells that a triangle occupies, by x, y, z; some of them several times.

    6-separating (Laine 2013, "A Topological Approach to Voxelization"): those where it meets an
    axis-parallel segment of the length of a cell through the cell's centre.

    Args:
        triangle: [3, 3] corners, in cells.
        cells: along a side of the grid.
    """
    found = [np.empty((0, 3), np.int64)]
    a, edge_b, edge_c = triangle[0], triangle[1] - triangle[0], triangle[2] - triangle[0]
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        area = edge_b[u] * edge_c[v] - edge_b[v] * edge_c[u]
        if area == 0.0:
            continue
        low = np.clip(np.floor(triangle.min(axis=0)).astype(np.int64), 0, cells)
        high = np.clip(np.floor(triangle.max(axis=0)).astype(np.int64) + 1, 0, cells)
        column = np.stack(
            np.meshgrid(np.arange(low[u], high[u]), np.arange(low[v], high[v]), indexing="ij"), axis=-1
        ).reshape(-1, 2)
        p, q = column[:, 0] + 0.5 - a[u], column[:, 1] + 0.5 - a[v]
        of_b = (p * edge_c[v] - q * edge_c[u]) / area
        of_c = (edge_b[u] * q - edge_b[v] * p) / area
        met = (of_b >= 0.0) & (of_c >= 0.0) & (of_b + of_c <= 1.0)
        along = np.floor(a[axis] + of_b * edge_b[axis] + of_c * edge_c[axis]).astype(np.int64)
        met &= (along >= 0) & (along < cells)
        cell = np.empty((len(column), 3), np.int64)
        cell[:, axis], cell[:, u], cell[:, v] = along, column[:, 0], column[:, 1]
        found.append(cell[met])
    return np.concatenate(found)


def seen_surfaces(gbuffer: GBuffer, rsms: Sequence[ReflectiveShadowMap]) -> list[Doubles]:
    """Return the images of points in view space that the grid marks: of all layers and maps."""
    images = [
        (gbuffer.camera.unproject(np.where(np.isfinite(layer), layer, 1.0)), layer)
        for layer in np.reshape(gbuffer.depth, (-1, *np.shape(gbuffer.depth)[-2:]))
    ]
    images += [(np.asarray(rsm.position, np.float64), np.asarray(rsm.depth)) for rsm in rsms]
    view = gbuffer.camera.view
    return [np.where(np.isfinite(depth)[..., None], at, np.nan) @ view[:3, :3].T + view[:3, 3] for at, depth in images]


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
