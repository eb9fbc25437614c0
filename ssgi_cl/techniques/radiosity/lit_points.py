"""Which points of surfaces light can reach: not the insides of things, nor floors below them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.techniques.radiosity.air import Air
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays, point_rows

Doubles = NDArray[np.float64]
Flags = NDArray[np.bool_]

BOUNCES = 4
"""Of a path from a point, at most: what is farther from light has little of it."""
RAYS = 16
"""Directions of a bounce, for each of the places in the tile of points; a power of two."""
FEW_POINTS, FEW_REACHED = 64, 0.02
"""Points that a space of the air is in front of, at least, and of them the share that light reaches, up to which the
space is closed. From the insides of closed boxes less gets out, through seams of their meshes."""
LIT, CLOSED = 1, -1


class LitPoints:
    """What finds out to which points of surfaces light comes, by the spaces of a scene's air.

    That is where a space that light enters is in front of a point, or where a path of light that begins there comes
    through one. As rays meet triangles, a slit that the grid closes is open to them, and a wall thinner than a cell is
    none for the grid alone.

    Args:
        rays: against the triangles of a scene without holes.
        air: of its occupancy grid.
        low: [3] of the grid, its corner of least coordinates, scene units, relative to the scene's origin.
        side: of its cells, scene units.
        room: likewise, before a surface where cells are empty if nothing is in front.

    Attributes:
        rays: as given.
        states: [spaces] `LIT`, `CLOSED`, or 0 where paths tell; that of no space is 0.
    """

    def __init__(self, rays: TriangleRays, air: Air, low: Doubles, side: float, room: float) -> None:
        self.rays = rays
        self._air, self._low, self._side, self._room = air, low, side, room
        self._spaces = rays.runtime.array(air.numbers.ravel())
        self._ways = rays.runtime.array(hemisphere_ways(RAYS))
        self.states = np.zeros(int(air.numbers.max(initial=0)) + 1, np.int32)

    def enter(self, lit: frozenset[int], position: Doubles, normal: Doubles) -> None:
        """Take the spaces that light certainly enters; points of surfaces, see `reached`, tell which are closed."""
        self.states[:] = 0
        self.states[list(lit)] = LIT
        reached = self.reached(position, normal, np.arange(len(position)))
        before = self._before(position, normal)
        count = len(self.states)
        points = np.bincount(before, minlength=count)
        share = np.bincount(before, reached, count) / np.maximum(points, 1)
        closed = (points >= FEW_POINTS) & (share < FEW_REACHED) & (self.states == 0)
        closed[0] = False
        self.states[closed] = CLOSED

    def closed(self, position: Doubles, normal: Doubles) -> Flags:
        """Return [n] which points [n, 3], see `reached`, have a closed space in front of them."""
        found: Flags = self.states[self._before(position, normal)] == CLOSED
        return found

    def _before(self, position: Doubles, normal: Doubles) -> NDArray[np.int32]:
        return self._air.at((position + self._room * normal - self._low) / self._side)

    def reached(self, position: Doubles, normal: Doubles, numbers: NDArray[np.intp]) -> Flags:
        """Return [n] to which points light comes, with few exceptions. Waits for the device.

        Args:
            position, normal: [n, 3] of the points, relative to the scene's origin.
            numbers: [n] by which they have their paths.
        """
        count, rays, runtime = len(position), self.rays, self.rays.runtime
        rows = point_rows(position, normal)
        stride = rows.shape[1]
        own = np.zeros(stride, np.int32)
        own[:count] = numbers % (RAYS * TILE * TILE)
        found = runtime.empty(stride, np.float32)
        cell: dict[str, Any] = {f"cell_{axis}": float(-self._low[i] / self._side) for i, axis in enumerate("xyz")}
        runtime.kernel("radiosity/radiosity_reached.cl", rays.bvh.first_macros).run(
            (1, stride),
            points=runtime.array(rows),
            numbers=runtime.array(own),
            ways=self._ways,
            **rays.bvh.first,
            spaces=self._spaces,
            states=runtime.array(self.states),
            reached=found,
            cells=len(self._air.numbers),
            bounces=BOUNCES,
            rays=RAYS,
            lift=rays.lift,
            room=self._room,
            reach=rays.reach,
            per_cell=1.0 / self._side,
            **cell,
        )
        reached: Flags = found.download()[:count] > 0.0
        return reached
