"""Tone mapping: against its float64 reference, and what a picture must keep."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.filters.tonemap import auto_exposure_reference, encoded_reference
from ssgi_cl.techniques.filters.tonemap import CURVES, MIDDLE_GREY, Tonemap, auto_exposure, tonemap

from ..analytic import check_second_run

HALF_STEP = 0.5 + 1e-3
"""Of 255: values are rounded to whole ones; the power is off by 2e-7, 255 times that is nothing."""


def ramp(low: float, high: float, count: int = 4096) -> NDArray[np.float32]:
    """Return a grey image of one row, from low to high by equal factors."""
    grey = np.geomspace(low, high, count).astype(np.float32)
    return np.repeat(grey[None, :, None], 3, axis=2)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [1e-3, 1.0, 37.5])
def test_every_kernel_variant_agrees_with_reference(
    variant_runtime: Runtime, rng: np.random.Generator, curve: str, exposure: float
) -> None:
    radiance = np.exp(rng.normal(0.0, 4.0, (23, 37, 3))).astype(np.float32)
    image = tonemap(radiance, exposure=exposure, curve=curve, runtime=variant_runtime)
    assert image.dtype == np.uint8
    assert image.shape == radiance.shape
    expected = encoded_reference(radiance, exposure, curve)
    assert np.abs(image - expected).max() <= HALF_STEP


def test_pictures_of_16_bits_agree_with_reference(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    radiance = np.exp(rng.normal(0.0, 4.0, (23, 37, 3))).astype(np.float32)
    image = tonemap(radiance, exposure=1.0, bits=16, runtime=variant_runtime)
    assert image.dtype == np.uint16
    # The power is off by some 1e-6: a tenth of a step of 65535 beside half of one.
    assert np.abs(image - encoded_reference(radiance, 1.0) * 257.0).max() <= 0.6
    with pytest.raises(ValueError, match="bits is 12: expected 8 or 16"):
        tonemap(radiance, bits=12, runtime=variant_runtime)


@pytest.mark.parametrize("curve", CURVES)
def test_brighter_is_never_darker_in_the_picture(variant_runtime: Runtime, curve: str) -> None:
    image = tonemap(ramp(1e-6, 1e6), exposure=1.0, curve=curve, runtime=variant_runtime)
    assert np.all(np.diff(image[0, :, 0].astype(int)) >= 0)
    assert image[0, 0, 0] == 0
    assert image[0, -1, 0] == 255


@pytest.mark.parametrize("curve", CURVES)
def test_black_stays_black_and_the_brightest_is_white(variant_runtime: Runtime, curve: str) -> None:
    radiance = np.array([[[0, 0, 0], [1e6] * 3, [3e38] * 3, [1e-38] * 3]], np.float32)
    image = tonemap(radiance, exposure=1.0, curve=curve, runtime=variant_runtime)
    np.testing.assert_array_equal(image[0, :, 0], [0, 255, 255, 0])


def test_clip_is_the_srgb_encoding(runtime: Runtime) -> None:
    # IEC 61966-2-1: 0.0031308 is where the straight part ends; 0.5 is 188, 0.18 is 118 (117.6).
    grey = np.array([0.0, 0.0031308, 0.18, 0.5, 1.0, 1.0001], np.float32)
    image = tonemap(np.repeat(grey[None, :, None], 3, 2), exposure=1.0, curve="clip", runtime=runtime)
    np.testing.assert_array_equal(image[0, :, 1], [0, 10, 118, 188, 255, 255])


def test_channels_do_not_mix(runtime: Runtime) -> None:
    image = tonemap(np.array([[[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]]]), exposure=1.0, runtime=runtime)
    assert np.all((image[0] > 0) == np.eye(3, dtype=bool))


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 3), (3, 3), (17, 31), (5, 65)], ids=str)
def test_odd_sizes_agree_with_reference_at_automatic_exposure(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    radiance = rng.random((*size, 3), np.float32)
    image = tonemap(radiance, runtime=variant_runtime)
    expected = encoded_reference(radiance, auto_exposure(radiance))
    assert np.abs(image - expected).max() <= HALF_STEP


# ---- automatic exposure


@pytest.mark.parametrize("level", [1e-9, 0.18, 1.0, 1e6])
def test_uniform_grey_is_exposed_to_middle_grey(level: float) -> None:
    radiance = np.full((7, 9, 3), level, np.float32)
    # The level itself rounds by 2^-24 in float32.
    assert math.isclose(auto_exposure(radiance) * level, MIDDLE_GREY, rel_tol=1e-6)


def test_automatic_exposure_is_that_of_all_pixels(rng: np.random.Generator) -> None:
    radiance = np.exp(rng.normal(0.0, 1.0, (240, 320, 3))).astype(np.float32)
    # Every ninth pixel counts: the mean of 8560 logs of deviation 0.7 is off by 0.008.
    assert math.isclose(auto_exposure(radiance), auto_exposure_reference(radiance), rel_tol=4 * 0.008)
    # Of the picture of which it takes all pixels there is no such error, at any contrast.
    for deviation in (0.3, 1.5, 5.0):
        some = np.exp(rng.normal(0.0, deviation, (80, 100, 3))).astype(np.float32)
        assert math.isclose(
            auto_exposure(np.repeat(np.repeat(some, 3, 0), 3, 1)), auto_exposure_reference(some), rel_tol=1e-9
        )


def test_black_pixels_do_not_count_in_the_exposure() -> None:
    radiance = np.zeros((30, 30, 3), np.float32)
    assert auto_exposure(radiance) == 1.0
    radiance[:, ::2] = 2.0
    # Grey cards reflect 18 %.
    assert math.isclose(auto_exposure(radiance), 0.09, rel_tol=1e-9)


def grey(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return a picture of 300 x 300 pixels in which these values of grey are spread evenly."""
    rng = np.random.default_rng(1)
    return np.repeat(rng.permutation(np.resize(values, 300 * 300)).reshape(300, 300, 1), 3, 2).astype(np.float32)


def white(radiance: NDArray[np.float32], exposure: float) -> float:
    """Return the share of the pixels that the filmic curve makes 250 or more."""
    return float(np.mean(encoded_reference(radiance[..., 0], exposure) >= 250.0))


def test_small_lights_in_the_dark_are_not_white() -> None:
    # All but dark are 69 % of the pixels, the rest decreases with the distance from two lights: by its log-average
    # the picture would have an exposure of 175, and 30 % of it would be white.
    near = np.geomspace(1.0, 0.03, 3100)
    radiance = grey(np.concatenate([near, np.geomspace(2e-4, 5e-5, 6900)]))
    old = 0.18 / float(np.exp(np.log(radiance.astype(np.float64)).mean()))
    assert white(radiance, old) > 0.25
    found = auto_exposure(radiance)
    assert white(radiance, found) <= 0.05
    # Nor is it dim: what is lit best, 5 % of it, is in the brightest tenth of the scale.
    assert found * float(np.quantile(radiance, 0.95)) == pytest.approx(2.5, rel=0.02)


@pytest.mark.parametrize("lit", [0.02, 0.2, 0.4, 0.66, 0.9])
def test_what_a_sun_lights_alone_is_no_sheet_of_white(lit: float) -> None:
    radiance = grey(np.where(np.arange(10000) < 10000 * lit, 1.0, 1e-7))
    found = auto_exposure(radiance)
    assert white(radiance, found) <= 0.05
    # 2 % of a picture are no highlight: they may be white, and the rest is seen.
    assert found == pytest.approx(MIDDLE_GREY / 1e-7, rel=0.01) if lit == 0.02 else found <= 2.5


def test_a_glaring_light_does_not_darken_the_rest() -> None:
    radiance = np.full((300, 300, 3), 0.3, np.float32)
    radiance[:40, :40] = 1e6  # 1.8 % of the pixels
    assert auto_exposure(radiance) == pytest.approx(MIDDLE_GREY / 0.3, rel=1e-6)


@pytest.mark.parametrize("power", [2.0, 1e-6, 1e6])
def test_exposure_is_inverse_to_the_power_of_all_light(rng: np.random.Generator, power: float) -> None:
    for deviation in (0.5, 2.0, 6.0):  # the last has 5 % of white
        radiance = np.exp(rng.normal(0.0, deviation, (90, 90, 3))).astype(np.float32)
        # float32 rounds the scaled light.
        assert power * auto_exposure(np.float32(power) * radiance) == pytest.approx(auto_exposure(radiance), rel=1e-6)


def test_a_single_lit_pixel_is_middle_grey() -> None:
    radiance = np.zeros((31, 31, 3), np.float32)
    radiance[3, 3] = 40.0
    assert auto_exposure(radiance) == pytest.approx(MIDDLE_GREY / 40.0, rel=1e-6)
    assert auto_exposure(np.zeros((0, 5, 3), np.float32)) == 1.0


@pytest.mark.parametrize("columns", [1, 2, 3, 4])
def test_automatic_exposure_of_narrow_images_takes_channels_for_channels(columns: int) -> None:
    radiance = np.zeros((3, columns, 3), np.float32)
    radiance[...] = [1.0, 0.0, 0.0]
    # As the renderer passes it, too: channels first in memory.
    first = np.moveaxis(np.ascontiguousarray(np.moveaxis(radiance, -1, 0)), 0, -1)
    for image in (radiance, first):
        assert math.isclose(auto_exposure(image), MIDDLE_GREY / 0.2126, rel_tol=1e-9)


def test_exposure_scales_what_is_seen(runtime: Runtime, rng: np.random.Generator) -> None:
    radiance = rng.random((9, 20, 3), np.float32)
    np.testing.assert_array_equal(
        tonemap(radiance, exposure=4.0, runtime=runtime), tonemap(4.0 * radiance, exposure=1.0, runtime=runtime)
    )


@pytest.mark.parametrize("exposure", [1e-300, 1e30, 1e300])
def test_absurd_exposure_gives_black_or_white(runtime: Runtime, exposure: float) -> None:
    image = tonemap(np.array([[[0.0] * 3, [1.0] * 3]]), exposure=exposure, runtime=runtime)
    np.testing.assert_array_equal(image[0, :, 0], [0, 0 if exposure < 1 else 255])


# ---- prepared, bad input


def test_second_run_allocates_and_builds_nothing(variant_runtime: Runtime) -> None:
    plane = variant_runtime.plane(3, (9, 20), 0.5)
    technique = Tonemap(variant_runtime, (9, 20))
    check_second_run(variant_runtime, lambda: technique.run(plane, exposure=1.0))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"radiance": np.full((2, 2, 3), np.nan)}, ValueError, r"radiance\[0, 0, 0\] is nan"),
        ({"radiance": np.full((2, 2, 3), np.inf)}, ValueError, r"radiance\[0, 0, 0\] is inf"),
        ({"radiance": -np.ones((2, 2, 3))}, ValueError, r"radiance\[0, 0, 0\] is -1.*W m\^-2"),
        ({"radiance": np.ones((2, 2))}, ValueError, r"radiance has shape \(2, 2\): expected"),
        ({"radiance": np.ones((2, 2, 4))}, ValueError, r"radiance has shape \(2, 2, 4\)"),
        ({"radiance": np.ones((0, 2, 3))}, ValueError, r"at least one pixel"),
        ({"radiance": "bright"}, TypeError, r"radiance has dtype"),
        ({"radiance": np.ones((2, 2, 3), complex)}, TypeError, r"radiance has dtype complex"),
        ({"exposure": 0.0}, ValueError, r"exposure is 0.0: expected a number > 0"),
        ({"exposure": -1.0}, ValueError, r"exposure is -1.0: expected a number > 0"),
        ({"exposure": math.nan}, ValueError, r"exposure is nan"),
        ({"exposure": math.inf}, ValueError, r"exposure is inf"),
        ({"exposure": "auto"}, TypeError, r"exposure is 'auto': expected a number"),
        ({"curve": "aces"}, ValueError, r"curve is 'aces': expected one of 'clip', 'filmic'"),
        ({"curve": None}, ValueError, r"curve is None: expected one of 'clip', 'filmic'"),
    ],
    ids=str,
)
def test_bad_argument_is_refused_with_its_name_and_what_is_allowed(
    runtime: Runtime, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    given: dict[str, Any] = {"radiance": np.ones((2, 2, 3)), **arguments}
    with pytest.raises(error, match=message):
        tonemap(given.pop("radiance"), runtime=runtime, **given)
