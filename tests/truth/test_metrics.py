"""Metrics: hand values, invariances, masks, bad input."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.truth import metrics

Metric = Callable[..., float]

PLAIN: tuple[Metric, ...] = (metrics.rmse, metrics.bias, metrics.p99, metrics.psnr, metrics.mrse, metrics.ssim)
FLIPS: tuple[Metric, ...] = (metrics.flip, metrics.hdr_flip)
BEST = {metrics.psnr: math.inf, metrics.ssim: 1.0}


def called(metric: Metric, *arguments: Any, **named: Any) -> float:
    """Call a metric; skip where FLIP's package is missing."""
    if metric in FLIPS:
        pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
    return metric(*arguments, **named)


# ---- hand values


def test_rmse_bias_and_mrse_of_two_pixels_are_those_computed_by_hand() -> None:
    image, truth = [[0.5, 0.1]], [[0.2, 0.5]]  # differences 0.3 and -0.4
    assert metrics.rmse(image, truth) == pytest.approx(math.sqrt(0.125), rel=1e-12)
    assert metrics.bias(image, truth) == pytest.approx(-0.05, rel=1e-12)
    expected = 0.5 * ((0.3 / 0.21) ** 2 + (0.4 / 0.51) ** 2)
    assert metrics.mrse(image, truth) == pytest.approx(expected, rel=1e-12)


def test_p99_is_exceeded_by_one_in_a_hundred() -> None:
    image = np.arange(-50, 51)[None, :] / 100.0  # absolute: 0, then each of 0.01 to 0.5 twice
    # The 100th of 101 sorted values.
    assert metrics.p99(image, np.zeros((1, 101))) == pytest.approx(0.5, rel=1e-12)
    image[0, :2] = image[0, -2:] = 0.0  # 0.49 was the second largest
    assert metrics.p99(image, np.zeros((1, 101))) == pytest.approx(0.48, rel=1e-12)


def test_psnr_of_a_tenth_of_the_peak_is_20_db() -> None:
    truth = np.full((4, 5), 2.0)
    assert metrics.psnr(truth + 0.1, truth) == pytest.approx(20.0, rel=1e-9)
    assert metrics.psnr(truth + 0.1, truth, peak=10.0) == pytest.approx(40.0, rel=1e-9)


def test_ssim_in_the_middle_of_a_window_is_that_computed_by_hand(rng: np.random.Generator) -> None:
    image, truth = rng.random((11, 11)), rng.random((11, 11))
    mask = np.ones((11, 11), np.bool_)
    offset = np.arange(-5, 6)
    weight = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * 1.5**2))
    total = np.zeros((11, 11))
    for row in range(11):
        for column in range(11):  # the window that is cut off at the rim
            shifted = np.zeros((11, 11))
            for r in range(11):
                for c in range(11):
                    dr, dc = r - row, c - column
                    if abs(dr) <= 5 and abs(dc) <= 5:
                        shifted[r, c] = weight[5 + dr, 5 + dc]
            w = shifted / shifted.sum()
            x, y = (w * image).sum(), (w * truth).sum()
            xx, yy = (w * (image - x) ** 2).sum(), (w * (truth - y) ** 2).sum()
            xy = (w * (image - x) * (truth - y)).sum()
            total[row, column] = ((2 * x * y + 1e-4) * (2 * xy + 9e-4)) / ((x * x + y * y + 1e-4) * (xx + yy + 9e-4))
    # Float64, another order of sums.
    assert metrics.ssim(image, truth, mask) == pytest.approx(total.mean(), rel=1e-10)


def test_flip_of_black_and_white_is_far_and_of_a_trace_is_near() -> None:
    black, white = np.zeros((32, 32)), np.ones((32, 32))
    assert called(metrics.flip, white, black) > 0.9
    assert 0.0 < called(metrics.flip, black + 0.002, black) < 0.1


def test_flip_takes_linear_light() -> None:
    package = pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed")
    truth, image = np.full((32, 32, 3), 0.2, np.float32), np.full((32, 32, 3), 0.3, np.float32)

    def encoded(linear: Any) -> Any:
        return (1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)

    _, expected, _ = package.evaluate(encoded(truth), encoded(image), "LDR", applyMagma=False)
    # The package converts back, in float32.
    assert metrics.flip(image, truth) == pytest.approx(expected, rel=1e-3)


def test_hdr_flip_sees_a_difference_beyond_1() -> None:
    truth = np.full((32, 32), 0.5)
    truth[:, 16:] = 20.0
    image = truth.copy()
    image[:, 16:] = 10.0
    assert called(metrics.hdr_flip, image, truth) > 0.05
    assert called(metrics.flip, image, truth) == pytest.approx(0.0, abs=1e-6)  # both are clipped


# ---- for all of them


@pytest.mark.parametrize("metric", PLAIN + FLIPS, ids=lambda m: m.__name__)
@pytest.mark.parametrize("channels", [(), (3,)])
def test_image_is_perfect_against_itself(metric: Metric, channels: tuple[int, ...], rng: np.random.Generator) -> None:
    image = rng.random((20, 24, *channels)).astype(np.float32)
    # FLIP computes in float32.
    assert called(metric, image, image) == pytest.approx(BEST.get(metric, 0.0), abs=1e-6)


@pytest.mark.parametrize("metric", PLAIN + FLIPS, ids=lambda m: m.__name__)
def test_pixels_outside_the_mask_have_no_say(metric: Metric, rng: np.random.Generator) -> None:
    truth = rng.random((24, 30))
    image = np.clip(truth + 0.1 * rng.standard_normal(truth.shape), 0.0, 1.0)
    mask = np.ones(truth.shape, np.bool_)
    mask[:, 20:] = False
    first = called(metric, image, truth, mask)
    for junk in (math.nan, math.inf, -7.0, 1e30):
        image[:, 20:], truth[:, 20:] = junk, 0.5 * junk
        assert called(metric, image, truth, mask) == first


@pytest.mark.parametrize("metric", PLAIN, ids=lambda m: m.__name__)
def test_mask_is_the_same_as_cutting_the_rest_off(metric: Metric, rng: np.random.Generator) -> None:
    truth, image = rng.random((24, 30, 3)), rng.random((24, 30, 3))
    mask = np.zeros((24, 30), np.bool_)
    mask[3:9, 5:25] = True
    cut = (slice(3, 9), slice(5, 25))
    assert metric(image, truth, mask) == pytest.approx(metric(image[cut], truth[cut]), rel=1e-12)


# ---- bad input


@pytest.mark.parametrize("metric", PLAIN + FLIPS, ids=lambda m: m.__name__)
def test_bad_images_are_refused_by_name(metric: Metric) -> None:
    good = np.ones((4, 6))
    with pytest.raises(ValueError, match=r"image has shape \(4, 5\): expected \(4, 6\) as the tru"):
        metric(np.ones((4, 5)), good)
    with pytest.raises(ValueError, match=r"image has shape \(4,\): expected \(rows, columns\)"):
        metric(np.ones(4), good)
    with pytest.raises(TypeError, match="truth has dtype bool"):
        metric(good, good > 0)
    with pytest.raises(ValueError, match=r"mask has shape \(4, 5\): expected \(4, 6\)"):
        metric(good, good, np.ones((4, 5), np.bool_))
    with pytest.raises(TypeError, match="mask has dtype float64: expected bool"):
        metric(good, good, good)
    with pytest.raises(ValueError, match="mask is False everywhere"):
        metric(good, good, np.zeros((4, 6), np.bool_))
    bad = good.copy()
    bad[2, 3] = math.nan
    with pytest.raises(ValueError, match=r"truth\[2, 3\] is \[nan\]: expected finite numbers"):
        metric(good, bad)


def test_negative_light_is_refused_where_it_means_nothing() -> None:
    with pytest.raises(ValueError, match="truth holds -1"):
        metrics.mrse(np.ones((2, 2)), -np.ones((2, 2)))
    with pytest.raises(ValueError, match="negative radiance"):
        metrics.hdr_flip(-np.ones((2, 2)), np.ones((2, 2)))
    with pytest.raises(ValueError, match="truth is black"):
        metrics.hdr_flip(np.ones((2, 2)), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="peak is 0"):
        metrics.psnr(np.ones((2, 2)), np.ones((2, 2)), peak=0)


@pytest.mark.parametrize("metric", FLIPS, ids=lambda m: m.__name__)
def test_missing_package_names_the_extra(metric: Metric, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[truth\]"):
        metric(np.ones((8, 8)), np.ones((8, 8)))


# ---- mottling


def wave(length: float, amplitude: float) -> Any:
    """Return light with a relative error of this amplitude along its columns, and the light without."""
    light = np.exp(0.5 * np.sin(np.arange(48)[:, None] / 9.0)) * np.ones((48, 1500))
    error = amplitude * np.sin(2.0 * np.pi * np.arange(1500) / length)
    return light * np.exp(error), light


@pytest.mark.parametrize(("length", "tolerance"), [(6.0, 0.03), (11.0, 0.02), (30.0, 0.02), (107.0, 0.05)])
def test_mottling_of_a_wave_is_its_amplitude_times_the_gain_of_the_band(length: float, tolerance: float) -> None:
    image, truth = wave(length, 0.05)
    narrow, wide = (math.exp(-0.5 * (2.0 * math.pi * width / length) ** 2) for width in (2.0, 20.0))
    gain = narrow - wide
    # 1 % of the mean is added, of which the darkest rows have .6: that takes up to 1.6 %. At both ends, 60 of
    # 1500 columns, Gaussians are cut off; the wider the wave, the more that changes.
    everywhere = np.ones(truth.shape, np.bool_)
    found = metrics.mottling(image, truth, everywhere)
    assert found == pytest.approx(gain * 0.05 / math.sqrt(2.0), rel=tolerance)
    # Grey in three channels of float32 is the same light.
    colored = np.stack([image] * 3, axis=-1).astype(np.float32)
    assert metrics.mottling(colored, np.stack([truth] * 3, axis=-1), everywhere) == pytest.approx(found, rel=1e-4)


def test_noise_of_single_pixels_and_light_that_is_too_bright_all_over_are_no_mottling(rng: np.random.Generator) -> None:
    _, truth = wave(30.0, 0.0)
    everywhere = np.ones(truth.shape, np.bool_)
    assert metrics.mottling(truth, truth, everywhere) == 0.0
    # Twice the light; 1 % of the mean is added to both, and rows differ by a factor of 2.7.
    assert metrics.mottling(2.0 * truth, truth, everywhere) < 2e-3
    noisy = truth * np.maximum(1.0 + 0.1 * rng.standard_normal(truth.shape), 0.0)
    # A Gaussian of 2 pixels leaves 1 / (2 sqrt(pi) 2) = 7 % of it, of which the wider one takes 1 %.
    assert metrics.mottling(noisy, truth, everywhere) == pytest.approx(0.1 / (4.0 * math.sqrt(math.pi)), rel=0.05)


def test_surfaces_that_differ_in_brightness_alone_are_no_mottling() -> None:
    _, truth = wave(30.0, 0.0)
    image = truth.copy()
    image[:, 700:] *= 1.3
    apart = np.ones(truth.shape, np.bool_)
    apart[:, 697:703] = False
    assert metrics.mottling(image, truth, apart) < 1e-3
    assert metrics.mottling(image, truth, np.ones_like(apart)) > 0.01  # on one surface it is a step


def test_what_is_no_smooth_surface_has_no_part_in_mottling(rng: np.random.Generator) -> None:
    image, truth = wave(30.0, 0.1)
    smooth = np.ones(truth.shape, np.bool_)
    smooth[:, 400:600] = False
    found = metrics.mottling(image, truth, smooth)
    image[:, 400:600], truth[:, 400:600] = math.nan, math.inf
    assert metrics.mottling(image, truth, smooth) == found
    with pytest.raises(ValueError, match="truth is black where smooth is True"):
        metrics.mottling(image, np.zeros_like(truth), smooth)
    with pytest.raises(ValueError, match="image has a luminance of -"):
        metrics.mottling(-image, np.nan_to_num(truth), smooth)


# ---- streaks


EVERYWHERE = np.ones((300, 400), np.bool_)
GREY = np.full((300, 400), 0.5)


def streaks(error: np.ndarray, smooth: np.ndarray = EVERYWHERE, noise: float = 0.0) -> float:
    return metrics.streaks(GREY + error, GREY, smooth, noise=noise)


@pytest.mark.parametrize("direction", [(0, 1), (1, 0), (1, 1), (1, -1)], ids=str)
@pytest.mark.parametrize(("length", "tolerance"), [(4, 0.02), (8, 0.02), (20, 0.1), (43, 0.1)])
def test_streaks_of_stripes_are_their_amplitude(length: int, tolerance: float, direction: tuple[int, int]) -> None:
    rows, columns = np.mgrid[:300, :400]
    phase = 2.0 * np.pi * (direction[0] * rows + direction[1] * columns) / length
    # Stripes of 20 and 43 pixels are alike in part across, up to a tenth; diagonals are sqrt 2 shorter from one to the
    # next.
    across = length / math.hypot(*direction)
    left = 1.0 - math.exp(-32.0 * (2.0 * math.pi / across) ** 2)
    assert streaks(0.02 * np.sin(phase)) == pytest.approx(left * 0.02 / math.sqrt(2.0), rel=tolerance)


@pytest.mark.parametrize("period", [4, 8])
def test_streaks_of_a_pattern_that_repeats_are_its_standard_deviation(period: int, rng: np.random.Generator) -> None:
    pattern = rng.standard_normal((period, period))
    pattern -= pattern.mean(axis=0)  # no stripes
    pattern -= pattern.mean(axis=1, keepdims=True)
    tiled = np.tile(pattern, (-(-300 // period), 400 // period))[:300]
    # The Gaussian mean of 8 pixels is cut off at the border.
    assert streaks(0.02 * tiled) == pytest.approx(0.02 * tiled.std(), rel=0.02)


def test_stripes_under_noise_are_found(rng: np.random.Generator) -> None:
    stripes = 0.01 * np.sin(2.0 * np.pi * np.arange(400) / 8.0)
    noisy = stripes + 0.05 * rng.standard_normal((300, 400))
    # C of noise varies by .05^2 / sqrt(16 x 113,000 pairs) = 1.9e-6, of 5e-5.
    assert streaks(noisy) == pytest.approx(0.01 / math.sqrt(2.0), rel=0.08)


def test_noise_blotches_and_slow_errors_are_no_streaks(rng: np.random.Generator) -> None:
    from scipy.ndimage import gaussian_filter, uniform_filter

    white = rng.standard_normal((300, 400))
    # Of a period of 8 pixels C is a mean of 226,000 pairs: it varies by 1 / 475, whose root is .046.
    assert streaks(0.02 * white) < 0.08 * 0.02
    blurred = uniform_filter(white, 5)
    assert streaks(blurred) < 0.1 * blurred.std()
    blotches = gaussian_filter(white, 6.0)  # of which few fit in: alike along a line by chance
    assert streaks(blotches) < 0.35 * blotches.std()
    rows, columns = np.mgrid[:300, :400]
    assert streaks(0.2 * (columns / 400.0) ** 2) < 2e-3
    assert streaks(0.2 + 0.0 * rows) < 1e-9


def test_chance_of_the_truths_noise_does_not_count(rng: np.random.Generator) -> None:
    shown = []
    for _ in range(12):
        noisy = 0.02 * rng.standard_normal((300, 400))
        assert streaks(noisy, noise=0.02) <= streaks(noisy)
        shown.append(streaks(noisy, noise=0.02))
    # Eight numbers of which each passes three deviations one time in 700; periods have fewer pairs.
    assert np.count_nonzero(shown) <= 2
    stripes = 0.02 * np.sin(2.0 * np.pi * np.arange(400) / 8.0) + 0.0 * GREY
    assert streaks(stripes, noise=0.02) == pytest.approx(streaks(stripes), rel=0.01)
    with pytest.raises(ValueError, match="noise is -1"):
        streaks(stripes, noise=-1.0)


def test_streaks_are_those_of_each_smooth_surface(rng: np.random.Generator) -> None:
    error = 0.02 * np.sin(2.0 * np.pi * np.arange(400) / 8.0) + 0.0 * GREY
    left = np.arange(400) < 200
    smooth = EVERYWHERE & (np.abs(np.arange(400) - 200) > 3)
    half = np.where(left, error, 0.0)
    assert streaks(half, smooth & left) == pytest.approx(streaks(error), rel=0.01)
    assert streaks(half, smooth & ~left) < 1e-9
    assert streaks(half, smooth) == pytest.approx(streaks(error) / math.sqrt(2.0), rel=0.05)
    # A step from one surface to the next is no structure, and what is no surface has no part.
    assert streaks(0.3 * left + 0.0 * GREY, smooth) < 1e-9
    broken = np.where(smooth, error, np.nan)
    assert streaks(broken, smooth) == pytest.approx(streaks(error, smooth))
    # A surface too small for two pixels that far apart has none.
    assert streaks(error, EVERYWHERE & (np.arange(400) < 7) & (np.arange(300) < 7)[:, None]) == 0.0
    grey = np.stack([GREY] * 3, axis=-1)
    assert metrics.streaks(grey + error[..., None], grey, EVERYWHERE) == pytest.approx(streaks(error), rel=1e-6)
