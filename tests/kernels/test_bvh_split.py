"""kernels/rays/bvh_split.cl: nodes are split as one after the other in numpy, on every kernel variant."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from ssgi_cl.core.bvh import LEAF, bvh_of
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.bvh_split import WHOLE, bvh_split
from ssgi_cl.reference.occupancy.bvh_split import bvh_split as reference


@pytest.mark.parametrize("kind", ["apart", "in one place", "halving", "huge"])
@pytest.mark.parametrize("count", [1, LEAF + 1, 100, 2 * WHOLE + 3])
def test_nodes_are_those_of_the_reference(
    variant_runtime: Runtime, kind: str, count: int, rng: np.random.Generator
) -> None:
    hold(variant_runtime, kind, count, rng)


@pytest.mark.parametrize("count", [LEAF + 1, 64, 65, WHOLE + 3])
def test_a_work_group_splits_nodes_as_the_reference(runtime: Runtime, count: int, rng: np.random.Generator) -> None:
    """As on GPUs: with more and fewer boxes than work-items, which have shares of them."""
    hold(Runtime(runtime.info, KernelVariant(1, "buffer")), "apart", count, rng)


def hold(runtime: Runtime, kind: str, count: int, rng: np.random.Generator) -> None:
    corners = (rng.uniform(-1.0, 1.0, (count, 1, 3)) + rng.normal(0.0, 0.03, (count, 3, 3))).astype(np.float32)
    if kind == "in one place":
        corners[:] = corners[0]
    elif kind == "halving":
        corners *= (2.0 ** -(np.arange(count) % 100.0))[:, None, None].astype(np.float32)
    elif kind == "huge":
        corners *= np.float32(1e18)
    culled = np.arange(count) % 3 == 0
    found, right = (
        bvh_of(corners.transpose(1, 2, 0), culled, split) for split in (partial(bvh_split, runtime), reference)
    )
    # Bit-identical but for the sign of 0: the same float32 operations in the same order.
    np.testing.assert_array_equal(found.nodes, right.nodes)
    np.testing.assert_array_equal(found.nodes.view(np.int32)[:, [3, 7]], right.nodes.view(np.int32)[:, [3, 7]])
    np.testing.assert_array_equal(found.triangles.view(np.int32), right.triangles.view(np.int32))
