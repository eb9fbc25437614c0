"""SSAO: against formulas, against its numpy reference, and against itself under what must not
matter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.ssao import ssao_reference
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, reflected_points, ssao

from ..analytic import CAMERAS, SCENES, VIEWS, camera, scene, tilted, trace

RADIUS = 0.6
ROUNDING = 1e-5
"""Of A without blur: a position is rounded to some 1e-6 radii, which the onset of occlusion, 50 a
radius steep, multiplies; one sample in 16 falls into it now and then."""
WEIGHTS = 1e-4
"""Of a blurred A: the error that kernels/common/lanes.clh states for a weight's power of two."""
FLIPS = 1e-3
"""Share of pixels in which one sample may fall to the other side of a pixel's edge or a surface.

A pixel position is rounded to about 2^-18 px, so that a sample in 1e5 reads the next pixel, which
matters at edges only. Measured over 200 images of 61 x 47, all scenes and cameras: 1 pixel of
573400. An image of that size may have 2.
"""


def share_off(a: NDArray[Any], b: NDArray[Any], tolerance: float) -> float:
    """Return the share of pixels that differ by more than `tolerance` (or are not numbers)."""
    return float(np.mean(~(np.abs(a - b) <= tolerance)))


def wall(size: tuple[int, int], depth: float = 5.0) -> GBuffer:
    """Return a wall that faces an orthographic camera; a pixel covers 0.1 scene units."""
    made = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=0.1 * size[0], width=size[1], height=size[0])
    return trace(made, [tilted(made, 0.0, distance=depth)])


PIXEL = 0.1
"""Scene units that a pixel of `wall` covers."""


# ---- against the numpy reference


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer = scene(name, camera(kind), rng)
    params = SsaoParams(radius=RADIUS, blur_radius=0)
    a = ssao(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    assert share_off(a, ssao_reference(gbuffer, params), ROUNDING) <= FLIPS


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("resolution", ["full", "half", "quarter"])
def test_blurred_result_agrees_with_numpy_reference_at_every_resolution(
    runtime: Runtime, rng: np.random.Generator, name: str, resolution: str
) -> None:
    gbuffer = scene(name, camera(), rng)
    params = SsaoParams(radius=RADIUS, resolution=resolution)
    a = ssao(gbuffer, RADIUS, resolution=resolution, runtime=runtime)
    # A flip spreads over the 5 x 5 pixels of the blur and over the pixels of a coarse one.
    assert share_off(a, ssao_reference(gbuffer, params), WEIGHTS) <= 25 * FLIPS


VARIANTS: dict[str, dict[str, Any]] = {
    "ball": {"hemisphere": False},
    "exponential": {"falloff": "exponential", "falloff_rate": 2.0, "outside": "open", "hemisphere": False},
    "power": {"ramp_start": 0.3, "ramp_end": 0.9, "power": 1.7, "samples": 7, "length_power": 1 / 3},
    "values": {"falloff": (1.0, 0.6, 0.5, 0.0), "falloff_end": 0.8, "outside": 3.0},
    "radii": {"radius": (0.2, 0.6, 1.5), "max_radius_px": 9.0},
    "more samples near the eye": {"near_px": 5.0, "max_samples": 40, "bias": 0.1},
    "contrast": {"contrast": 2.7},
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, variant: str
) -> None:
    gbuffer = scene("bumpy", camera(size=(31, 39)), rng)
    params = {"radius": RADIUS, "blur_radius": 0, **VARIANTS[variant]}
    a = ssao(gbuffer, **params, runtime=variant_runtime)
    assert share_off(a, ssao_reference(gbuffer, SsaoParams(**params)), ROUNDING) <= FLIPS


@pytest.mark.slow
@pytest.mark.parametrize("name", ["corner", "noisy"])
@pytest.mark.parametrize("resolution", ["full", "half"])
def test_every_kernel_variant_gives_the_same_result(
    runtime: Runtime, every_variant: Runtime, rng: np.random.Generator, name: str, resolution: str
) -> None:
    gbuffer = scene(name, camera(size=(131, 217)), rng)
    a = ssao(gbuffer, RADIUS, resolution=resolution, runtime=runtime)
    b = ssao(gbuffer, RADIUS, resolution=resolution, runtime=every_variant)
    # Contraction is off, so variants differ only where a device's division or root is not exact.
    assert share_off(a, b, 1e-5) < 1e-4


# ---- what a plane must give


SIZES = ((1, 1), (17, 31), (3, 5), (47, 61), (16, 600), (600, 16))


SHAPES = [
    pytest.param(kind, size, marks=() if fast else pytest.mark.slow)
    for kind in CAMERAS
    for size in SIZES
    for fast in [kind == "perspective" or size == (17, 31)]
]


@pytest.mark.parametrize(("kind", "size"), SHAPES, ids=str)
@pytest.mark.parametrize("normals", [True, False], ids=["given", "rebuilt"])
def test_plane_is_open_at_any_tilt(runtime: Runtime, kind: str, size: tuple[int, int], normals: bool) -> None:
    made = camera(kind, size)
    # At least 4 pixels, so that small images have samples at all.
    unit_px = 0.5 * made.height * made.projection[1, 1] / (1 if made.is_orthographic else 5.0)
    radius = max(0.5, 4.0 / unit_px)
    for degrees in (0.0, 20.0, 45.0, 70.0, 85.0, 89.0, 89.9):
        gbuffer = trace(made, [tilted(made, degrees)], normals=normals)
        a = ssao(gbuffer, radius, runtime=runtime)
        # Nothing rises above the plane by the bias, so occlusion is 0; the blur's division rounds.
        np.testing.assert_allclose(a, 1.0, rtol=0, atol=1e-5, err_msg=f"tilt {degrees}")


def test_plane_is_open_on_every_kernel_variant(variant_runtime: Runtime) -> None:
    made = camera(size=(17, 31))
    for normals in (True, False):
        gbuffer = trace(made, [tilted(made, 80.0)], normals=normals)
        np.testing.assert_allclose(
            ssao(gbuffer, 1.0, runtime=variant_runtime),
            1.0,
            rtol=0,
            atol=1e-5,  # as above
        )


@pytest.mark.parametrize("resolution", ["half", "quarter"])
@pytest.mark.parametrize("size", SIZES, ids=str)
def test_plane_is_open_at_reduced_resolution_of_odd_sizes(
    runtime: Runtime, resolution: str, size: tuple[int, int]
) -> None:
    gbuffer = trace(made := camera(size=size), [tilted(made, 40.0)])
    a = ssao(gbuffer, 1.0, resolution=resolution, runtime=runtime)
    assert a.shape == size
    # A constant is blurred and upsampled: two divisions round by 2^-24 each.
    np.testing.assert_allclose(a, 1.0, rtol=0, atol=5e-7)


def test_half_of_the_ball_round_a_flat_wall_is_occluded_without_hemisphere(runtime: Runtime) -> None:
    a = ssao(wall((32, 32)), 0.5, 40, hemisphere=False, blur_radius=0, contrast=1.0, runtime=runtime)
    # 40 quasi-random points of 16 reflections: half of them behind the wall, to a point of each.
    assert abs(float(a.mean()) - 0.5) < 1 / 64


def test_inner_corner_is_darker_than_the_planes_away_from_it(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    a = ssao(gbuffer, RADIUS, runtime=runtime)
    assert a.min() < 0.7
    assert a.max() > 0.999


# ---- formulas


def occlusion_by_formula(params: SsaoParams, row: int, column: int, weight: Any) -> NDArray[np.float64]:
    """Return A of a pixel of `wall` by definition: a point s lies s_z radii in front of it."""
    points = reflected_points(params.samples, params.length_power)[row % 4, column % 4]
    behind = -points[:, 2]
    return 1.0 - np.mean(np.where(behind > 0, weight(np.maximum(behind, 0.0)), 0.0))


FALLOFFS: dict[str, tuple[dict[str, Any], Any]] = {
    "exponential": ({"falloff": "exponential", "falloff_rate": 2.5}, lambda d: np.exp(-2.5 * d)),
    "constant": ({}, np.ones_like),
    "ramp": ({"ramp_start": 0.2, "ramp_end": 0.7}, lambda d: np.clip((0.7 - d) / 0.5, 0, 1)),
    "power": ({"ramp_start": 0.2, "ramp_end": 0.7, "power": 2.2}, lambda d: np.clip((0.7 - d) / 0.5, 0, 1) ** 2.2),
    "values": (
        {"falloff": (1.0, 0.25, 0.75), "falloff_end": 0.8},
        lambda d: np.where(d <= 0.8, np.interp(d, (0.0, 0.4, 0.8), (1.0, 0.25, 0.75)), 0.0),
    ),
}


@pytest.mark.parametrize("name", FALLOFFS)
def test_falloff_weighs_occluders_by_its_formula(runtime: Runtime, name: str) -> None:
    choice, weight = FALLOFFS[name]
    params = SsaoParams(radius=0.4, hemisphere=False, blur_radius=0, contrast=1.0, **choice)
    a = Ssao(runtime, (16, 16), params)(_uploaded(runtime, wall((16, 16))))
    wanted = [[occlusion_by_formula(params, y, x, weight) for x in range(6, 10)] for y in range(6, 10)]
    # Depths of 5 are rounded to 2^-22, which is 6e-7 radii; the steepest falloff is 4.4 a radius.
    np.testing.assert_allclose(a[6:10, 6:10], wanted, rtol=0, atol=5e-6)


@pytest.mark.parametrize("contrast", [0.3, 2.5, 10.0])
def test_contrast_raises_the_result_to_its_power_and_leaves_the_open_open(
    variant_runtime: Runtime, rng: np.random.Generator, contrast: float
) -> None:
    gbuffer = scene("bumpy", camera(size=(31, 39)), rng)
    a = ssao(gbuffer, RADIUS, blur_radius=0, contrast=1.0, runtime=variant_runtime)
    deeper = ssao(gbuffer, RADIUS, blur_radius=0, contrast=contrast, runtime=variant_runtime)
    # v_pow's bound; 1 stays exactly 1.
    np.testing.assert_allclose(deeper, a.astype(np.float64) ** contrast, rtol=0, atol=3e-7)
    assert (a == 1.0).any()
    np.testing.assert_array_equal(deeper[a == 1.0], 1.0)


@pytest.mark.parametrize("outside", ["unknown", "open", 4.8])
def test_samples_outside_the_image_count_as_the_policy_says(runtime: Runtime, outside: str | float) -> None:
    params = SsaoParams(
        radius=0.4, hemisphere=False, blur_radius=0, outside=outside, falloff="exponential", contrast=1.0
    )
    a = Ssao(runtime, (8, 8), params)(_uploaded(runtime, wall((8, 8))))
    points = reflected_points(16, 0.5)[0, 0]
    column, row = 0.5 + points[:, 0] * 0.4 / PIXEL, 0.5 - points[:, 1] * 0.4 / PIXEL
    inside = (column >= 0) & (row >= 0)  # the ball is smaller than the image
    assert 0 < inside.sum() < 16
    seen = np.where(inside, 5.0, {"unknown": math.inf, "open": math.inf}.get(outside, outside))
    behind = (5.0 - 0.4 * points[:, 2] - seen) / 0.4
    weight = np.where(behind > 0, np.exp(-np.maximum(behind, 0.0)), 0.0)
    counted = inside if outside == "unknown" else np.ones(16)
    # Depths of 5 are rounded to 2^-22, which is 6e-7 radii.
    np.testing.assert_allclose(a[0, 0], 1 - np.sum(weight) / np.sum(counted), rtol=0, atol=5e-6)


def test_of_several_radii_the_greatest_occlusion_counts(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    radii = (0.15, 0.5, 2.0)
    single = [ssao(gbuffer, r, blur_radius=0, runtime=runtime) for r in radii]
    together = ssao(gbuffer, radii, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(together, np.min(single, axis=0))


# ---- limits near the camera


def test_limit_of_the_projected_radius_is_a_smaller_radius(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", made := camera("orthographic"), rng)
    unit_px = made.height / 4.0
    limited = ssao(gbuffer, 1.0, max_radius_px=0.5 * unit_px, blur_radius=0, runtime=runtime)
    small = ssao(gbuffer, 0.5, blur_radius=0, runtime=runtime)
    assert share_off(limited, small, ROUNDING) <= FLIPS


@pytest.mark.parametrize(("factor", "count"), [(0.5, 16), (24.5 / 16, 24), (5.0, 40)])
def test_samples_grow_with_the_projected_radius_up_to_the_most(
    runtime: Runtime, rng: np.random.Generator, factor: float, count: int
) -> None:
    gbuffer = scene("bumpy", made := camera("orthographic"), rng)
    near_px = RADIUS * made.height / 4.0 / factor
    a = ssao(gbuffer, RADIUS, near_px=near_px, max_samples=40, blur_radius=0, runtime=runtime)
    b = ssao(gbuffer, RADIUS, count, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(a, b)  # the same points in the same order


def test_radius_below_a_pixel_leaves_everything_open(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", made := camera("orthographic"), rng)
    a = ssao(gbuffer, 0.99 * 4.0 / made.height, hemisphere=False, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(a, 1.0)


@pytest.mark.parametrize("radius", [1e-30, 1e-6, 1e6, 1e30])
@pytest.mark.parametrize(
    ("hemisphere", "kind"),
    [
        (True, "perspective"),
        (False, "orthographic"),
        pytest.param(True, "orthographic", marks=pytest.mark.slow),
        pytest.param(False, "perspective", marks=pytest.mark.slow),
    ],
)
def test_any_radius_gives_visibility_between_0_and_1(
    runtime: Runtime, rng: np.random.Generator, radius: float, hemisphere: bool, kind: str
) -> None:
    gbuffer = scene("noisy", camera(kind), rng)
    for limits in ({}, {"max_radius_px": 8.0}, {"near_px": 4.0, "max_samples": 40}):
        a = ssao(gbuffer, radius, hemisphere=hemisphere, runtime=runtime, **limits)
        assert a.min() >= 0.0
        assert a.max() <= 1.0


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("resolution", ["full", "half"])
def test_any_depths_give_visibility_between_0_and_1(
    variant_runtime: Runtime, rng: np.random.Generator, kind: str, resolution: str
) -> None:
    made = camera(kind, (33, 70))
    for reach in (3.0, 37.0):
        depth = 10.0 ** rng.uniform(-reach, reach, made.size)
        depth[rng.random(made.size) < 0.1] = np.inf
        gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32))
        for radius in (1e-20, 1.0, 1e20):
            a = ssao(gbuffer, radius, resolution=resolution, runtime=variant_runtime)
            assert a.min() >= 0.0
            assert a.max() <= 1.0


# ---- what must not matter


@pytest.mark.parametrize("scale", [1e-4, 1e4, *(pytest.param(s, marks=pytest.mark.slow) for s in (1e-2, 1e2))])
@pytest.mark.parametrize("kind", CAMERAS)
def test_result_does_not_depend_on_the_unit_of_length(runtime: Runtime, kind: str, scale: float) -> None:
    one, other = (
        ssao(
            scene("bumpy", camera(kind, (31, 39), scale=s), np.random.default_rng(3), scale=s),
            RADIUS * s,
            blur_radius=0,
            runtime=runtime,
        )
        for s in (1.0, scale)
    )
    # Scaled depths round differently, by 2^-24; a flipped sample is 1/16.
    assert share_off(one, other, 1e-3) <= FLIPS


@pytest.mark.parametrize("kind", CAMERAS)
def test_scene_far_from_the_origin_looks_as_at_the_origin(runtime: Runtime, kind: str) -> None:
    one, other = (
        ssao(
            scene("bumpy", camera(kind, (31, 39), shift=s), np.random.default_rng(3), shift=s),
            RADIUS,
            blur_radius=0,
            runtime=runtime,
        )
        for s in (np.zeros(3), np.array([1e6, -1e6, 1e6]))
    )
    # A double resolves 1e-10 at 1e6, so only the rounding of float32 depths may differ.
    assert share_off(one, other, 1e-3) <= FLIPS


def test_two_runs_give_bit_identical_results(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("noisy", camera(size=(131, 217)), rng)
    device = _uploaded(variant_runtime, gbuffer)
    technique = Ssao(variant_runtime, gbuffer.size, SsaoParams(radius=RADIUS))
    np.testing.assert_array_equal(technique(device), technique(device))


@pytest.mark.parametrize("margin", [(4, 8), (12, 4)])
def test_margin_gives_what_a_larger_image_gives_inside(
    runtime: Runtime, rng: np.random.Generator, margin: tuple[int, int]
) -> None:
    # The random vectors repeat every 4 pixels from the corner of the result, so that only margins
    # of a multiple of 4 leave each pixel its own; and the blur stops at the edge of the result.
    made = camera(size=(30, 41))
    larger = made.with_margin(margin)
    whole = scene("bumpy", larger, rng)
    inner = GBuffer(camera=made, depth=whole.depth, normal=whole.normal)
    a = ssao(inner, RADIUS, blur_radius=0, runtime=runtime)
    b = inner.inner(ssao(whole, RADIUS, blur_radius=0, runtime=runtime))
    assert a.shape == made.size
    assert share_off(a, b, ROUNDING) <= FLIPS


@pytest.mark.parametrize("margin", [(1, 2), (3, 3), (2, 7), (0, 5)])
@pytest.mark.parametrize("resolution", ["full", "half", "quarter"])
def test_any_margin_agrees_with_numpy_reference_at_every_resolution(
    variant_runtime: Runtime, rng: np.random.Generator, margin: tuple[int, int], resolution: str
) -> None:
    gbuffer = scene("bumpy", camera(size=(20, 28)), rng, margin=margin)
    params = SsaoParams(radius=RADIUS, resolution=resolution)
    a = ssao(gbuffer, RADIUS, resolution=resolution, runtime=variant_runtime)
    assert share_off(a, ssao_reference(gbuffer, params), WEIGHTS) <= 25 * FLIPS


@pytest.mark.parametrize(("resolution", "bound"), [("half", 0.035), ("quarter", 0.065)])
def test_reduced_resolution_is_close_to_the_full_one(
    runtime: Runtime, rng: np.random.Generator, resolution: str, bound: float
) -> None:
    gbuffer = scene("corner", camera(size=(121, 161)), rng)
    full = ssao(gbuffer, RADIUS, blur_radius=4, runtime=runtime)
    a = ssao(gbuffer, RADIUS, blur_radius=4, resolution=resolution, runtime=runtime)
    # A blur of 4 px covers 2 and 4 times the length, and creases are that much wider. Measured:
    # RMSE 0.026 and 0.051; the bound leaves room for other points, not for a shift by a pixel.
    assert math.sqrt(np.mean((a - full) ** 2)) < bound


def test_empty_image_is_open(variant_runtime: Runtime) -> None:
    made = camera(size=(9, 20))
    gbuffer = GBuffer(camera=made, depth=np.full(made.size, np.inf, np.float32))
    for resolution in ("full", "half"):
        a = ssao(gbuffer, resolution=resolution, runtime=variant_runtime)
        np.testing.assert_array_equal(a, 1.0)


def test_pixels_with_nothing_are_open(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("noisy", camera(), rng)
    for resolution in ("full", "half"):
        a = ssao(gbuffer, RADIUS, resolution=resolution, runtime=runtime)
        np.testing.assert_array_equal(a[np.isinf(gbuffer.depth)], 1.0)


def test_zero_normals_mean_reconstruction(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    zero = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=np.zeros((*gbuffer.size, 3)))
    none = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth)
    a = ssao(zero, RADIUS, runtime=runtime)
    np.testing.assert_array_equal(a, ssao(none, RADIUS, runtime=runtime))


@pytest.mark.parametrize("length", [1e-30, 1e-3, 3.7, 1e30])
def test_length_of_given_normals_does_not_matter(runtime: Runtime, rng: np.random.Generator, length: float) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    normal = np.asarray(gbuffer.normal) * np.float32(length)
    scaled = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=normal)
    a = ssao(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    b = ssao(scaled, RADIUS, blur_radius=0, runtime=runtime)
    # A normal's components round by 2^-24, so that a sample may change sides.
    assert share_off(a, b, ROUNDING) <= FLIPS


def test_normals_may_point_either_way(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    turned = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=-np.asarray(gbuffer.normal))
    a = ssao(gbuffer, RADIUS, runtime=runtime)
    np.testing.assert_array_equal(a, ssao(turned, RADIUS, runtime=runtime))


# ---- prepared once, called many times


@pytest.mark.parametrize("resolution", ["full", "half"])
def test_second_call_allocates_and_builds_nothing(
    variant_runtime: Runtime, rng: np.random.Generator, resolution: str
) -> None:
    gbuffer = scene("bumpy", camera(), rng)
    device = _uploaded(variant_runtime, gbuffer)
    technique = Ssao(variant_runtime, gbuffer.size, SsaoParams(radius=RADIUS, resolution=resolution))
    first = technique.run(device).download()
    before = variant_runtime.allocated_bytes, variant_runtime.builds
    second = technique.run(device).download()
    assert (variant_runtime.allocated_bytes, variant_runtime.builds) == before
    np.testing.assert_array_equal(first, second)


def test_result_is_written_to_the_given_array(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    technique = Ssao(runtime, gbuffer.size, SsaoParams(radius=RADIUS))
    out = np.zeros(gbuffer.size, np.float32)
    technique(_uploaded(runtime, gbuffer), out)
    np.testing.assert_array_equal(out, ssao(gbuffer, RADIUS, runtime=runtime))


def test_gbuffer_of_another_size_is_refused(runtime: Runtime) -> None:
    technique = Ssao(runtime, (8, 8))
    with pytest.raises(ValueError, match=r"size and margin are \(16, 16\).*expected \(8, 8\)"):
        technique.run(_uploaded(runtime, wall((16, 16))))


def _uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    device = DeviceGBuffer(runtime, gbuffer.size, margin=gbuffer.margin)
    device.upload(gbuffer)
    return device


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": -1.0}, ValueError, r"radius is -1.0: expected a number > 0.*scene units"),
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0"),
        ({"radius": math.nan}, ValueError, r"radius is nan: expected a number > 0"),
        ({"radius": math.inf}, ValueError, r"radius is inf: expected a number > 0"),
        ({"radius": (0.5, -2.0)}, ValueError, r"radius is -2.0: expected a number > 0"),
        ({"radius": (1, 2, 3, 4, 5)}, ValueError, r"radius has 5 values: expected 1 to 4"),
        ({"radius": ()}, ValueError, r"radius"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected 1 to 4 numbers"),
        ({"radius": None}, TypeError, r"radius is None: expected 1 to 4 numbers"),
        ({"radius": 1j}, TypeError, r"radius is 1j: expected 1 to 4 numbers"),
        ({"samples": 0}, ValueError, r"samples is 0: expected an integer >= 1 and <= 256"),
        ({"samples": 257}, ValueError, r"samples is 257: expected an integer >= 1 and <= 256"),
        ({"samples": 2.5}, TypeError, r"samples is 2.5: expected an integer"),
        ({"falloff": "cubic"}, ValueError, r"falloff is 'cubic': expected one of 'exponential'"),
        ({"falloff": (0.5,)}, ValueError, r"falloff has 1 values.*expected 2 to 4096"),
        ({"falloff": (0.5, 1.5)}, ValueError, r"falloff has 2 values.*in \[0, 1\]"),
        ({"outside": "mirror"}, ValueError, r"outside is 'mirror': expected one of 'unknown'"),
        ({"outside": -1.0}, ValueError, r"outside is -1.0: expected a number > 0"),
        ({"resolution": "third"}, ValueError, r"resolution is 'third': expected one of 'full'"),
        ({"ramp_start": 2.0, "ramp_end": 1.0}, ValueError, r"ramp_end is 1.0: expected more than ramp_start"),
        ({"max_samples": 3}, ValueError, r"max_samples is 3: expected 0 or at least samples, 16"),
        ({"hemisphere": 1}, TypeError, r"hemisphere is 1: expected True or False"),
        ({"blur_radius": 17}, ValueError, r"blur_radius is 17: expected an integer >= 0 and <= 16"),
        ({"bias": -0.1}, ValueError, r"bias is -0.1: expected a number >= 0.*radii"),
        ({"power": math.nan}, ValueError, r"power is nan: expected a number"),
        ({"colour": 1}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        ssao(wall((4, 4)), runtime=runtime, **params)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, r"depth\[1, 2\] is nan: expected numbers >.*scene units.*or \+inf"),
        (-1.0, r"depth\[1, 2\] is -1.0: expected numbers"),
        (0.0, r"depth\[1, 2\] is 0.0: expected numbers > 0"),
        (-math.inf, r"depth\[1, 2\] is -inf: expected numbers"),
    ],
)
def test_bad_depth_is_refused_with_its_pixel_and_range(value: float, message: str) -> None:
    depth = np.ones((4, 5), np.float32)
    depth[1, 2] = value
    with pytest.raises(ValueError, match=message):
        GBuffer(camera=camera(size=(4, 5)), depth=depth)


@pytest.mark.parametrize("dtype", [np.complex64, "U4", object, bool])
def test_array_that_is_not_of_real_numbers_is_refused(dtype: Any) -> None:
    made = camera(size=(4, 5))
    with pytest.raises(TypeError, match=r"depth has dtype .*: expected a real floating-point"):
        GBuffer(camera=made, depth=np.ones((4, 5)).astype(dtype))
    with pytest.raises(TypeError, match=r"normal has dtype .*: expected a real floating-point"):
        GBuffer(camera=made, depth=np.ones((4, 5)), normal=np.ones((4, 5, 3)).astype(dtype))


@pytest.mark.parametrize("shape", [(0, 0), (4,), (5, 4), (4, 6), (2, 5), (1, 4, 5, 1)], ids=str)
def test_depth_of_a_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"depth has .*: expected"):
        GBuffer(camera=camera(size=(4, 5)), depth=np.ones(shape))


def test_normal_of_a_wrong_shape_or_value_is_refused() -> None:
    made = camera(size=(4, 5))
    with pytest.raises(ValueError, match=r"normal has shape \(4, 5, 2\): expected"):
        GBuffer(camera=made, depth=np.ones((4, 5)), normal=np.ones((4, 5, 2)))
    with pytest.raises(ValueError, match=r"normal has shape .*5, 4.*: expected \(4, 5\)"):
        GBuffer(camera=made, depth=np.ones((4, 5)), normal=np.ones((5, 4, 3)))
    with pytest.raises(ValueError, match=r"normal\[0, 0, 0\] is nan: expected numbers"):
        GBuffer(camera=made, depth=np.ones((4, 5)), normal=np.full((4, 5, 3), np.nan))


def test_image_without_pixels_is_refused() -> None:
    with pytest.raises(ValueError, match=r"width is 0: expected an integer >= 1"):
        camera(size=(0, 0))


def test_something_else_than_a_gbuffer_is_refused(runtime: Runtime) -> None:
    with pytest.raises(TypeError, match=r"gbuffer is ndarray: expected GBuffer or DeviceGBuffer"):
        ssao(np.ones((4, 4)), runtime=runtime)  # type: ignore[arg-type]
