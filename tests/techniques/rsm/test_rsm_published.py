"""RSM gathering as published: against float64, the paper's formulas, interpolation, bad input."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.rsm.rsm_published import Settings, rsm_published_reference
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.rsm.rsm_published import RsmPublished, RsmPublishedParams

from ..analytic import CAMERAS, camera, scene, slow_but
from .test_rsm_gather import FLIPS, LIGHTS, box, box_map, facing, relative, share_off, texel

SETTINGS = Settings(samples=60, radius=0.4, offset=1.0, spacing=4, position_tolerance=2.0, normal_tolerance=0.2)


def gathered(
    runtime: Runtime, gbuffer: GBuffer, rsms: Any, settings: Settings
) -> tuple[NDArray[np.float32], RsmPublished]:
    params = RsmPublishedParams(**asdict(settings))
    technique = RsmPublished(runtime, gbuffer.size, params, gbuffer.margin)
    return technique(gbuffer, rsms), technique


# ---- against float64


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(
    "change",
    [
        {"radius": 1.5, "spacing": 3},
        pytest.param({}, marks=pytest.mark.slow),
        pytest.param({"spacing": 1}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_every_kernel_variant_agrees_with_the_reference(
    variant_runtime: Runtime, light: str, change: dict[str, Any]
) -> None:
    settings = replace(SETTINGS, **change)
    e, _ = gathered(variant_runtime, box(), box_map(light), settings)
    wanted, _ = rsm_published_reference(box(), [box_map(light)], settings)
    assert wanted.any()
    assert share_off(e, wanted) <= FLIPS


@pytest.mark.parametrize("kind", slow_but(CAMERAS, "perspective", "orthographic"))
def test_the_reference_is_met_in_every_camera_and_with_a_margin(
    runtime: Runtime, rng: np.random.Generator, kind: str
) -> None:
    gbuffer = scene("bumpy", camera(kind, size=(31, 39)), rng, margin=(3, 6))
    e, _ = gathered(runtime, gbuffer, box_map(), SETTINGS)
    wanted, found = rsm_published_reference(gbuffer, [box_map()], SETTINGS)
    assert 0.1 < found.mean() < 0.95
    assert share_off(e, wanted) <= FLIPS


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (7, 1), (3, 17), (9, 16)], ids=str)
def test_images_of_any_size(variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int]) -> None:
    gbuffer = scene("corner", camera(size=size), rng)
    e, _ = gathered(variant_runtime, gbuffer, box_map(), SETTINGS)
    wanted, _ = rsm_published_reference(gbuffer, [box_map()], SETTINGS)
    assert share_off(e, wanted) <= FLIPS


def test_several_maps_give_the_sum_of_their_light(variant_runtime: Runtime) -> None:
    maps = [box_map(light) for light in LIGHTS]
    e, _ = gathered(variant_runtime, box(), maps, SETTINGS)
    # Each one's light is held to the reference above.
    each = [gathered(variant_runtime, box(), seen, SETTINGS)[0] for seen in maps]
    np.testing.assert_allclose(e, sum(each), rtol=1e-5, atol=1e-6 * e.mean())


# ---- the paper's formulas


@pytest.mark.parametrize("distance", [0.5, 2.0])
def test_one_texel_is_a_point(runtime: Runtime, distance: float) -> None:
    # Facing each other on an axis: flux / (pi d^2), no area. The disk covers the only texel and
    # xi^2 < 1 of the weights falls on it: all, with a radius that stays inside.
    settings = replace(SETTINGS, offset=0.0, spacing=1, samples=1, radius=1e-3)
    e, _ = gathered(runtime, facing(distance), texel(), settings)
    share = math.pi * 1e-6  # of a texel's area that the disk has
    np.testing.assert_allclose(e[0, 0], share * 2.0 / (math.pi * distance**2), rtol=1e-5)


def test_lights_move_along_minus_their_normal(runtime: Runtime) -> None:
    # By half the width 2 tan(0.5) of the texel's surface.
    settings = replace(SETTINGS, offset=0.5, spacing=1, samples=1, radius=1e-3)
    e, _ = gathered(runtime, facing(0.25), texel(), settings)
    away = 0.25 + math.tan(0.5)
    np.testing.assert_allclose(e[0, 0], math.pi * 1e-6 * 2.0 / (math.pi * away**2), rtol=1e-5)


@pytest.mark.parametrize("light", slow_but(LIGHTS, "spot"))
def test_the_published_weights_do_not_converge_to_the_sum_over_all_texels(runtime: Runtime, light: str) -> None:
    every = rsm_gather(box(), box_map(light, 64), pattern="all", runtime=runtime)
    few, many = (
        relative(
            rsm_gather(box(), box_map(light, 64), n, method="published", radius=1.5, spacing=1, runtime=runtime), every
        )
        for n in (6400, 65536)
    )
    # Distant lights are given too much weight: xi^2 where the samples' density asks for xi.
    assert many > 0.3
    assert many == pytest.approx(few, rel=0.1)


# ---- interpolation


def test_a_plain_wall_is_interpolated_alone(runtime: Runtime) -> None:
    wall = facing(0.7, (64, 96), view_height=1.0)
    settings = replace(SETTINGS, spacing=8, radius=1.5)
    e, technique = gathered(runtime, wall, texel(size=64), settings)
    assert technique.computed == pytest.approx(1.0 / 64.0)
    every, _ = gathered(runtime, wall, texel(size=64), replace(settings, spacing=1))
    # Linear in rows and columns between pixels 8 apart, constant beyond the outermost ones.
    for axis in (0, 1):
        known = np.arange(4, every.shape[axis], 8)
        every = np.apply_along_axis(lambda line, at=known: np.interp(np.arange(len(line)), at, line[at]), axis, every)
    np.testing.assert_allclose(e, every, rtol=1e-5)


def test_even_light_stays_even(runtime: Runtime) -> None:
    # A piece of the wall so small that its cosines differ by (1e-4)^2, on the axis of the texel.
    wall = facing(0.5, (32, 48), view_height=1e-4)
    settings = replace(SETTINGS, radius=0.05)
    e, technique = gathered(runtime, wall, texel(), settings)
    assert technique.computed < 0.1
    np.testing.assert_allclose(e, np.broadcast_to(e[16, 24], e.shape), rtol=1e-6)
    assert e.min() > 0.0


def test_edges_are_gathered_for_at_full_resolution(runtime: Runtime) -> None:
    settings = replace(SETTINGS, spacing=4)
    e, technique = gathered(runtime, box(80, 60), box_map(), settings)
    every, _ = gathered(runtime, box(80, 60), box_map(), replace(settings, spacing=1))
    _, found = rsm_published_reference(box(80, 60), [box_map("spot", 2)], settings)
    assert 0.2 < technique.computed < 0.7
    same = (e == every).all(axis=-1)
    assert same[found].all()
    assert not same.all()
    # Where normals turn within two pixels, three of four low-resolution ones are rarely suitable.
    normal = np.asarray(box(80, 60).normal)
    turns = np.abs(np.diff(normal, axis=1)).max(axis=-1)[:, :-1] > 0.5
    assert found[:, 1:-1][turns].mean() > 0.6


def test_no_tolerance_leaves_every_pixel_to_gathering(runtime: Runtime) -> None:
    strict = replace(SETTINGS, position_tolerance=0.0)
    e, technique = gathered(runtime, box(), box_map(), strict)
    every, _ = gathered(runtime, box(), box_map(), replace(SETTINGS, spacing=1))
    np.testing.assert_array_equal(e, every)
    # The low-resolution pass was for nothing.
    assert technique.computed > np.isfinite(np.asarray(box().depth)).mean()


# ---- empty images and bad input


def test_an_empty_image_gets_nothing(runtime: Runtime) -> None:
    view = camera(size=(9, 13))
    nothing = GBuffer(camera=view, depth=np.full((9, 13), np.inf))
    e, technique = gathered(runtime, nothing, box_map(), SETTINGS)
    assert not e.any()
    assert technique.computed == 0.0


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"spacing": 0}, r"spacing is 0: expected an integer >= 1 and <= 64.*px"),
        ({"radius": 0.0}, r"radius is 0.0: expected a number > 0"),
        ({"normal_tolerance": 0.0}, r"normal_tolerance is 0.0: expected a number"),
        ({"pattern": "flux"}, r"pattern='flux' applies only to method='unbiased' \(got"),
        ({"resolution": "full"}, r"resolution='full' applies only to method='unbiased'"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused(runtime: Runtime, params: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rsm_gather(box(), box_map(), method="published", runtime=runtime, **params)
