"""Tests that every technique of ambient occlusion passes: SSAO, HBAO, GTAO and visibility bitmask."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.ssao import ssao
from ssgi_cl.techniques.filters.bilateral import BilateralParams

from ..analytic import (
    CAMERAS,
    VIEWS,
    camera,
    check_second_run,
    scene,
    share_off,
    slow_but,
    tilted,
    trace,
    uploaded,
    view_of,
)
from .subjects import FLIPS, RADIUS, ROUNDING, SLICED, SUBJECTS, Subject


@pytest.fixture(params=SUBJECTS)
def subject(request: pytest.FixtureRequest) -> Subject:
    """Each technique."""
    return SUBJECTS[request.param]


# ---- the blur


def left_of_the_pattern(blur: BilateralParams, tile: int, rng: np.random.Generator) -> float:
    """Return the part of what repeats with a tile that a blur on a plane leaves."""
    pattern = rng.standard_normal((tile, tile))
    pattern -= pattern.mean()
    weights = blur.weights()
    kernel = np.concatenate([weights[:0:-1], weights])
    blurred = np.tile(pattern, (6, 6))
    for axis in (0, 1):
        blurred = np.apply_along_axis(np.convolve, axis, blurred, kernel / kernel.sum(), "same")
    inner = slice(tile * 2, tile * 4)
    return float(np.std(blurred[inner, inner]) / np.std(pattern))


@pytest.mark.parametrize(("name", "tile"), [(name, 8 if name == "ssao" else 4) for name in SUBJECTS])
def test_the_blur_takes_away_what_repeats_with_the_tile(rng: np.random.Generator, name: str, tile: int) -> None:
    params = SUBJECTS[name].params()
    # The mean of the tile leaves roundings; of GTAO's Gaussian of radius 3, .5 two pixels away, of period 2
    # 1 - 2 x .841 + 2 x .5 - 2 x .210 over the sum, 4.10.
    assert left_of_the_pattern(params.blur, tile, rng) < (0.026 if name == "gtao" else 1e-12)
    other = replace(params, blur_radius=params.blur_radius - 1)
    assert other.blur.sigma == (math.inf if name == "gtao" else 0.0)
    late = replace(params, resolution="half", blur_resolution="full")
    assert late.blur.sigma == 0.0  # the tile is twice as large there


# ---- against the numpy reference


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, subject: Subject, name: str, kind: str
) -> None:
    gbuffer = view_of(name, kind, (31, 39))
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    assert share_off(a, subject.expected(gbuffer, blur_radius=0), ROUNDING) <= FLIPS


FEW: dict[str, Any] = {"slices": 1, "taps": 2, "tap_power": 1.0, "contrast": 2.2, "bias": 0.05}
LIMITED: dict[str, Any] = {"bias": 0.05, "max_radius_px": 6.0}
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    ("hbao", {"attenuation": 0.0, "angle_bias": 0.4, **FEW}),
    ("hbao", LIMITED),
    ("gtao", {"falloff": 0.615, "radius": 0.73, "contrast": 2.2, "thin_occluder": 0.7}),
    ("gtao", {"horizon_decay": 0.3, "falloff": 0.4}),
    ("gtao", {"horizon_decay": 0.6}),
    ("gtao", {"resolution": "half", **LIMITED}),  # limits in px are those of the full size
    ("bitmask", {"sectors": "angle", "thickness": 0.1, **FEW}),
    ("bitmask", {"thickness": 0.0}),
    ("bitmask", {"thickness": 1e3, **LIMITED}),
    ("ssao", {"hemisphere": False, "falloff": "exponential", "falloff_rate": 2.0, "outside": 3.0}),
    ("ssao", {"hemisphere": False, "falloff": (1.0, 0.6, 0.2), "falloff_end": 0.8}),
    ("ssao", {"radius": (0.2, 0.6, 1.5), "ramp_start": 0.3, "ramp_end": 0.9, "power": 1.7, **LIMITED}),
    ("ssao", {"length_power": 1 / 3, "near_px": 5.0, "max_samples": 40, "contrast": 2.7}),
]
CHOICES = [
    *((name, choice, "perspective") for name, choice in VARIANTS),
    *(pytest.param(name, choice, "orthographic", marks=pytest.mark.slow) for name, choice in VARIANTS),
    # Each count of slices and taps is a program of its own.
    *(
        pytest.param(name, {"slices": 5, "taps": 9, **LIMITED}, "perspective", marks=pytest.mark.slow)
        for name in SLICED
    ),
]


@pytest.mark.parametrize(("name", "choice", "kind"), CHOICES, ids=str)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, name: str, choice: dict[str, Any], kind: str
) -> None:
    gbuffer = view_of("bumpy", kind, (31, 39))
    params = {"radius": RADIUS, "blur_radius": 0, **choice}
    a = SUBJECTS[name].function(gbuffer, **params, runtime=variant_runtime)
    assert share_off(a, SUBJECTS[name].expected(gbuffer, **params), ROUNDING) <= FLIPS


BLURS = [
    ("full", "own", (7, 2), (3, 5)),
    ("full", "full", (7, 1), (0, 0)),
    ("half", "own", (0, 1), (0, 0)),
    ("half", "full", (7, 2), (3, 5)),
    ("quarter", "own", (7, 1), (3, 5)),
    ("quarter", "full", (7, 2), (0, 0)),
    ("quarter", "full", (0, 1), (3, 5)),
    *(
        pytest.param(resolution, blur_resolution, blur, margin, marks=pytest.mark.slow)
        for resolution in ("full", "half", "quarter")
        for blur_resolution in ("own", "full")
        for blur in ((0, 1), (4, 2), (7, 1), (7, 2))
        for margin in ((0, 0), (3, 5))
    ),
]
"""Size of the occlusion, size of the blur, (radius, passes) of the blur and the G-buffer's margin."""


@pytest.mark.parametrize(("resolution", "blur_resolution", "blur", "margin"), BLURS, ids=str)
def test_every_combination_of_resolution_and_blur_agrees_with_numpy_reference(
    runtime: Runtime, resolution: str, blur_resolution: str, blur: tuple[int, int], margin: tuple[int, int]
) -> None:
    gbuffer = view_of("bumpy", size=(35, 51), margin=margin)
    params = {
        "radius": 1.0,
        "near_px": 5.0,  # limits in px are those of the full size
        "max_samples": 40,
        "max_radius_px": 7.0,
        "resolution": resolution,
        "blur_resolution": blur_resolution,
        "blur_radius": blur[0],
        "blur_passes": blur[1],
    }
    found = ssao(gbuffer, runtime=runtime, **params)
    wanted = SUBJECTS["ssao"].expected(gbuffer, **params)
    # A sample that falls to the other side of an edge by rounding is 1/16 of A in its pixel, and so
    # may change the 15 x 15 round it. Measured: none.
    assert np.mean(np.abs(found - wanted) > 1e-3) <= 0.005


# ---- planes and corners


SIZES = ((1, 1), (17, 31), (3, 5), (16, 600), (600, 16))
TILTS = (0.0, 45.0, 85.0, 89.9)
SHAPES = [
    pytest.param(kind, size, marks=() if fast else pytest.mark.slow)
    for kind in CAMERAS
    for size in SIZES
    for fast in [kind == "perspective" or size == (17, 31)]
]


@pytest.mark.parametrize(("kind", "size"), SHAPES, ids=str)
@pytest.mark.parametrize("normals", [True, False], ids=["given", "rebuilt"])
def test_plane_is_exactly_open_at_any_tilt(
    runtime: Runtime, subject: Subject, kind: str, size: tuple[int, int], normals: bool
) -> None:
    made = camera(kind, size)
    # At least 4 pixels, so that small images have taps at all.
    unit_px = 0.5 * made.height * made.projection[1, 1] / (1 if made.is_orthographic else 5.0)
    radius = max(0.5, 4.0 / unit_px)
    # A normal from depths that are rounded to 2^-24 is off by some 1e-4: within the bias.
    bias = {} if normals else {"bias": 0.02}
    for degrees in TILTS:
        gbuffer = trace(made, [tilted(made, degrees)], normals=normals)
        a = subject.function(gbuffer, radius, blur_radius=0, runtime=runtime, **bias)
        np.testing.assert_array_equal(a, 1.0, err_msg=f"tilt {degrees}")


@pytest.mark.parametrize("resolution", ["full", "half", "quarter"])
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("name", slow_but(SUBJECTS, "ssao"))
def test_blurred_plane_of_an_odd_size_is_open_at_every_resolution(
    variant_runtime: Runtime, name: str, resolution: str, size: tuple[int, int]
) -> None:
    gbuffer = trace(made := camera(size=size), [tilted(made, 40.0)])
    a = SUBJECTS[name].function(gbuffer, 1.0, resolution=resolution, runtime=variant_runtime)
    assert a.shape == size
    # A constant is blurred and upsampled: two divisions round by 2^-24 each.
    np.testing.assert_allclose(a, 1.0, rtol=0, atol=5e-7)


@pytest.mark.parametrize("resolution", ["half", "quarter"])
def test_plane_is_open_exactly_when_blurred_at_full_size(variant_runtime: Runtime, resolution: str) -> None:
    made = Camera.look_at((0, 0, 5), (0, 0, 0), yfov=0.3, width=71, height=33)
    gbuffer = trace(made, [tilted(made, 60.0)])
    a = ssao(gbuffer, radius=0.3, resolution=resolution, blur_radius=7, blur_resolution="full", runtime=variant_runtime)
    np.testing.assert_array_equal(a, 1.0)


def test_margin_gives_what_a_larger_image_gives_inside(runtime: Runtime, subject: Subject) -> None:
    # From the corner of the result patterns repeat every 8 pixels at most, and groups of pixels that scan
    # alike every 64 columns: other margins change both. The blur stops at the edge of the result.
    made = camera(size=(30, 41))
    whole = scene("bumpy", made.with_margin((8, 64)), np.random.default_rng(20))
    inner = GBuffer(camera=made, depth=whole.depth, normal=whole.normal)
    a = subject.function(inner, RADIUS, blur_radius=0, runtime=runtime)
    b = inner.inner(subject.function(whole, RADIUS, blur_radius=0, runtime=runtime))
    assert a.shape == made.size
    # The same pixels, but a camera whose numbers round differently.
    assert share_off(a, b, ROUNDING) <= FLIPS
    bare = GBuffer(
        camera=made, depth=inner.inner(np.asarray(whole.depth)), normal=inner.inner(np.asarray(whole.normal))
    )
    assert np.abs(a - subject.function(bare, RADIUS, blur_radius=0, runtime=runtime)).max() > 0.02


# ---- limits


def test_limit_of_the_projected_radius_is_a_smaller_radius(runtime: Runtime, subject: Subject) -> None:
    gbuffer = view_of("bumpy", "orthographic")
    unit_px = gbuffer.camera.height / 4.0
    limited = subject.function(gbuffer, 1.0, max_radius_px=0.5 * unit_px, blur_radius=0, runtime=runtime)
    small = subject.function(gbuffer, 0.5, blur_radius=0, runtime=runtime)
    assert share_off(limited, small, ROUNDING) <= FLIPS


def test_radius_below_a_pixel_leaves_everything_open(runtime: Runtime, subject: Subject) -> None:
    gbuffer = view_of("noisy", "orthographic")
    whole_ball = {"hemisphere": False} if subject.function is ssao else {}
    a = subject.function(gbuffer, 0.99 * 4.0 / gbuffer.camera.height, blur_radius=0, runtime=runtime, **whole_ball)
    np.testing.assert_array_equal(a, 1.0)


EXTREMES: dict[str, tuple[str, dict[str, Any]]] = {
    **{name: (name, {}) for name in SUBJECTS},
    "whole ball": ("ssao", {"hemisphere": False}),
    "more samples": ("ssao", {"near_px": 4.0, "max_samples": 40}),
    "falloff": ("gtao", {"falloff": 0.5}),
    "angle": ("bitmask", {"sectors": "angle", "slices": 1, "taps": 2}),
}


@pytest.mark.parametrize(("kind", "resolution"), [("perspective", "half"), ("orthographic", "full")])
@pytest.mark.parametrize("limits", [{}, {"max_radius_px": 8.0}], ids=str)
@pytest.mark.parametrize("name", EXTREMES)
def test_any_depths_and_radii_give_visibility_between_0_and_1(
    variant_runtime: Runtime, rng: np.random.Generator, name: str, limits: dict[str, Any], kind: str, resolution: str
) -> None:
    technique, choice = EXTREMES[name]
    function, made = SUBJECTS[technique].function, camera(kind, (17, 70))
    for reach in (0.5, 3.0, 37.0):
        depth = 10.0 ** rng.uniform(-reach, reach, made.size)
        depth[rng.random(made.size) < 0.1] = np.inf
        gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32))
        for radius in (1e-30, 1.0, 1e3, 1e30):
            a = function(gbuffer, radius, resolution=resolution, runtime=variant_runtime, **choice, **limits)
            assert a.min() >= 0.0
            assert a.max() <= 1.0


# ---- what must not matter


@pytest.mark.parametrize("scale", [1e-4, 1e4])
@pytest.mark.parametrize("kind", slow_but(CAMERAS, "perspective", "orthographic"))
def test_result_does_not_depend_on_the_unit_of_length(
    runtime: Runtime, subject: Subject, kind: str, scale: float
) -> None:
    large = scene("bumpy", camera(kind, (31, 39), scale=scale), np.random.default_rng(20), scale=scale)
    one = subject.function(view_of("bumpy", kind, (31, 39)), RADIUS, blur_radius=0, runtime=runtime)
    other = subject.function(large, RADIUS * scale, blur_radius=0, runtime=runtime)
    # Scaled depths round differently, by 2^-24; a flipped sample is 1/16.
    assert share_off(one, other, 1e-3) <= FLIPS


@pytest.mark.parametrize("kind", slow_but(CAMERAS, "perspective", "orthographic"))
def test_scene_far_from_the_origin_looks_as_at_the_origin(runtime: Runtime, subject: Subject, kind: str) -> None:
    shift = np.array([1e6, -1e6, 1e6])
    far = scene("bumpy", camera(kind, (31, 39), shift=shift), np.random.default_rng(20), shift=shift)
    one, other = (
        subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
        for gbuffer in (view_of("bumpy", kind, (31, 39)), far)
    )
    # A double resolves 1e-10 at 1e6, so only the rounding of float32 depths may differ.
    assert share_off(one, other, 1e-3) <= FLIPS


@pytest.mark.parametrize("resolution", slow_but(("full", "half"), "half"))
def test_empty_image_and_pixels_with_nothing_are_open(
    variant_runtime: Runtime, subject: Subject, resolution: str
) -> None:
    made = [camera(kind, size=(9, 20)) for kind in ("perspective", "orthographic")]
    empty = [GBuffer(camera=each, depth=np.full(each.size, np.inf, np.float32)) for each in made]
    for gbuffer in (*empty, view_of("noisy")):
        a = subject.function(gbuffer, RADIUS, resolution=resolution, runtime=variant_runtime)
        np.testing.assert_array_equal(a[np.isinf(gbuffer.depth)], 1.0)


# ---- prepared once, called many times


@pytest.mark.parametrize(("resolution", "layers"), [("full", 1), ("half", 2)])
def test_second_run_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, subject: Subject, resolution: str, layers: int
) -> None:
    gbuffer = view_of("noisy", size=(131, 217))
    depth = np.stack([gbuffer.depth, np.multiply(gbuffer.depth, np.float32(1.1))][:layers])
    device = uploaded(variant_runtime, GBuffer(camera=gbuffer.camera, depth=depth))
    params = subject.params(radius=RADIUS, resolution=resolution)
    technique = subject.kind(variant_runtime, gbuffer.size, params, layers=layers)
    check_second_run(variant_runtime, lambda: technique.run(device).download())


def test_camera_may_change_its_kind_from_frame_to_frame_and_the_result_is_written_to_the_given_array(
    runtime: Runtime, subject: Subject
) -> None:
    gbuffers = [view_of("bumpy", kind) for kind in ("perspective", "orthographic")]
    technique = subject.kind(runtime, gbuffers[0].size, subject.params(radius=RADIUS))
    for gbuffer in (*gbuffers, *gbuffers):
        technique(uploaded(runtime, gbuffer), out := np.zeros(gbuffer.size, np.float32))
        np.testing.assert_array_equal(out, subject.function(gbuffer, RADIUS, runtime=runtime))


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": -1.0}, ValueError, r"radius is -1.0: expected a number > 0.*scene units"),
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0"),
        ({"radius": math.nan}, ValueError, r"radius is nan: expected a number > 0"),
        ({"radius": math.inf}, ValueError, r"radius is inf: expected a number > 0"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected"),
        ({"bias": -0.1}, ValueError, r"bias is -0.1: expected a number >= 0.*radii"),
        ({"contrast": math.nan}, ValueError, r"contrast is nan: expected a number"),
        ({"max_radius_px": 0.5}, ValueError, r"max_radius_px is 0.5: expected a number >= 1.*px"),
        ({"resolution": "third"}, ValueError, r"resolution is 'third': expected one of 'full'"),
        ({"blur_radius": 17}, ValueError, r"blur_radius is 17: expected an integer >= 0 and <= 16"),
        ({"blur_resolution": "half"}, ValueError, r"blur_resolution is 'half': expected"),
        ({"colour": 1}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, subject: Subject, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        subject.function(trace(made := camera(), [tilted(made, 0.0)]), runtime=runtime, **params)


def test_something_else_than_a_gbuffer_is_refused(runtime: Runtime, subject: Subject) -> None:
    with pytest.raises(TypeError, match=r"gbuffer is ndarray: expected GBuffer or DeviceGBuffer"):
        subject.function(np.ones((4, 4)), runtime=runtime)


@pytest.mark.parametrize(
    ("name", "size", "layers"), [*((name, (9, 8), 1) for name in SUBJECTS), *((name, (8, 8), 2) for name in SLICED)]
)
def test_gbuffer_of_another_shape_is_refused(runtime: Runtime, name: str, size: tuple[int, int], layers: int) -> None:
    technique = SUBJECTS[name].kind(runtime, (8, 8))
    with pytest.raises(ValueError, match=r"size(,| and) margin (and layers )?are .*expected \(8, 8\)"):
        technique.run(DeviceGBuffer(runtime, size, layers=layers))
