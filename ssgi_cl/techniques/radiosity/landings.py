"""Landings: surfels where rays meet surfaces in places of which no other surfel tells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import hashed
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES, cells_at
from ssgi_cl.techniques.radiosity.surface_cells import BEFORE
from ssgi_cl.techniques.radiosity.surface_points import surface_points, weights_at
from ssgi_cl.techniques.radiosity.surfels import Surfels, facing_axis, surfels_of
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays, scattered

Doubles = NDArray[np.float64]

RAYS = 2
"""Of each part."""
AREA = 1e-3
"""Of a part, in sides of a cell squared: others stand for the surface's area."""
SEED = 100
"""Of numbers that have nothing to do with those of other rays from the same parts."""


def landings(
    rays: TriangleRays,
    surfels: Surfels,
    low: Doubles,
    side: float,
    closed: Callable[[Doubles, Doubles], NDArray[np.bool_]],
) -> Surfels:
    """Return surfels of what rays from the parts of others meet, in cells that have no part of a surface that faces
    the same way. Waits for the device.

    Parts are drawn in proportion to areas, so that narrow surfaces, such as the edge of a board, have none: what rays
    find there would be that of a cell beside it, which may lie behind a wall.

    Args:
        rays: against the scene's triangles.
        surfels: of the scene, those that light reaches.
        low, side: corner of least coordinates, world space, and side of the cells of the light volume.
        closed: returns whether light does not come to the air in front of points, of positions and normals: of a
            hundred thousand rays some pass a seam between triangles.
    """
    scene = rays.scene
    own = surfels.part_area > 0.0
    position = (surfels.part_position + (surfels.origin - scene.origin))[own]
    normal, numbers = surfels.part_normal[own], surfels.part_number[own].astype(np.uint64)

    def slots(places: Doubles, normals: Doubles) -> NDArray[np.intp]:
        cell = cells_at((places + (scene.origin - low)) / side + BEFORE * normals)
        return cell * FACES + facing_axis(normals)

    known = np.zeros(CELLS**3 * FACES, np.bool_)
    known[slots(position, normal)] = True
    met, start = [], position + rays.lift * normal
    for ray in range(RAYS):
        places = np.stack([hashed(numbers, SEED + 2 * ray + axis) for axis in range(2)], axis=1)
        way = scattered(normal, places.astype(np.float64))
        met.append(rays.met(start, way))
    triangle, end, facing = map(np.concatenate, zip(*met, strict=True))
    emits = np.array([material.emits for material in scene.materials])[scene.material_ids]
    new = np.flatnonzero((triangle >= 0) & ~emits[triangle])
    slot = slots(end[new], facing[new])
    new = new[~known[slot]]
    _, first = np.unique(slot[~known[slot]], return_index=True)
    chosen = new[first]
    chosen = chosen[~closed(end[chosen], facing[chosen])]
    points, _ = surface_points(scene, triangle[chosen], weights_at(scene, triangle[chosen], end[chosen]))
    return surfels_of(scene, points._replace(normal=facing[chosen]), np.full(len(chosen), AREA * side**2))
