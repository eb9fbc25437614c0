"""Confidence in ambient occlusion: what is not known lowers it, and what is sure is near rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques import bands
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.techniques.ao.confidence import ao_confidence, ends
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.ao.hbao import hbao
from ssgi_cl.techniques.ao.ssao import ssao
from ssgi_cl.techniques.radius import sensible_radius
from ssgi_cl.truth.ray_ao import ray_ao

from ..analytic import camera, tilted, trace
from .subjects import SUBJECTS


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
        ({"gbuffer": np.zeros((64, 64))}, TypeError, r"gbuffer is ndarray: expected GBuffer or DeviceGBuffer"),
    ],
)
def test_bad_input_is_named(given: dict[str, Any], error: type[Exception], message: str, runtime: Runtime) -> None:
    usual = {"gbuffer": plate(None), "ao": np.ones((64, 64), np.float32), "radius": 0.5}
    with pytest.raises(error, match=message):
        ao_confidence(**{**usual, **given}, runtime=runtime)


@pytest.fixture(scope="module")
def rods(runtime: Runtime) -> GBuffer:
    built = make_scene("rods-302")
    return rasterized(built.scene, built.camera(96, 64), layers=2, overscan=0.1, thickness=True, runtime=runtime)


@pytest.mark.parametrize("name", sorted(SUBJECTS))
def test_techniques_return_it_last(name: str, rods: GBuffer, runtime: Runtime) -> None:
    function = SUBJECTS[name].function
    plain = function(rods, 0.4, runtime=runtime)
    a, confidence = function(rods, 0.4, confidence=True, runtime=runtime)
    np.testing.assert_array_equal(a, plain)
    np.testing.assert_array_equal(confidence, ao_confidence(rods, plain, 0.4, runtime=runtime))
    assert confidence.dtype == np.float32
    assert float(np.ptp(confidence)) > 0.5


def test_bent_normals_and_confidence_come_together(rods: GBuffer, runtime: Runtime) -> None:
    a, bent, confidence = gtao(rods, 0.4, bent_normals=True, confidence=True, runtime=runtime)
    expected = gtao(rods, 0.4, bent_normals=True, runtime=runtime)
    np.testing.assert_array_equal(a, expected[0])
    np.testing.assert_array_equal(bent, expected[1])
    np.testing.assert_array_equal(confidence, ao_confidence(rods, a, 0.4, runtime=runtime))


def test_it_is_of_the_radius_that_was_used(rods: GBuffer, runtime: Runtime) -> None:
    a, confidence = ssao(rods, [0.1, 0.4], confidence=True, runtime=runtime)
    np.testing.assert_array_equal(confidence, ao_confidence(rods, a, 0.4, runtime=runtime))  # the largest
    a, confidence = gtao(rods, confidence=True, runtime=runtime)
    np.testing.assert_array_equal(confidence, ao_confidence(rods, a, sensible_radius(rods), runtime=runtime))


def test_bands_have_the_bits_of_the_whole(rods: GBuffer, runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = gtao(rods, 0.4, confidence=True, runtime=runtime)
    monkeypatch.setattr(bands, "_first_guess", lambda *_: 32)
    banded = gtao(rods, 0.4, confidence=True, max_memory=1 << 33, runtime=runtime)
    for one, other in zip(whole, banded, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_gbuffer_on_the_device_gives_the_same(rods: GBuffer, runtime: Runtime) -> None:
    a, confidence = gtao(on_device(rods, runtime), 0.4, confidence=True)
    expected = gtao(rods, 0.4, confidence=True, runtime=runtime)
    np.testing.assert_array_equal(a, expected[0])
    # Normals go to the view and back, roundings of float32, which move a tap by a pixel here and there.
    assert np.mean(np.abs(confidence - expected[1]) > 1e-3) < 1e-3


def test_batches_have_it_image_by_image(rods: GBuffer, runtime: Runtime) -> None:
    a, confidence = hbao(gi.GBufferBatch([rods, rods]), 0.4, confidence=True, runtime=runtime)  # type: ignore[arg-type]
    assert a.shape == confidence.shape == (2, *rods.size)
    np.testing.assert_array_equal(confidence[1], hbao(rods, 0.4, confidence=True, runtime=runtime)[1])


def test_ao_returns_it_before_the_choice(rods: GBuffer, runtime: Runtime) -> None:
    a, confidence, choice = gi.ao(rods, 0.4, confidence=True, explain=True, runtime=runtime)
    assert choice.params.radius == 0.4
    np.testing.assert_array_equal(confidence, ao_confidence(rods, a, 0.4, runtime=runtime))
    np.testing.assert_array_equal(gi.ao(rods, 0.4, confidence=True, runtime=runtime)[1], confidence)


def test_of_a_scene_ends_of_surfaces_count(runtime: Runtime) -> None:
    built = make_scene("rods-302")
    made = built.camera(96, 64)
    a, confidence, choice = gi.ao(
        scene=built.scene, camera=made, radius=0.4, confidence=True, explain=True, runtime=runtime
    )
    assert choice.thickness
    guessed, known = (
        ao_confidence(
            rasterized(
                built.scene, made, layers=choice.layers, overscan=choice.overscan, thickness=thickness, runtime=runtime
            ),
            a,
            0.4,
            runtime=runtime,
        )
        for thickness in (False, True)
    )
    assert np.mean(np.abs(confidence - known) > 1e-3) < 1e-3  # see above
    assert float(known.mean()) > float(guessed.mean()) + 0.01


@pytest.mark.parametrize("function", [gi.ao, *(each.function for each in SUBJECTS.values())])
@pytest.mark.parametrize("more", [{}, {"max_memory": 1 << 33}])
def test_what_is_no_switch_is_refused(function: Any, more: dict[str, Any], rods: GBuffer, runtime: Runtime) -> None:
    if function is gi.ao and more:
        return
    with pytest.raises(TypeError, match="confidence is 1: expected True or False"):
        function(rods, 0.4, confidence=1, runtime=runtime, **more)
