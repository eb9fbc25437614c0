"""Wide hierarchies: each triangle is where one ray that tests many boxes looks for it, at the least cost."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.bvh import LEAF, Bvh, bvh_of
from ssgi_cl.core.wide_bvh import BLOCK_COST, WAITING, WideBvh, wide_bvh_of
from ssgi_cl.reference.occupancy.bvh_split import bvh_split

COUNTS = [1, LEAF + 1, 16, 17, 100, 3000]
WIDTHS = [8, 16]


def hierarchy(rng: np.random.Generator, count: int) -> Bvh:
    """Of small triangles all over a cube."""
    corners = rng.uniform(-1.0, 1.0, (count, 1, 3)) + rng.normal(0.0, 0.03, (count, 3, 3))
    return bvh_of(corners.astype(np.float32).transpose(1, 2, 0), np.arange(count) % 3 == 0, bvh_split)


def boxes(wide: WideBvh, node: int) -> list[tuple[NDArray[np.float32], NDArray[np.float32], int]]:
    """Least and greatest corners of a node's boxes, and what is in them."""
    inside = wide.nodes.view(np.int32)[node, 6]
    used = np.isfinite(wide.nodes[node, 0])
    return [(wide.nodes[node, 0:3, i], wide.nodes[node, 3:6, i], int(inside[i])) for i in np.flatnonzero(used)]


def held(wide: WideBvh, block: int) -> NDArray[np.int32]:
    """Places of the triangles of a block."""
    used = np.abs(wide.blocks[block, 3:9]).max(axis=0) > 0.0
    return wide.blocks.view(np.int32)[block, 10, used]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("count", COUNTS)
def test_each_triangle_is_in_one_block_within_all_boxes_above(count: int, width: int, rng: np.random.Generator) -> None:
    bvh = hierarchy(rng, count)
    wide = wide_bvh_of(bvh, width)
    first = bvh.triangles[:, None, :3]
    corners = np.concatenate([first, first + bvh.triangles[:, 3:9].reshape(-1, 2, 3)], axis=1)
    found: list[int] = []
    way = [(0, np.full(3, -np.inf), np.full(3, np.inf), 0)]
    entered, most = 0, 0
    while way:
        node, low, high, waiting = way.pop()
        entered += 1
        own = boxes(wide, node)
        most = max(most, waiting + len(own))
        for least, greatest, inside in own:
            assert (least >= low).all()
            assert (greatest <= high).all()
            if inside >= 0:
                way.append((inside, least, greatest, waiting + len(own) - 1))
                continue
            places = held(wide, -1 - inside)
            # A corner is the sum of a corner and an edge: two roundings of 1.2e-7.
            assert (corners[places] >= least - 5e-7).all()
            assert (corners[places] <= greatest + 5e-7).all()
            np.testing.assert_array_equal(wide.blocks[-1 - inside, :10, : len(places)].T, bvh.triangles[places, :10])
            found += places.tolist()
    assert entered == len(wide.nodes)
    assert sorted(found) == list(range(len(bvh.triangles)))
    assert most <= WAITING


@pytest.mark.parametrize("width", [4, 8])
def test_the_areas_of_all_boxes_sum_to_the_least(width: int, rng: np.random.Generator) -> None:
    bvh = hierarchy(rng, 60)
    bits = bvh.nodes.view(np.int32)
    sides = (bvh.nodes[:, 4:7] - bvh.nodes[:, 0:3]).astype(float)
    area = sides[:, 0] * sides[:, 1] + sides[:, 1] * sides[:, 2] + sides[:, 2] * sides[:, 0]

    def triangles(node: int) -> int:
        return int((bits[node : bits[node, 3], 7] & 7).sum())

    @cache
    def least(node: int, slots: int) -> float:
        """Of all ways to have a node's triangles in so many boxes at most."""
        block = BLOCK_COST * area[node] if triangles(node) <= width else np.inf
        if bits[node, 7] != 0 or triangles(node) <= width // 2:
            return float(BLOCK_COST * area[node])
        ways = [block, area[node] + parted(node, width)]
        return min([*ways, parted(node, slots)] if slots > 1 else ways)

    def parted(node: int, slots: int) -> float:
        if triangles(node) <= width // 2:
            return math.inf
        right = int(bits[node + 1, 3])
        return min(least(node + 1, left) + least(right, slots - left) for left in range(1, slots))

    wide = wide_bvh_of(bvh, width)
    cost = area[0]
    for node in range(len(wide.nodes)):
        for low, high, inside in boxes(wide, node):
            x, y, z = (high - low).astype(float)
            cost += (x * y + y * z + z * x) * (1.0 if inside >= 0 else BLOCK_COST)
    assert cost == pytest.approx(least(0, 1), rel=1e-5)  # the sums are float32


def test_a_scene_without_triangles_has_a_node_that_no_ray_meets() -> None:
    wide = wide_bvh_of(bvh_of(np.zeros((3, 3, 0), np.float32), np.zeros(0, bool), bvh_split), 16)
    assert wide.nodes.shape == (1, 7, 16)
    assert (wide.nodes[0, 0:3] > wide.nodes[0, 3:6]).all()


def test_triangles_that_halve_in_size_leave_room_for_boxes_that_wait() -> None:
    # Split one by one, these would make a hierarchy as deep as they are many.
    size = 2.0 ** -np.arange(120.0)
    corners = np.stack([np.outer(size, [1, 0, 0]), np.outer(size, [0, 1, 0]), np.outer(size, [1, 1, 1])], axis=1)
    many = np.repeat(corners, 40, axis=0).astype(np.float32)
    bvh = bvh_of(many.transpose(1, 2, 0), np.zeros(len(many), bool), bvh_split)
    follows, deepest = bvh.nodes.view(np.int32)[:, 3], 0
    above: list[int] = []
    for node in range(len(bvh.nodes)):
        above = [end for end in above if node < end]
        deepest = max(deepest, len(above))
        above.append(int(follows[node]))
    assert deepest * (16 - 1) < WAITING
    test = wide_bvh_of(bvh, 16)
    assert sorted(np.concatenate([held(test, i) for i in range(len(test.blocks))])) == list(range(len(bvh.triangles)))
