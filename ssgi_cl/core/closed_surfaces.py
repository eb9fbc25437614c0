"""Which triangles bound a solid: those of closed surfaces, and which of their sides is the outer one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ssgi_cl.core.scene import Scene


def closed_sides(scene: Scene) -> NDArray[np.int8]:
    """Return [triangles]: 1 where a triangle of a closed surface is counter-clockwise seen from outside, -1 inside.

    Triangles belong together that share an edge, whose ends are at the same place bit for bit. A surface is closed if
    each of its edges is passed as often in one direction as in the other. Its outer side is that from which it encloses
    a positive volume. 0 for triangles of open surfaces, and for those that have holes, let light pass, or whose back is
    not there.
    """
    _, place = np.unique(_keys(scene.positions), return_inverse=True)
    corners = place.reshape(-1)[scene.triangles].astype(np.int64)
    following = np.roll(corners, -1, axis=1)
    low, high = np.minimum(corners, following), np.maximum(corners, following)
    edge, direction = (low * (1 + int(place.max())) + high).ravel(), np.sign(following - corners).ravel()
    order = np.argsort(edge, kind="stable")
    starts = np.flatnonzero(np.diff(edge[order], prepend=-1))
    triangle = order // 3
    sums = np.add.reduceat(direction[order], starts)
    part = _parts(triangle, starts, len(corners))
    count = np.diff(starts, append=len(order))
    is_open = np.zeros(len(corners), bool)
    is_open[part[triangle[np.repeat(sums != 0, count)]]] = True
    middle = scene.positions.mean(axis=0, dtype=np.float64)
    a, b, c = (scene.positions[index] - middle for index in scene.triangles.T)
    volume = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)), len(corners))
    sides = np.where(is_open, 0.0, np.sign(volume))[part]
    through = np.array([material.blends for material in scene.materials])[scene.material_ids]
    sides[scene.culled_backs | scene.cut_out | through] = 0.0
    return sides.astype(np.int8)


def _keys(positions: NDArray[np.float32]) -> NDArray[np.void]:
    """Return one element for each position, equal for equal ones."""
    rows = np.ascontiguousarray(positions + np.float32(0.0))  # -0 becomes 0
    return rows.view(np.dtype((np.void, rows.dtype.itemsize * 3))).ravel()


def _parts(triangle: NDArray[np.int64], starts: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """Return the number of the connected surface that each triangle belongs to.

    Args:
        triangle: of each edge, equal edges one after the other.
        starts: where the first of equal edges are.
        count: of triangles.
    """
    following = np.delete(np.arange(len(triangle)), starts)
    links = csr_array(
        (np.ones(len(following), bool), (triangle[following - 1], triangle[following])), shape=(count, count)
    )
    parts: NDArray[np.int32] = connected_components(links, directed=False)[1]
    return parts
