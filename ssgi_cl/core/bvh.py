"""Bounding volume hierarchy: boxes round the triangles of a scene, for rays.

Nodes are split where the surface areas of their halves, which say how many rays meet them, promise the least work
(Goldsmith and Salmon 1987, "Automatic Creation of Object Hierarchies for Ray Tracing"; in bins, Wald 2007, "On fast
Construction of SAH-based Bounding Volume Hierarchies"). Nodes lie in the order in which a ray comes to them
and name the node that follows when it misses one, so that no stack is needed (Smits 1998, "Efficiency Issues for Ray
Tracing").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

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
BINS = 16
"""Places at which a node may be split, and one."""
DEEPEST = 40
"""Levels of nodes, of any scene, that are split where it promises the least work. Those below are halved, so that the
hierarchy of 2^30 triangles has at most 68 levels of nodes that are split: `WAITING` of wide_bvh.py relies on it."""
EDGE, ROUNDING = 2e-5, 2e-6
"""Boxes reach so far beyond triangles, relative to their longest edge (twice `RAYS_EDGE` of kernels/rays/bvh.clh) and
to the diagonal of the scene's box, that a ray which meets a triangle also meets each box round it, as computed: what
is met first does not depend on the order of boxes."""
NODE, TRIANGLE = 8, 12
"""Floats of a node and of a triangle."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """Nodes and triangles, in the order in which rays come to them.

    Attributes:
        nodes: [nodes, 8] float32: least corner, less a margin; number of the node that follows when it is missed
            (int32 bits); greatest corner and the margin; of a leaf, first triangle * 8 + count, otherwise 0
            (int32 bits).
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
    if not len(corners):
        nodes = np.zeros((1, NODE), np.float32)
        nodes[:, 0:3], nodes[:, 4:7], nodes.view(np.int32)[:, 3] = np.inf, -np.inf, 1
        return Bvh(nodes, np.zeros((1, TRIANGLE), np.float32))
    margin = _margin(corners)
    low, high = corners.min(axis=1) - margin, corners.max(axis=1) + margin
    order, levels = _split(low, high)
    sizes = _sizes(levels)
    nodes = np.zeros((int(sizes[0][0]), NODE), np.float32)
    bits = nodes.view(np.int32)
    places = np.zeros(1, np.int64)
    for level, size, below in zip(levels, sizes, [*sizes[1:], np.zeros(0, np.int64)], strict=True):
        nodes[places, 0:3], nodes[places, 4:7] = level.low, level.high
        bits[places, 3] = places + size
        leaf = ~level.parted
        bits[places[leaf], 7] = 8 * level.first[leaf] + level.size[leaf]
        # The left child follows its parent, the right one all below the left one.
        left = places[level.parted] + 1
        places = np.stack([left, left + below[0::2]], axis=1).ravel()
    triangles = np.zeros((len(corners), TRIANGLE), np.float32)
    corners, number = corners[order], number[order]
    triangles[:, :3] = corners[:, 0]
    triangles[:, 3:9] = (corners[:, 1:] - corners[:, :1]).reshape(-1, 6)
    triangles[:, 9] = culled[number]
    triangles.view(np.int32)[:, 10] = number
    if holes is not None:
        triangles.view(np.int32)[:, 11] = holes[number]
    return Bvh(nodes, triangles)


def _margin(corners: Floats) -> Floats:
    """Return [triangles, 1] by how much boxes reach beyond triangles."""
    return np.asarray(EDGE * _edges(corners).max(axis=1) + ROUNDING * _diagonal(corners), np.float32)[:, None]


def _edges(corners: Floats) -> Floats:
    """Return [triangles, 3] lengths of edges, each from a corner to the next."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))


def _diagonal(corners: Floats) -> float:
    """Return the diagonal of the box round triangles."""
    return float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))


class _Level(NamedTuple):
    """Nodes of one depth, [n] each: their triangles in the order, boxes, and whether they have children, which are
    the next level's, two by two."""

    first: NDArray[np.int64]
    size: NDArray[np.int64]
    low: Floats
    high: Floats
    parted: NDArray[np.bool_]


def _sizes(levels: list[_Level]) -> list[NDArray[np.int64]]:
    """Return how many nodes the subtree of each node has."""
    found: list[NDArray[np.int64]] = []
    for level in reversed(levels):
        size = np.ones(len(level.first), np.int64)
        if found:
            size[level.parted] += found[-1].reshape(-1, 2).sum(axis=1)
        found.append(size)
    return found[::-1]


def _split(low: Floats, high: Floats) -> tuple[NDArray[np.int64], list[_Level]]:
    """Return the order of boxes in which each node's are neighbours, and the nodes by depth.

    A node's boxes go to `BINS` bins by their middle along the axis in which the middles lie farthest apart; it is
    split between the bins where the areas of the halves' boxes, times how many they hold, sum to the least.
    """
    middle = 0.5 * (low + high)
    order = np.arange(len(low))
    first, count = np.zeros(1, np.int64), np.full(1, len(low), np.int64)
    levels = []
    while len(first):
        inside = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        own = order[inside]
        starts = np.cumsum(count) - count
        least, most = np.minimum.reduceat(low[own], starts), np.maximum.reduceat(high[own], starts)
        parted = count > LEAF
        levels.append(_Level(first, count, least, most, parted))
        if not parted.any():
            break
        inside, own = inside[np.repeat(parted, count)], own[np.repeat(parted, count)]
        first, count = first[parted], count[parted]
        starts = np.cumsum(count) - count
        if len(levels) < DEEPEST:
            order[inside], left = _halves(low, high, middle, own, starts, count)
        else:
            left = count // 2
        first = np.stack([first, first + left], axis=1).ravel()
        count = np.stack([left, count - left], axis=1).ravel()
    return order, levels


def _halves(
    low: Floats,
    high: Floats,
    middle: Floats,
    own: NDArray[np.int64],
    starts: NDArray[np.int64],
    count: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the boxes `own` of nodes in the order of their bins, and how many of each node go to the left."""
    nodes = len(starts)
    node = np.repeat(np.arange(nodes), count)
    at = middle[own]
    least, most = np.minimum.reduceat(at, starts), np.maximum.reduceat(at, starts)
    axis = (most - least).argmax(axis=1)
    row = np.arange(nodes)
    begin, wide = least[row, axis], (most - least)[row, axis]
    along = (np.take_along_axis(at, axis[node][:, None], 1)[:, 0] - begin[node]) / np.maximum(wide, 1e-30)[node]
    key = node * BINS + np.minimum((along * BINS).astype(np.int64), BINS - 1)
    # One sort of numbers is several times faster than an indirect one.
    sorted_ = np.sort(key << 32 | np.arange(len(own)))
    own = own[sorted_ & 0xFFFFFFFF]
    key = sorted_ >> 32
    begins = np.flatnonzero(np.diff(key, prepend=-1))
    held = np.zeros(nodes * BINS, np.int64)
    held[key[begins]] = np.diff(begins, append=len(own))
    lows = np.full((nodes * BINS, 3), np.inf, np.float32)
    highs = np.full((nodes * BINS, 3), -np.inf, np.float32)
    lows[key[begins]], highs[key[begins]] = (
        np.minimum.reduceat(low[own], begins),
        np.maximum.reduceat(high[own], begins),
    )
    least_of, most_of = lows.reshape(nodes, BINS, 3), highs.reshape(nodes, BINS, 3)
    before = held.reshape(nodes, BINS).cumsum(axis=1)[:, :-1]
    after = count[:, None] - before
    cost = before * _area(np.minimum.accumulate(least_of, 1), np.maximum.accumulate(most_of, 1))[:, :-1]
    back = slice(None, None, -1)
    cost += (
        after
        * _area(np.minimum.accumulate(least_of[:, back], 1), np.maximum.accumulate(most_of[:, back], 1))[:, -2::-1]
    )
    cost = np.where((before > 0) & (after > 0), cost, np.inf)
    best = cost.argmin(axis=1)
    left = before[row, best]
    # All in one place: any half.
    return own, np.where(np.isfinite(cost[row, best]), left, count // 2)


def _area(low: Floats, high: Floats) -> NDArray[np.float64]:
    """Return half the surface of boxes, 0 of empty ones."""
    x, y, z = np.moveaxis(np.maximum((high - low).astype(np.float64), 0.0), -1, 0)
    return np.asarray(x * y + y * z + z * x)


def _cut(corners: Floats, whole: NDArray[np.bool_] | None) -> tuple[Floats, NDArray[np.int64]]:
    """Return triangles [n, 3, 3] of which the largest are cut across their longest edge, and whose parts they are.
    Those that are to stay `whole` do."""
    number = np.arange(len(corners))
    if not len(corners):
        return corners, number
    longest = LONGEST * _diagonal(corners)
    room = MOST_CUTS + len(corners) // 8
    done: list[tuple[Floats, NDArray[np.int64]]] = []
    while True:
        edges = _edges(corners)
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
