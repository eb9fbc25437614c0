"""Same-assumption truth of SSAO: what the kernel tends to, and its keeping."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import ssgi_cl.reference.ao.ssao as model
import ssgi_cl.truth.store as store
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.reference.patterns import reflected_points
from ssgi_cl.techniques.ao.ssao import SsaoParams, sample_points, ssao
from ssgi_cl.truth import assumption

from ..techniques.analytic import camera, scene, slow_but

RADIUS = 0.6


def corner(name: str = "corner", size: tuple[int, int] = (24, 30)) -> GBuffer:
    return scene(name, camera(size=size), np.random.default_rng(20))


def rms(values: ArrayLike) -> float:
    return math.sqrt(float(np.mean(np.asarray(values, np.float64) ** 2)))


VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "ball, exponential": {"hemisphere": False, "falloff": "exponential", "falloff_rate": 2.0, "outside": "open"},
    "values": {"falloff": (1.0, 0.6, 0.5, 0.0), "falloff_end": 0.8, "outside": 3.0},
    "limited radius": {"max_radius_px": 9.0, "bias": 0.1, "length_power": 1 / 3},
    "contrast": {"contrast": 2.5},
}


@pytest.mark.parametrize("variant", slow_but(VARIANTS, "default"))
def test_kernel_converges_to_it_with_more_samples(runtime: Runtime, variant: str) -> None:
    gbuffer = corner("bumpy")
    params = {"radius": RADIUS, **VARIANTS[variant]}
    truth = assumption.ssao(gbuffer, SsaoParams(**params), 1024)
    # Each number of samples is a program of its own: the slow tests take all steps.
    counts = (4, 256) if variant == "default" or "falloff" in params else (4, 16, 64, 256)
    off = [ssao(gbuffer, samples=samples, blur_radius=0, runtime=runtime, **params) - truth.mean for samples in counts]
    # Points at random would halve the error at each step, to an eighth in all; these are spread
    # better. Measured: 0.33 to 0.63, and 0.10 in all.
    for few, many in pairwise(off):
        assert rms(many) < 0.75 * rms(few)
    assert rms(many) < 0.125 * rms(off[0])
    # A tile of 16 pixels takes 16 times as many points, so that the mean is off by no more than
    # the truth is, which is a half to a third of what the kernel is (measured).
    assert abs(float(many.mean())) < rms(truth.error) < 0.6 * rms(many)


def test_stated_error_is_about_the_actual_error() -> None:
    gbuffer = corner("bumpy", size=(12, 15))
    best = assumption.ssao(gbuffer, SsaoParams(radius=RADIUS), 2048)
    truth = assumption.ssao(gbuffer, SsaoParams(radius=RADIUS), 512)
    # All pixels take the same points, so that the ratio itself is known to about a third only.
    assert 0.5 < rms(truth.mean - best.mean) / rms(truth.error) < 1.5
    assert rms(best.error) < 0.6 * rms(truth.error)


def test_explicit_points_of_a_tile_pixel_give_what_the_reference_gives_there() -> None:
    gbuffer = corner()
    view, params = SurfaceView.of(gbuffer), SsaoParams(radius=RADIUS, samples=12)
    numpy_reference = model.visibility(view, params)
    for row, column in ((0, 0), (2, 5)):
        points = reflected_points(12, params.length_power)[row, column]
        a = model.visibility(view, params, points)
        np.testing.assert_array_equal(a[row::8, column::8], numpy_reference[row::8, column::8])


def test_passes_are_stretches_of_one_list() -> None:
    gbuffer = corner(size=(9, 11))
    params = SsaoParams(radius=RADIUS, outside="open")
    truth = assumption.ssao(gbuffer, params, 512)
    points = sample_points(512, params.length_power)
    # Every point counts (what is outside is open), so that the mean of passes is that of all.
    expected = model.visibility(SurfaceView.of(gbuffer), params, points)
    np.testing.assert_allclose(truth.mean, expected, atol=1e-7)  # a rounding of float32
    assert truth.passes == 512 // assumption.PASS_POINTS


def test_greatest_occlusion_of_several_radii_counts() -> None:
    gbuffer = corner(size=(9, 11))
    radii = (0.2, 0.6, 1.5)
    truth = assumption.ssao(gbuffer, SsaoParams(radius=radii), 256)
    single = [assumption.ssao(gbuffer, SsaoParams(radius=r), 256) for r in radii]
    np.testing.assert_array_equal(truth.mean, np.min([t.mean for t in single], axis=0))
    chosen = np.argmin([t.mean for t in single], axis=0)
    for index, one in enumerate(single):
        where = chosen == index
        np.testing.assert_array_equal(truth.error[where], one.error[where])
    assert truth.key not in {one.key for one in single}


def test_nothing_is_open() -> None:
    made = camera(size=(5, 6))
    empty = GBuffer(camera=made, depth=np.full(made.size, np.inf, np.float32))
    truth = assumption.ssao(empty, SsaoParams(radius=RADIUS), 512)
    np.testing.assert_array_equal(truth.mean, 1.0)
    np.testing.assert_array_equal(truth.error, 0.0)


def test_only_what_changes_the_model_makes_another_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assumption, "visibility", lambda view, params, points: np.ones((4, 5)))
    gbuffer = corner(size=(4, 5))

    def key(**params: Any) -> str:
        return assumption.ssao(gbuffer, SsaoParams(**{"radius": RADIUS, **params}), 256).key

    same = [
        {},
        {"samples": 3},
        {"max_samples": 99},
        {"near_px": 5.0},
        {"resolution": "half"},
        {"blur_radius": 0},
        {"blur_passes": 3},
    ]
    other = [
        {"radius": 0.5},
        {"length_power": 0.4},
        {"hemisphere": False},
        {"falloff": "exponential"},
        {"falloff_rate": 2.0},
        {"ramp_start": 0.5},
        {"ramp_end": 3.0},
        {"power": 2.0},
        {"falloff_end": 1.0},
        {"bias": 0.1},
        {"outside": "open"},
        {"max_radius_px": 9.0},
    ]
    assert len({key(**params) for params in same}) == 1
    assert len({key(**params) for params in ({}, *other)}) == 1 + len(other)
    moved = GBuffer(camera=gbuffer.camera, depth=np.asarray(gbuffer.depth) + np.float32(1.0))
    assert assumption.ssao(moved, SsaoParams(radius=RADIUS), 256).key != key()


def test_interrupted_truth_goes_on_and_gives_bit_identical_results() -> None:
    gbuffer, params = corner(size=(4, 5)), SsaoParams(radius=(0.3, RADIUS))
    whole = assumption.ssao(gbuffer, params, 512)
    store.clear()

    def interrupt(done: float) -> None:
        if done > 0.7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        assumption.ssao(gbuffer, params, 512, progress=interrupt)
    told: list[float] = []
    again = assumption.ssao(gbuffer, params, 512, progress=told.append)
    np.testing.assert_array_equal(again.mean, whole.mean)
    np.testing.assert_array_equal(again.error, whole.error)
    # The first radius is kept; of the second, only what was not done is done.
    assert told[0] == 0.5
    assert told[1] > 0.7
    assert told[1:] == sorted(told[1:])
    assert told[-1] == 1.0


def test_bad_argument_is_named() -> None:
    with pytest.raises(TypeError, match=r"gbuffer is str: expected an ssgi_cl\.GBuffer"):
        assumption.ssao("depth.exr")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="points is 0: expected an integer >= 1"):
        assumption.ssao(corner(), SsaoParams(), 0)


@pytest.mark.parametrize("exponent", [0.5, 2.5])
def test_contrast_is_a_power_of_what_it_tends_to_without(exponent: float) -> None:
    gbuffer = corner("bumpy")
    plain = assumption.ssao(gbuffer, SsaoParams(radius=RADIUS, contrast=1.0), 256)
    powered = assumption.ssao(gbuffer, SsaoParams(radius=RADIUS, contrast=exponent), 256)
    np.testing.assert_allclose(powered.mean, plain.mean**exponent, rtol=1e-6)
    assert powered.key != plain.key
    assert np.isfinite(powered.error).all()
    # The slope of the power, where A is far from 0 and the slope from its bound.
    open_ = plain.mean > 0.2
    slope = exponent * plain.mean[open_] ** (exponent - 1.0)
    np.testing.assert_allclose(powered.error[open_], plain.error[open_] * slope, rtol=1e-5)


def test_of_a_single_pass_the_error_is_unknown_with_contrast_too() -> None:
    truth = assumption.ssao(corner(), SsaoParams(radius=RADIUS, contrast=2.0), 64)
    assert np.isinf(truth.error).all()
