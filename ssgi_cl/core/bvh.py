"""Bounding volume hierarchy: boxes round the triangles of a scene, for rays.

Triangles are sorted as in a k-d tree (Bentley 1975, "Multidimensional Binary Search Trees Used for Associative
Searching"), whose halves give a complete binary tree of boxes. Nodes lie in the order in which a ray comes to them
and name the node that follows when it misses one, so that no stack is needed (Smits 1998, "Efficiency Issues for Ray
Tracing").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

LEAF = 4
"""Triangles of a leaf at most."""
LONGEST = 1.0 / 8.0
"""Longest edge of a triangle that is not cut in two, relative to the diagonal of the scene's box: a large triangle
widens the boxes of all that lie near its middle."""
MOST_CUTS = 512
"""Triangles that cutting adds at most, and as many again as an eighth of the scene's."""
NODE, TRIANGLE = 8, 12
"""Floats of a node and of a triangle."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """Nodes and triangles, in the order in which rays come to them.

    Attributes:
        nodes: [nodes, 8] float32: least corner; number of the node that follows when it is missed (int32 bits);
            greatest corner; of a leaf, first triangle * 8 + count, otherwise 0 (int32 bits).
        triangles: [triangles, 12] float32: a corner, the edges from it to the others, 1 where the back is not
            there, the number of the triangle (int32 bits), `holes` (int32 bits).
    """

    nodes: Floats
    triangles: Floats


def bvh_of(corners: Floats, culled: NDArray[np.bool_], holes: NDArray[np.int32] | None = None) -> Bvh:
    """Return the hierarchy of triangles; one node that no ray meets where there are none.

    Args:
        corners: [triangles, 3, 3] float32, scene units.
        culled: [triangles] whether the back is not there.
        holes: [triangles] 0 where a triangle has none, else the number of its record, from 1.
    """
    corners, number = _cut(np.asarray(corners, np.float32), None if holes is None else holes != 0)
    count = len(corners)
    depth = max(-(-count // LEAF) - 1, 0).bit_length()
    leaves = 1 << depth
    ends = np.arange(leaves + 1) * count // leaves
    order = _sorted(corners.mean(axis=1), depth, ends)
    corners, number = corners[order], number[order]
    nodes = np.zeros((2 * leaves - 1, NODE), np.float32)
    bits = nodes.view(np.int32)
    if not count:
        nodes[:, 0:3], nodes[:, 4:7], bits[:, 3] = np.inf, -np.inf, 1
        return Bvh(nodes, np.zeros((1, TRIANGLE), np.float32))
    low = np.minimum.reduceat(corners.min(axis=1), ends[:-1])
    high = np.maximum.reduceat(corners.max(axis=1), ends[:-1])
    for level in range(depth, -1, -1):
        if level < depth:
            low, high = low.reshape(-1, 2, 3).min(axis=1), high.reshape(-1, 2, 3).max(axis=1)
        places = _places(level, depth)
        nodes[places, 0:3], nodes[places, 4:7] = low, high
        bits[places, 3] = places + 2 ** (depth - level + 1) - 1
        if level == depth:
            bits[places, 7] = 8 * ends[:-1] + np.diff(ends)
    triangles = np.zeros((count, TRIANGLE), np.float32)
    triangles[:, :3] = corners[:, 0]
    triangles[:, 3:9] = (corners[:, 1:] - corners[:, :1]).reshape(count, 6)
    triangles[:, 9] = culled[number]
    triangles.view(np.int32)[:, 10] = number
    if holes is not None:
        triangles.view(np.int32)[:, 11] = holes[number]
    return Bvh(nodes, triangles)


def _places(level: int, depth: int) -> NDArray[np.int64]:
    """Return the numbers of the nodes of a level, from left to right: before each come its ancestors and all that lies
    to the left."""
    places = np.zeros(1, np.int64)
    for step in range(level):
        below = 2 ** (depth - step) - 1  # nodes of a child's subtree
        places = np.stack([places + 1, places + 1 + below], axis=1).ravel()
    return places


def _sorted(points: Floats, depth: int, ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the order of points in which each node's half with the lower coordinates comes first, along the axis in
    which the node's points lie farthest apart."""
    order = np.arange(len(points))
    for level in range(depth):
        firsts = ends[:: 2 ** (depth - level)]
        own = points[order]
        low, high = (f.reduceat(own, firsts[:-1]) for f in (np.minimum, np.maximum))
        sizes = np.diff(firsts)
        axis = np.repeat((high - low).argmax(axis=1), sizes)
        node = np.repeat(np.arange(len(sizes)), sizes)
        along = np.take_along_axis(own, axis[:, None], 1)[:, 0]
        order = order[np.lexsort((along, node))]
    return order


def _cut(corners: Floats, whole: NDArray[np.bool_] | None) -> tuple[Floats, NDArray[np.int64]]:
    """Return triangles [n, 3, 3] of which the largest are cut across their longest edge, and whose parts they are.
    Those that are to stay `whole` do."""
    number = np.arange(len(corners))
    if not len(corners):
        return corners, number
    longest = LONGEST * float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    room = MOST_CUTS + len(corners) // 8
    done: list[tuple[Floats, NDArray[np.int64]]] = []
    while True:
        edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        large = edges.max(axis=1) > longest
        if whole is not None:
            large &= ~whole[number]
        if not large.any() or np.count_nonzero(large) > room:
            break
        done.append((corners[~large], number[~large]))
        corners, number, edges = corners[large], number[large], edges[large]
        room -= len(corners)
        # The longest edge first: its middle is joined to the opposite corner.
        turn = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
        corners = np.take_along_axis(corners, turn[..., None], 1)
        middle = 0.5 * (corners[:, 0] + corners[:, 1])
        corners = np.concatenate(
            [np.stack([corners[:, 0], middle, corners[:, 2]], 1), np.stack([middle, corners[:, 1], corners[:, 2]], 1)]
        )
        number = np.tile(number, 2)
    done.append((corners, number))
    return np.concatenate([c for c, _ in done]), np.concatenate([n for _, n in done])
