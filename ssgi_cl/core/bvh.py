"""Bounding volume hierarchy: boxes round the triangles of a scene, for rays.

Nodes are split where the surface areas of their halves, which say how many rays meet them, promise the least work
(Goldsmith and Salmon 1987, "Automatic Creation of Object Hierarchies for Ray Tracing"), by kernels/rays/bvh_split.cl.
Nodes lie in the order in which a ray comes to them and name the node that follows when it misses one, so that no stack
is needed (Smits 1998, "Efficiency Issues for Ray Tracing").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

LEAF = 4
"""Triangles of a leaf at most."""
LONGEST = 1.0 / 8.0
"""Longest edge of a triangle that is not cut in two, relative to the diagonal of the scene's box: a large triangle
widens the boxes of all that lie near its middle."""
MOST_CUTS = 512
"""Triangles that cutting adds at most, and as many again as an eighth of the scene's."""
BINS = 16
"""Places at which a node may be split, and one."""
DEEPEST = 39
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


class Halves(NamedTuple):
    """Nodes as they are split, see kernels/rays/bvh_split.cl.

    Attributes:
        nodes: [boxes, 2, 8] inner nodes by the box that their second half begins with, and leaves by their first:
            minus the least corner, their first box (int32 bits), the greatest corner, how many they have (int32 bits).
        lefts: [boxes, 2] one more than in how many of the splits above they were the left half; 0 of unused places.
        order: [boxes] numbers of boxes, those of each node one after the other.
    """

    nodes: Floats
    lefts: Ints
    order: Ints


def bvh_of(
    corners: Floats,
    culled: NDArray[np.bool_],
    split: Callable[[Floats], tuple[Floats, Ints, Ints]],
    holes: Ints | None = None,
) -> Bvh:
    """Return the hierarchy of triangles; one node that no ray meets where there are none.

    Args:
        corners: [3 corners, 3 axes, triangles] float32, scene units: numpy is ten times as fast on rows of one
            coordinate as on those of three.
        culled: [triangles] whether the back is not there.
        split: what returns `Halves` of boxes [boxes, 8]: minus the least corner, their number (int32 bits), the
            greatest corner, 0.
        holes: [triangles] 0 where a triangle has none, else the number of its record, from 1.
    """
    if not corners.shape[-1]:
        nodes = np.zeros((1, NODE), np.float32)
        nodes[:, 0:3], nodes[:, 4:7], nodes.view(np.int32)[:, 3] = np.inf, -np.inf, 1
        return Bvh(nodes, np.zeros((1, TRIANGLE), np.float32))
    low, high = corners.min(axis=2).min(axis=0), corners.max(axis=2).max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    corners, number, longest = _cut(corners, LONGEST * diagonal, None if holes is None else holes != 0)
    found = Halves(*split(_boxes(corners, longest, diagonal)))
    corners, number = corners.take(found.order, axis=2), number[found.order]
    triangles = np.zeros((TRIANGLE, len(number)), np.float32)
    triangles[:3] = corners[0]
    triangles[3:9] = (corners[1:] - corners[0]).reshape(6, -1)
    triangles[9] = culled[number]
    triangles.view(np.int32)[10] = number
    if holes is not None:
        triangles.view(np.int32)[11] = holes[number]
    return Bvh(_nodes(found), triangles.T.copy())


def _nodes(found: Halves) -> Floats:
    """Return nodes in the order in which rays come to them.

    Before a node come its ancestors, and all below the left half of those of which it is in the right one: two nodes
    for each leaf there less one. So these are twice the leaves before it, and one for each split above of which it is
    in the left half.
    """
    used = np.flatnonzero(found.lefts)
    kept, leaf = found.nodes.reshape(-1, NODE)[used], used & 1
    first, count = kept.view(np.int32)[:, 3], kept.view(np.int32)[:, 7]
    leaves = np.concatenate([np.zeros(1, np.int64), np.cumsum(found.lefts[:, 1] != 0)])
    before = leaves[first]
    place = 2 * before + found.lefts.ravel()[used] - 1
    nodes = np.empty((len(used), NODE), np.float32)
    kept[:, 0:3] *= -1.0
    follows = place + 2 * (leaves[first + count] - before) - 1
    kept.view(np.int32)[:, 7] = leaf * (8 * first + count)
    kept.view(np.int32)[:, 3] = follows
    nodes[place] = kept
    return nodes


def _boxes(corners: Floats, longest: Floats, diagonal: float) -> Floats:
    """Return boxes round triangles [3 corners, 3 axes, triangles], of edges up to `longest` [triangles], and a margin,
    as `bvh_of` says."""
    margin = (EDGE * longest + ROUNDING * diagonal).astype(np.float32)
    boxes = np.zeros((corners.shape[-1], NODE), np.float32)
    for axis in range(3):
        first, second, third = corners[:, axis]
        boxes[:, axis] = margin - np.minimum(np.minimum(first, second), third)
        boxes[:, 4 + axis] = margin + np.maximum(np.maximum(first, second), third)
    boxes.view(np.int32)[:, 3] = np.arange(len(boxes))
    return boxes


def _squared_lengths(corners: Floats) -> Floats:
    """Return [3, triangles] squares of lengths of edges of triangles [3 corners, 3 axes, triangles], each from a corner
    to the next."""
    lengths = np.empty((3, corners.shape[-1]), np.float32)
    for first, squared in enumerate(lengths):
        x, y, z = corners[(first + 1) % 3] - corners[first]
        np.multiply(x, x, out=squared)
        squared += np.square(y, out=y)
        squared += np.square(z, out=z)
    return lengths


def _cut(corners: Floats, most: float, whole: NDArray[np.bool_] | None) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Return triangles [3 corners, 3 axes, n] of which those with edges of more than `most` are cut across these, whose
    parts they are, and their longest edges. Those that are to stay `whole` do."""
    number = np.arange(corners.shape[-1])
    room = MOST_CUTS + len(number) // 8
    done: list[tuple[Floats, NDArray[np.int64], Floats]] = []
    while True:
        edges = _squared_lengths(corners)
        longest: Floats = np.sqrt(np.maximum(np.maximum(edges[0], edges[1]), edges[2]))
        above = longest > most
        if whole is not None:
            above &= ~whole[number]
        large, kept = np.flatnonzero(above), np.flatnonzero(~above)
        if not len(large) or len(large) > room:
            break
        done.append((corners.take(kept, axis=2), number[kept], longest[kept]))
        corners, number, edges = corners[..., large], number[large], np.sqrt(edges[:, large])
        room -= len(number)
        # The longest edge first: its middle is joined to the opposite corner.
        turn = (edges.argmax(axis=0) + np.arange(3)[:, None]) % 3
        first, second, third = np.take_along_axis(corners, turn[:, None], 0)
        middle = 0.5 * (first + second)
        corners = np.concatenate([np.stack([first, middle, third]), np.stack([middle, second, third])], axis=-1)
        number = np.tile(number, 2)
    if not done:
        return corners, number, longest
    done.append((corners, number, longest))
    parts, numbers, edges_of = zip(*done, strict=True)
    return np.concatenate(parts, axis=-1), np.concatenate(numbers), np.concatenate(edges_of)
