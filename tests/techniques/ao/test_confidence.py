"""Confidence in ambient occlusion: what is not known lowers it, and what is sure is near rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.techniques.ao.confidence import ao_confidence, ends
from ssgi_cl.truth.ray_ao import ray_ao

from ..analytic import camera, tilted, trace


def test_a_plane_is_sure_but_where_the_radius_leaves_the_image(runtime: Runtime) -> None:
    made = camera(size=(64, 64))
    gbuffer = trace(made, [tilted(made, 20.0)])
    confidence = ao_confidence(gbuffer, np.ones(made.size, np.float32), 0.3, runtime=runtime)
    np.testing.assert_allclose(confidence[24:40, 24:40], 1.0, atol=1e-6)
    # Nearly half of the disk, whose centre is half of a pixel in, lies beyond the border, and more beyond a corner.
    assert confidence[32, 0] == pytest.approx(0.55, abs=0.04)
    assert confidence[0, 0] < 0.2


def test_a_value_far_from_what_layers_allow_is_doubted_by_the_distance(runtime: Runtime) -> None:
    made = camera(size=(64, 64))
    gbuffer = trace(made, [tilted(made, 20.0)])
    confidence = ao_confidence(gbuffer, np.full(made.size, 0.7, np.float32), 0.3, runtime=runtime)
    np.testing.assert_allclose(confidence[24:40, 24:40], 0.7, atol=1e-6)


def plate(thickness: float | None) -> GBuffer:
    """Return a plate before a wall, in one layer."""
    made = camera(size=(64, 64))
    gbuffer = trace(made, [tilted(made, 0.0)])
    depth = np.array(gbuffer.depth)
    given = None if thickness is None else np.full(depth.shape, -1.0, np.float32)
    depth[20:44, 20:44] -= 0.4
    if given is not None:
        given[20:44, 20:44] = thickness
    return GBuffer(camera=made, depth=depth, normal=gbuffer.normal, thickness=given)


def test_what_may_be_hidden_behind_the_last_layer_lowers_confidence(runtime: Runtime) -> None:
    single = plate(None)
    a = bitmask_ao(single, 0.5, runtime=runtime)
    one = ao_confidence(single, a, 0.5, runtime=runtime)
    # The wall behind and beside the plate, and nothing behind the wall, are what further layers show.
    depth = np.array(single.depth)
    wall = np.full_like(depth, np.inf)
    inside = np.s_[20:44, 20:44]
    wall[inside] = depth[inside] + 0.4
    third = np.full_like(depth, np.inf)
    known = GBuffer(camera=single.camera, depth=np.stack([depth, wall, third]), normal=single.normal)
    thickness = np.full(known.depth.shape, 0.0, np.float32)
    three = ao_confidence(
        GBuffer(camera=known.camera, depth=known.depth, normal=known.normal, thickness=thickness),
        bitmask_ao(known, 0.5, thickness=0.0, runtime=runtime),
        0.5,
        runtime=runtime,
    )
    beside = np.s_[28:36, 15:19]
    assert float(one[beside].mean()) < 0.9
    assert float(three[beside].mean()) > float(one[beside].mean()) + 0.05


def test_least_and_greatest_ends_of_layers() -> None:
    made = camera(size=(1, 4))
    depth = np.array([[1.0, 1.0, 1.0, np.inf], [3.0, np.inf, 3.0, np.inf]], np.float32)[:, None]
    thickness = np.array([[0.5, -1.0, -1.0, -1.0], [-1.0, -1.0, 0.25, -1.0]], np.float32)[:, None]
    least, most = ends(GBuffer(camera=made, depth=depth, thickness=thickness))
    np.testing.assert_array_equal(least[:, 0], [[0.5, 0.0, 0.0, 0.0], [0.0, 0.0, 0.25, 0.0]])
    # Behind a layer that no other follows is nothing; behind the last of all may be anything.
    np.testing.assert_array_equal(most[:, 0], [[0.5, 0.0, 2.0, 0.0], [np.inf, 0.0, np.inf, 0.0]])


@pytest.mark.parametrize(("layers", "share"), [(1, 0.03), (4, 0.3)])
def test_what_is_sure_is_near_rays(runtime: Runtime, layers: int, share: float) -> None:
    pytest.importorskip("embreex")
    built = make_scene("rods-302")
    made = built.camera(160, 120)
    drawn = rasterized(built.scene, made, layers=layers, overscan=0.1, thickness=True, runtime=runtime)
    a = bitmask_ao(drawn, built.ao_radius, runtime=runtime)
    confidence = ao_confidence(drawn, a, built.ao_radius, runtime=runtime)
    off = a - ray_ao(built.scene, made, built.ao_radius, 256)
    sure = confidence >= 0.96
    assert np.mean(sure) > share
    assert float(np.sqrt(np.mean(off[sure] ** 2))) < 0.02  # what it promises
    assert float(np.sqrt(np.mean(off[~sure] ** 2))) > 0.02


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"ao": np.zeros((3, 3), np.float32)}, ValueError, r"ao has shape \(3, 3\): expected \(64, 64\)"),
        ({"ao": np.full((64, 64), 1.5, np.float32)}, ValueError, r"ao\[0, 0\] is 1.5: expected numbers >= 0 and <= 1"),
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0"),
        ({"gbuffer": np.zeros((64, 64))}, TypeError, r"gbuffer is ndarray: expected GBuffer"),
    ],
)
def test_bad_input_is_named(given: dict[str, Any], error: type[Exception], message: str, runtime: Runtime) -> None:
    usual = {"gbuffer": plate(None), "ao": np.ones((64, 64), np.float32), "radius": 0.5}
    with pytest.raises(error, match=message):
        ao_confidence(**{**usual, **given}, runtime=runtime)
