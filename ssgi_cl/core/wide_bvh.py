"""Wide bounding volume hierarchy: nodes of as many boxes as a vector has lanes, which one ray tests at once.

Rays that are near each other share few nodes once these are small: a vector of rays then has most of its lanes idle.
One ray and a vector of boxes keeps them busy (Wald, Benthin and Boulos 2008, "Getting Rid of Packets").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.bvh import Bvh

Floats = NDArray[np.float32]
Ints = NDArray[np.int64]

ROWS, BLOCK_ROWS = 7, 11
"""Rows of a node and of a block."""
BLOCK_COST = 1.2
"""Work of a block, in that of a node."""
WAITING = 1024
"""Boxes that wait to be entered on the way of a ray, at most: fewer than the widest node has, for each level."""


@dataclass(frozen=True, eq=False)
class WideBvh:
    """Nodes and blocks of triangles.

    Attributes:
        nodes: [nodes, 7, width] float32: x, y, z of least corners, of greatest corners, then (int32 bits) the number of
            the node there, or of a block -1 - its number. The root is the first. Unused places are boxes that no ray
            meets.
        blocks: [blocks, 11, width] float32: the first ten numbers of triangles as `Bvh.triangles` has them, then (int32
            bits) their place there; unused places are triangles without a size.
    """

    nodes: Floats
    blocks: Floats


def wide_bvh_of(bvh: Bvh, width: int) -> WideBvh:
    """Return a hierarchy of the same triangles, of nodes of up to `width` boxes and blocks of up to `width` triangles,
    `LEAF` or more.

    Of all such hierarchies whose boxes are boxes of `bvh`, those of up to `width` / 2 triangles whole, it is that whose
    boxes' areas, which say how many rays meet them, sum to the least (Ylitie, Karras and Laine 2017, "Efficient
    Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", section 3).
    """
    bits = bvh.nodes.view(np.int32)
    leaf, follows = bits[:, 7], bits[:, 3].astype(np.int64)
    levels = _levels(leaf, follows)
    first, size = _triangles_below(leaf, follows)
    plan = _Plan(bvh, width, leaf != 0, follows, size, levels)
    parents, places, children = [], [], []
    above, made, blocks = np.zeros(1, np.int64), 0, 0
    held: list[Ints] = []
    numbers = []
    while len(above):
        owner, child = plan.children(above)
        lane = np.arange(len(owner)) - np.searchsorted(owner, owner)
        block = plan.is_block[child]
        number = np.empty(len(child), np.int64)
        number[block] = -1 - blocks - np.arange(np.count_nonzero(block))
        number[~block] = made + len(above) + np.arange(np.count_nonzero(~block))
        parents.append(made + owner)
        places.append(lane)
        children.append(child)
        numbers.append(number)
        held.append(child[block])
        made, blocks, above = made + len(above), blocks + int(np.count_nonzero(block)), child[~block]
    nodes = np.empty((made, ROWS, width), np.float32)
    nodes[:, 0:3], nodes[:, 3:6], nodes[:, 6] = np.inf, -np.inf, 0.0
    parent, place, child = np.concatenate(parents), np.concatenate(places), np.concatenate(children)
    nodes[parent, 0:3, place], nodes[parent, 3:6, place] = bvh.nodes[child, 0:3], bvh.nodes[child, 4:7]
    nodes.view(np.int32)[parent, 6, place] = np.concatenate(numbers)
    return WideBvh(nodes, _blocks(bvh, np.concatenate(held), first, size, width))


def _levels(leaf: NDArray[np.int32], follows: Ints) -> list[Ints]:
    """Return the nodes of each depth."""
    levels = [np.zeros(1, np.int64)]
    while True:
        inner = levels[-1][leaf[levels[-1]] == 0]
        inner = inner[inner + 1 < follows[inner]]  # the node of a scene without triangles has nothing below
        if not len(inner):
            return levels
        levels.append(np.stack([inner + 1, follows[inner + 1]], axis=1).ravel())


def _triangles_below(leaf: NDArray[np.int32], follows: Ints) -> tuple[Ints, Ints]:
    """Return the first triangle of each node, and how many it has."""
    ends = np.concatenate([np.zeros(1, np.int64), np.cumsum(leaf & 7)])
    return ends[:-1], ends[follows] - ends[:-1]


class _Plan:
    """What the nodes of a hierarchy become: boxes of a wide node, which go on in another or in a block.

    Attributes:
        is_block: [nodes] whether a box with this node's triangles holds a block, rather than a wide node.
    """

    def __init__(
        self, bvh: Bvh, width: int, leaf: NDArray[np.bool_], follows: Ints, size: Ints, levels: list[Ints]
    ) -> None:
        self._follows, self._width = follows, width
        x, y, z = (bvh.nodes[:, 4 + i] - bvh.nodes[:, i] for i in range(3))
        area = x * y + y * z + z * x
        area[size == 0] = 0.0
        # Parting what fills no half of a block takes as long to plan as all else, for .6 % less work of rays.
        parts = ~leaf & (size > width // 2)
        # Of a node as one box, and of those with parts, and one without, as up to 1, 2, ... boxes of the node above.
        self._one = np.where(size <= width, BLOCK_COST * area, np.inf).astype(np.float32)
        self._row = np.where(parts, np.cumsum(parts) - 1, np.count_nonzero(parts))
        self._parted = np.full((np.count_nonzero(parts) + 1, width), np.inf, np.float32)
        self._left = np.zeros(self._parted.shape, np.int8)
        self.is_block = np.ones(len(area), bool)
        for level in reversed(levels):
            inner = level[parts[level]]
            of_left, of_right = (
                np.minimum(self._one[half, None], self._parted[self._row[half]]).T.copy()
                for half in (inner + 1, follows[inner + 1])
            )
            parted = np.full((width, len(inner)), np.inf, np.float32)
            slots = np.zeros(parted.shape, np.int8)
            for taken in range(1, width):
                both = of_left[taken - 1] + of_right[: width - taken]
                np.copyto(slots[taken:], taken, where=both < parted[taken:])
                np.minimum(parted[taken:], both, out=parted[taken:])
            self._parted[self._row[inner]], self._left[self._row[inner]] = parted.T, slots.T
            node = area[inner] + parted[-1]
            self.is_block[inner] = self._one[inner] <= node
            self._one[inner] = np.minimum(self._one[inner], node)

    def children(self, above: Ints) -> tuple[Ints, Ints]:
        """Return the boxes of wide nodes, those of each neighbours: whose they are, as places in `above`, and what
        they hold."""
        owner, node = np.arange(len(above)), above
        slots = np.full(len(above), self._width)
        done: list[tuple[Ints, Ints]] = []
        whole = self.is_block[above]  # the root alone
        while len(node):
            done.append((owner[whole], node[whole]))
            owner, node, slots = owner[~whole], node[~whole], slots[~whole]
            taken = self._left[self._row[node], slots - 1].astype(np.int64)
            owner = np.repeat(owner, 2)
            slots = np.stack([taken, slots - taken], axis=1).ravel()
            node = np.stack([node + 1, self._follows[node + 1]], axis=1).ravel()
            whole = self._one[node] <= self._parted[self._row[node], slots - 1]
        owner, node = (np.concatenate(parts) for parts in zip(*done, strict=True))
        order = np.lexsort((node, owner))
        return owner[order], node[order]


def _blocks(bvh: Bvh, held: Ints, first: Ints, size: Ints, width: int) -> Floats:
    """Return the blocks of the triangles of nodes."""
    blocks = np.zeros((len(held), BLOCK_ROWS, width), np.float32)
    count = size[held]
    block = np.repeat(np.arange(len(held)), count)
    lane = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    triangle = np.repeat(first[held], count) + lane
    blocks[block, : BLOCK_ROWS - 1, lane] = bvh.triangles[triangle, : BLOCK_ROWS - 1]
    blocks.view(np.int32)[block, BLOCK_ROWS - 1, lane] = triangle
    return blocks
