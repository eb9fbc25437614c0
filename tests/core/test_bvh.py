"""Bounding volume hierarchies: every triangle is where a ray that follows the nodes looks for it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.bvh import LEAF, Bvh, bvh_of
from ssgi_cl.reference.occupancy.bvh_split import bvh_split

COUNTS = [1, 2, LEAF, LEAF + 1, 2 * LEAF + 1, 100, 1001]


def triangles(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Small ones all over a cube."""
    middle = rng.uniform(-1.0, 1.0, (count, 1, 3))
    return (middle + rng.normal(0.0, 0.03, (count, 3, 3))).astype(np.float32)


def parts(bvh: Bvh) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Node that follows each, and first triangle * 8 + count."""
    bits = bvh.nodes.view(np.int32)
    return bits[:, 3], bits[:, 7]


@pytest.mark.parametrize("count", COUNTS)
def test_a_walk_that_misses_nothing_comes_to_each_triangle_once(count: int, rng: np.random.Generator) -> None:
    bvh = bvh_of(triangles(rng, count).transpose(1, 2, 0), np.zeros(count, bool), bvh_split)
    _, leaf = parts(bvh)
    seen = np.concatenate([np.arange(v >> 3, (v >> 3) + (v & 7)) for v in leaf])
    np.testing.assert_array_equal(seen, np.arange(len(bvh.triangles)))
    assert set(bvh.triangles.view(np.int32)[:, 10]) == set(range(count))
    assert np.max(leaf & 7) <= LEAF


@pytest.mark.parametrize("count", COUNTS)
def test_boxes_hold_all_below_them_and_skips_pass_all_below(count: int, rng: np.random.Generator) -> None:
    bvh = bvh_of(triangles(rng, count).transpose(1, 2, 0), np.zeros(count, bool), bvh_split)
    follows, leaf = parts(bvh)
    first = bvh.triangles[:, None, :3]
    corners = np.concatenate([first, first + bvh.triangles[:, 3:9].reshape(-1, 2, 3)], axis=1)
    for node in range(len(bvh.nodes)):
        below = leaf[node : follows[node]]
        own = np.concatenate([corners[v >> 3 : (v >> 3) + (v & 7)] for v in below]).reshape(-1, 3)
        # A corner is the sum of a corner and an edge: two roundings of 1.2e-7.
        np.testing.assert_array_less(bvh.nodes[node, 0:3] - 5e-7, own.min(axis=0))
        np.testing.assert_array_less(own.max(axis=0), bvh.nodes[node, 4:7] + 5e-7)
    assert follows[0] == len(bvh.nodes)


def test_large_triangles_are_cut_into_parts_of_the_same_area(rng: np.random.Generator) -> None:
    corners = triangles(rng, 50)
    corners[7] = [[-1, -1, -1], [1, -1, 0], [0, 1, 1]]
    bvh = bvh_of(corners.transpose(1, 2, 0), np.zeros(50, bool), bvh_split)
    number = bvh.triangles.view(np.int32)[:, 10]
    own = bvh.triangles[number == 7].astype(np.float64)
    assert len(own) > 8
    area = np.linalg.norm(np.cross(own[:, 3:6], own[:, 6:9]), axis=1).sum()
    edges = corners[7, 1:].astype(np.float64) - corners[7, 0]
    assert area == pytest.approx(np.linalg.norm(np.cross(edges[0], edges[1])), rel=1e-5)


def test_the_hierarchy_of_a_mesh_of_large_triangles_stays_small(rng: np.random.Generator) -> None:
    corners = rng.uniform(-1.0, 1.0, (20_000, 3, 3)).astype(np.float32)
    assert len(bvh_of(corners.transpose(1, 2, 0), np.zeros(len(corners), bool), bvh_split).triangles) < 2 * len(corners)
