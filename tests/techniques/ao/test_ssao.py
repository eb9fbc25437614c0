"""SSAO: against formulas, and its own parameters. Tests of all techniques: test_occlusion.py."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, reflected_points, ssao

from ..analytic import SCENES, share_off, slow_but, tilted, trace, uploaded, view_of
from .subjects import FLIPS, RADIUS, ROUNDING, SUBJECTS, WEIGHTS


def wall(size: tuple[int, int], depth: float = 5.0) -> GBuffer:
    """Return a wall that faces an orthographic camera; a pixel covers 0.1 scene units."""
    made = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=0.1 * size[0], width=size[1], height=size[0])
    return trace(made, [tilted(made, 0.0, distance=depth)])


PIXEL = 0.1
"""Scene units that a pixel of `wall` covers."""


# ---- against the numpy reference


MARGINS = ((1, 2), (3, 3), (2, 7), (0, 5))


@pytest.mark.parametrize(
    ("name", "size", "margin"),
    [*((name, (47, 61), (0, 0)) for name in SCENES), *(("bumpy", (20, 28), margin) for margin in MARGINS)],
    ids=str,
)
@pytest.mark.parametrize("resolution", slow_but(("full", "half", "quarter"), "half", "quarter"))
def test_blurred_result_agrees_with_numpy_reference_at_every_resolution(
    variant_runtime: Runtime, name: str, size: tuple[int, int], margin: tuple[int, int], resolution: str
) -> None:
    gbuffer = view_of(name, size=size, margin=margin)
    a = ssao(gbuffer, RADIUS, resolution=resolution, runtime=variant_runtime)
    # A flip spreads over the 9 x 9 pixels of the blur, with little weight over the outer ones, and over those of a
    # coarse pixel.
    assert share_off(a, SUBJECTS["ssao"].expected(gbuffer, resolution=resolution), WEIGHTS) <= 25 * FLIPS


# ---- formulas


def occlusion_by_formula(params: SsaoParams, row: int, column: int, weight: Any) -> NDArray[np.float64]:
    """Return A of a pixel of `wall` by definition: a point s lies s_z radii in front of it."""
    points = reflected_points(params.samples, params.length_power)[row % 8, column % 8]
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
    a = Ssao(runtime, (16, 16), params)(uploaded(runtime, wall((16, 16))))
    wanted = [[occlusion_by_formula(params, y, x, weight) for x in range(6, 10)] for y in range(6, 10)]
    # Depths of 5 are rounded to 2^-22, which is 6e-7 radii; the steepest falloff is 4.4 a radius.
    np.testing.assert_allclose(a[6:10, 6:10], wanted, rtol=0, atol=5e-6)


@pytest.mark.parametrize("contrast", [0.3, 2.5, 10.0])
def test_contrast_raises_the_result_to_its_power_and_leaves_the_open_open(
    variant_runtime: Runtime, contrast: float
) -> None:
    gbuffer = view_of("bumpy", size=(31, 39))
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
    a = Ssao(runtime, (8, 8), params)(uploaded(runtime, wall((8, 8))))
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


def test_of_several_radii_the_greatest_occlusion_counts(runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    radii = (0.15, 0.5, 2.0)
    single = [ssao(gbuffer, r, blur_radius=0, runtime=runtime) for r in radii]
    together = ssao(gbuffer, radii, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(together, np.min(single, axis=0))


# ---- limits near the camera


@pytest.mark.parametrize(
    ("factor", "count"), [(0.5, 16), pytest.param(24.5 / 16, 24, marks=pytest.mark.slow), (5.0, 40)]
)
def test_samples_grow_with_the_projected_radius_up_to_the_most(runtime: Runtime, factor: float, count: int) -> None:
    gbuffer = view_of("bumpy", "orthographic")
    near_px = RADIUS * gbuffer.camera.height / 4.0 / factor
    a = ssao(gbuffer, RADIUS, near_px=near_px, max_samples=40, blur_radius=0, runtime=runtime)
    b = ssao(gbuffer, RADIUS, count, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(a, b)  # the same points in the same order


# ---- what must not matter


@pytest.mark.parametrize(("resolution", "bound"), [("half", 0.033), ("quarter", 0.061)])
def test_reduced_resolution_is_close_to_the_full_one(runtime: Runtime, resolution: str, bound: float) -> None:
    gbuffer = view_of("corner", size=(121, 161))
    full = ssao(gbuffer, RADIUS, blur_radius=2, runtime=runtime)
    a = ssao(gbuffer, RADIUS, resolution=resolution, blur_radius=2, runtime=runtime)
    # The blur covers 2 and 4 times the length, and creases are that much wider. Measured: RMSE 0.028
    # and 0.059, shifted by a pixel 0.036 and 0.063.
    assert math.sqrt(np.mean((a - full) ** 2)) < bound


@pytest.mark.parametrize("length", [1e-30, 1e-3, 3.7, 1e30])
def test_length_of_given_normals_does_not_matter(runtime: Runtime, length: float) -> None:
    gbuffer = view_of("bumpy")
    normal = np.asarray(gbuffer.normal) * np.float32(length)
    scaled = GBuffer(camera=gbuffer.camera, depth=gbuffer.depth, normal=normal)
    a = ssao(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    b = ssao(scaled, RADIUS, blur_radius=0, runtime=runtime)
    # A normal's components round by 2^-24, so that a sample may change sides.
    assert share_off(a, b, ROUNDING) <= FLIPS


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"radius": (0.5, -2.0)}, ValueError, r"radius is -2.0: expected a number > 0"),
        ({"radius": (1, 2, 3, 4, 5)}, ValueError, r"radius has 5 values: expected 1 to 4"),
        ({"radius": ()}, ValueError, r"radius"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected 1 to 4 numbers"),
        ({"radius": 1j}, TypeError, r"radius is 1j: expected 1 to 4 numbers"),
        ({"samples": 0}, ValueError, r"samples is 0: expected an integer >= 1 and <= 256"),
        ({"samples": 257}, ValueError, r"samples is 257: expected an integer >= 1 and <= 256"),
        ({"samples": 2.5}, TypeError, r"samples is 2.5: expected an integer"),
        ({"falloff": "cubic"}, ValueError, r"falloff is 'cubic': expected one of 'exponential'"),
        ({"falloff": (0.5,)}, ValueError, r"falloff has 1 values.*expected 2 to 4096"),
        ({"falloff": (0.5, 1.5)}, ValueError, r"falloff has 2 values.*in \[0, 1\]"),
        ({"outside": "mirror"}, ValueError, r"outside is 'mirror': expected one of 'unknown'"),
        ({"outside": -1.0}, ValueError, r"outside is -1.0: expected a number > 0"),
        ({"ramp_start": 2.0, "ramp_end": 1.0}, ValueError, r"ramp_end is 1.0: expected more than ramp_start"),
        ({"max_samples": 3}, ValueError, r"max_samples is 3: expected 0 or at least samples, 16"),
        ({"hemisphere": 1}, TypeError, r"hemisphere is 1: expected True or False"),
        ({"power": math.nan}, ValueError, r"power is nan: expected a number"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        ssao(wall((4, 4)), runtime=runtime, **params)
