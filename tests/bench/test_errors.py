"""Numbers of an error: what counts, and what the truth itself does not know."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.bench.errors import errors_of, on_screen, picture_flip
from ssgi_cl.truth import Truth

SEEN = np.ones((20, 30), np.bool_)
REGIONS = {"creases": SEEN & (np.arange(30) < 10), "elsewhere": SEEN & (np.arange(30) >= 10)}


def truth_of(values: np.ndarray, error: float = 0.0) -> Truth:
    return Truth(values.astype(np.float32), np.full(values.shape, error, np.float32), 2, "")


def test_an_offset_shows_as_bias_and_rmse_where_it_is() -> None:
    truth = np.full((20, 30), 0.5, np.float32)
    image = truth.copy()
    image[:, :10] += 0.25
    found = errors_of(image, truth_of(truth, 0.02), SEEN, REGIONS, light=False)
    assert found["regions"]["creases"] == pytest.approx({"share": 1 / 3, "rmse": 0.25, "bias": 0.25})
    assert found["regions"]["elsewhere"]["rmse"] == 0.0
    assert found["rmse"] == pytest.approx(0.25 / np.sqrt(3.0))
    assert found["bias"] == pytest.approx(0.25 / 3.0)
    assert found["p99"] == pytest.approx(0.25)
    assert found["truth_error"] == pytest.approx(0.02)


def test_pixels_that_the_truth_does_not_know_and_the_sky_do_not_count() -> None:
    truth = np.full((20, 30), 0.5, np.float32)
    image = truth.copy()
    image[:, 20:] = 0.0
    truth[:, 15:] = np.nan
    image[0, :15] += 0.2
    found = errors_of(image, truth_of(truth), SEEN, REGIONS, light=False)
    assert found["bias"] == pytest.approx(0.2 / 20.0)
    assert found["regions"]["elsewhere"]["share"] == pytest.approx(2.0 / 3.0)
    assert found["regions"]["elsewhere"]["bias"] == pytest.approx(0.2 / 20.0)
    seen = SEEN & (np.arange(30) < 15)  # no more does the sky
    even = np.full((20, 30), 0.5, np.float32)
    surfaces = errors_of(np.where(seen, even, np.float32(0.0)), truth_of(even), seen, REGIONS, light=False)
    assert (surfaces["rmse"], surfaces["ssim"]) == (0.0, pytest.approx(1.0))
    # What looks at neighbourhoods can't be told of a picture with holes.
    assert found["ssim"] is None
    assert found["flip"] is None


def test_the_peak_of_light_is_that_of_the_truth() -> None:
    rng = np.random.default_rng(3)
    truth = rng.random((20, 30, 3), np.float32)
    noisy = truth + np.float32(0.01)
    small = errors_of(noisy, truth_of(truth), SEEN, REGIONS, light=True)
    large = errors_of(1e3 * noisy, truth_of(1e3 * truth), SEEN, REGIONS, light=True)
    # PSNR and SSIM are relative to the peak, so that units don't matter (float32 roundings do).
    assert small["psnr"] == pytest.approx(large["psnr"], rel=1e-3)
    assert small["ssim"] == pytest.approx(large["ssim"], rel=1e-3)
    assert 1e3 * small["rmse"] == pytest.approx(large["rmse"], rel=1e-3)


def test_a_black_truth_has_no_relative_error() -> None:
    black = np.zeros((20, 30, 3), np.float32)
    found = errors_of(black, truth_of(black), SEEN, REGIONS, light=True)
    assert found["psnr"] is None
    assert found["ssim"] is None
    assert found["flip"] is None
    assert found["rmse"] == 0.0


def test_flip_of_pictures_grows_with_the_error_and_is_the_same_at_any_exposure(rng: np.random.Generator) -> None:
    pytest.importorskip("flip_evaluator", reason="flip-evaluator is not installed (extra 'truth')")
    image = rng.random((24, 32, 3)).astype(np.float32) + 0.1
    assert picture_flip(image, image) == 0.0
    near, far = (picture_flip(image * np.float32(k), image) for k in (1.1, 2.0))
    assert 0.0 < near < far
    assert picture_flip(64.0 * 1.1 * image, 64.0 * image) == pytest.approx(near, rel=1e-3)
    seen = np.ones((24, 32), np.bool_)
    found = errors_of(1.1 * image, truth_of(image), seen, {"elsewhere": seen}, light=True, picture=True)
    assert found["flip"] == pytest.approx(near, rel=1e-5)
    assert found["mrse"] == pytest.approx(float(np.mean((0.1 * image / (image + 0.01)) ** 2)), rel=1e-3)


def test_mottling_is_that_of_frames_on_smooth_surfaces() -> None:
    pytest.importorskip("scipy", reason="scipy is not installed (extra 'truth')")
    truth = np.full((60, 200, 3), 0.5, np.float32)
    blotched = truth * np.exp(0.1 * np.sin(2.0 * np.pi * np.arange(200) / 25.0))[:, None].astype(np.float32)
    seen, left = np.ones((60, 200), np.bool_), np.arange(200) < 100

    def mottling(image: np.ndarray, of: np.ndarray, **options: Any) -> float | None:
        found: float | None = errors_of(image, truth_of(of), seen, {"elsewhere": seen}, light=True, **options)[
            "mottling"
        ]
        return found

    whole = mottling(blotched, truth, picture=True, smooth=seen)
    assert whole is not None
    # .1 / sqrt 2 times exp(-.5 (2 pi 2 / 25)^2) = .881; Gaussians are cut off at the ends.
    assert whole == pytest.approx(0.0623, rel=0.1)
    half = blotched.copy()
    half[:, 100:] = truth[:, 100:]
    assert mottling(half, truth, picture=True, smooth=seen & left) == pytest.approx(whole, rel=0.1)
    assert mottling(half, truth, picture=True, smooth=seen & ~left) == pytest.approx(0.0, abs=1e-6)
    unknown = np.where(left[:, None], np.float32(np.nan), truth)
    assert mottling(blotched, unknown, picture=True, smooth=seen & left) is None
    assert mottling(blotched, np.where(left[:, None], np.float32(0.0), truth), picture=True, smooth=seen & left) is None
    assert mottling(blotched, truth, picture=True, smooth=seen & False) is None
    assert mottling(blotched, truth) is None


def test_streaks_are_those_of_smooth_surfaces_that_the_truth_knows() -> None:
    pytest.importorskip("scipy", reason="scipy is not installed (extra 'truth')")
    truth = np.full((60, 200), 0.5, np.float32)
    striped = truth + (0.05 * np.sin(2.0 * np.pi * np.arange(200) / 8.0)).astype(np.float32)
    seen, left = np.ones((60, 200), np.bool_), np.arange(200) < 100

    def streaks(of: np.ndarray, smooth: np.ndarray | None, error: float = 0.0) -> float | None:
        regions = {"elsewhere": seen}
        found = errors_of(striped, truth_of(of, error), seen, regions, light=False, smooth=smooth)["streaks"]
        assert found is None or isinstance(found, float)
        return found

    assert streaks(truth, seen) == pytest.approx(0.05 / np.sqrt(2.0), rel=0.02)
    unknown = np.where(left, truth, np.float32(np.nan))
    assert streaks(unknown, seen) == pytest.approx(0.05 / np.sqrt(2.0), rel=0.02)
    assert streaks(unknown, seen & ~left) is None
    assert streaks(truth, None) is None
    # Noise of the truth that would make as much by chance: .05^2 / 2 is 3 e^2 / sqrt(60 x 2956 pairs).
    assert streaks(truth, seen, error=1.0) == 0.0
    assert streaks(truth, seen, error=np.inf) is None


def test_tone_curve_is_the_documented_one() -> None:
    # x e / (1 + x e / 4): 2 at exposure 2 is 4 / 2, clipped; 0.25 at 1 is 0.25 / 1.0625.
    np.testing.assert_allclose(on_screen(np.array([2.0, -1.0, 0.0]), 2.0), [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(on_screen(np.array([0.25]), 1.0), (0.25 / 1.0625) ** (1 / 2.2))
