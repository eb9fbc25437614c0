"""Rays for the pixels of the least confidence: which these are, and what all ways cost."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.bench.experiments.beyond_layers import LAYERS, RAYS, RAYS_THERE, Way, least, rays_for, table, ways
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.truth.ray_ao import RayAo
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")


@pytest.fixture
def context(runtime: Runtime) -> Context:
    return Context(runtime, make_scene("rods-302"), (30, 40), TruthSettings(rays=64))


def test_a_tenth_of_the_pixels_has_the_least_values() -> None:
    values = np.arange(40, dtype=np.float32).reshape(5, 8)
    seen = np.ones((5, 8), bool)
    seen[0, 1] = False
    np.testing.assert_array_equal(np.flatnonzero(least(values, seen)), [0, 2, 3, 4])


def test_rays_are_cast_for_the_chosen_pixels_alone(context: Context) -> None:
    where = np.zeros(context.size, bool)
    where[10:20, 5:30] = True
    surfaces = context.host_gbuffer
    some, whole = (rays_for(context, surfaces, chosen, 16) for chosen in (where, None))
    np.testing.assert_array_equal(some[where], whole[where])
    np.testing.assert_array_equal(some[~where], 1.0)
    again = RayAo(context.view.scene)(context.camera, context.radius, 16, gbuffer=surfaces, estimate_error=False)[0]
    np.testing.assert_array_equal(whole, again)


def test_all_ways_are_measured(context: Context) -> None:
    found = ways(context, 1)
    assert len(found) == len(RAYS) + len(LAYERS) * (3 + len(RAYS_THERE))
    errors = {way.name: way.error for way in found}
    for here in ("1 layer", "2 layers", "4 layers"):
        exact = errors[f"{here}, the reference where confidence is least"]
        assert errors[f"{here}, the reference where the error is greatest"] < exact < errors[here]
    assert table([Way("a", 0.05, 12.0), Way("b", 0.01, 0.0)]).splitlines()[2:] == [
        "| a | 0.0500 | 12 |",
        "| b | 0.0100 | - |",
    ]
