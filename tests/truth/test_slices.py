"""Limits of techniques of slices: against formulas, their references and themselves."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.bitmask import BitmaskParams
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.techniques.ao.gtao import GtaoParams, gtao
from ssgi_cl.techniques.ao.hbao import HbaoParams, hbao
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.truth.pixels import spread_pixels
from ssgi_cl.truth.slices import converged

from ..closed_forms import hidden_by_wall
from ..techniques.analytic import camera, scene
from ..techniques.walls import wall_and_floor

ALL = 1 << 20
SOME = 700
"""Of the 2867 pixels of `camera()`, a quarter, evenly spread."""
MANY = {"slices": 16, "taps": 48}
"""As many as where the techniques are held to formulas: the same programs."""
PARAMS: dict[str, Any] = {
    "gtao": GtaoParams,
    "hbao": HbaoParams,
    "bitmask_ao": partial(BitmaskParams, joined=False, thickness=0.5),
}
CALLS: dict[str, Any] = {"gtao": gtao, "hbao": hbao, "bitmask_ao": partial(bitmask_ao, joined=False, thickness=0.5)}


@pytest.mark.parametrize("technique", PARAMS)
@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre"])
def test_tilted_plane_is_open(technique: str, kind: str) -> None:
    made = camera(kind, (15, 20))
    row, column = (np.indices((15, 20)) + 0.5) - np.array([7.5, 10.0])[:, None, None]
    depth = (5.0 / (1.0 - 0.02 * row + 0.01 * column)).astype(np.float32)
    if kind == "orthographic":
        depth = (5.0 + 0.1 * row - 0.05 * column).astype(np.float32)
    truth = converged(GBuffer(camera=made, depth=depth), PARAMS[technique](radius=1.0), pixels=ALL, slices=8)
    # Normals of a float32 depth are off by 1e-6 or so, and horizons of neighbours with them.
    np.testing.assert_allclose(truth.mean, 1.0, rtol=0, atol=1e-4)


@pytest.mark.parametrize("kind", ["perspective", pytest.param("orthographic", marks=pytest.mark.slow)])
def test_floor_by_an_infinite_wall_is_as_dark_as_the_formula_says(kind: str) -> None:
    gbuffer, distance = wall_and_floor(kind)
    truth = converged(gbuffer, GtaoParams(radius=1.0), pixels=2000, slices=4)
    for near, far in ((0.1, 0.3), (0.3, 0.6), (0.6, 0.9)):
        there = (distance > near) & (distance < far) & np.isfinite(truth.mean)
        assert np.count_nonzero(there) > 20
        wanted = [1.0 - hidden_by_wall(c, "cosine", "none") for c in distance[there]]
        # A pixel is a 60th of the radius, in which the highest point of a slice may lie beyond
        # the highest pixel.
        assert np.mean(truth.mean[there]) == pytest.approx(np.mean(wanted), abs=4e-3)


@pytest.mark.parametrize(
    ("technique", "kind"),
    [
        pytest.param(name, kind, marks=[pytest.mark.slow] * ((name, kind) != ("bitmask_ao", "corner")))
        for name in PARAMS
        for kind in ("corner", "bumpy")
    ],
)
def test_technique_with_many_taps_comes_close(
    runtime: Runtime, rng: np.random.Generator, technique: str, kind: str
) -> None:
    gbuffer = scene(kind, camera(), rng)
    truth = converged(gbuffer, PARAMS[technique](radius=0.6), pixels=SOME, slices=16)
    known = np.isfinite(truth.mean)
    many = (CALLS[technique](gbuffer, 0.6, **MANY, blur_radius=0, runtime=runtime) - truth.mean)[known]
    # On a picture of 61 pixels, which of them a slice crosses near a corner matters this much.
    assert abs(float(np.mean(many))) < 3e-3
    assert np.sqrt(np.mean(many**2)) < 0.02


@pytest.mark.parametrize(
    ("technique", "options"),
    [
        ("gtao", {"falloff": 0.6}),
        ("bitmask_ao", {"thickness": 0.1}),
        pytest.param("hbao", {"attenuation": 0.0}, marks=pytest.mark.slow),
        pytest.param("hbao", {"angle_bias": 0.3}, marks=pytest.mark.slow),
        pytest.param("bitmask_ao", {"sectors": "angle"}, marks=pytest.mark.slow),
        pytest.param("gtao", {"contrast": 2.0}, marks=pytest.mark.slow),
        pytest.param("gtao", {"max_radius_px": 4.0}, marks=pytest.mark.slow),
    ],
)
def test_every_part_of_the_model_counts_as_in_the_technique(
    runtime: Runtime, rng: np.random.Generator, technique: str, options: dict[str, Any]
) -> None:
    gbuffer = scene("corner", camera(), rng)
    function, make = CALLS[technique], PARAMS[technique]
    plain = converged(gbuffer, make(radius=0.6), pixels=SOME, slices=16).mean
    other = converged(gbuffer, make(radius=0.6, **options), pixels=SOME, slices=16).mean
    known = np.isfinite(plain)
    many = {**MANY, "blur_radius": 0, "runtime": runtime}
    change = function(gbuffer, 0.6, **many, **options) - function(gbuffer, 0.6, **many)
    expected = float(np.mean(change[known]))
    assert abs(expected) > 3e-3  # or this tests nothing
    assert float(np.mean((other - plain)[known])) == pytest.approx(expected, rel=0.1, abs=5e-4)


def test_deeper_layers_and_the_margin_occlude() -> None:
    made = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=30, height=20)
    depth = np.full((2, 26, 36), np.inf, np.float32)
    depth[0] = 5.0
    depth[0, :, :4] = 4.7  # beyond the border
    depth[0, :, 20:24] = 3.0  # too far away to occlude, but for what is behind it
    depth[1, :, 20:24] = 4.95
    margin = GBuffer(camera=made, depth=depth[:1])
    both = GBuffer(camera=made, depth=depth)
    inner = GBuffer(camera=made, depth=depth[0, 3:-3, 3:-3])
    params = BitmaskParams(radius=1.0, thickness=1.0, joined=False)
    a, b, c = (converged(g, params, pixels=ALL, slices=8).mean for g in (inner, margin, both))
    assert np.mean(b[:, 1:5]) < np.mean(a[:, 1:5]) - 0.01
    assert np.mean(c[:, 12:17]) < np.mean(b[:, 12:17]) - 1e-3


def test_only_some_pixels_are_computed_the_others_are_unknown(rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(size=(16, 21)), rng)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    whole = converged(gbuffer, GtaoParams(radius=0.6), pixels=ALL, slices=32)
    part = converged(gbuffer, GtaoParams(radius=0.6), pixels=80, slices=32)
    known = np.isfinite(part.mean)
    assert np.count_nonzero(known & seen) == 80
    assert (part.mean[~seen] == 1.0).all()
    assert np.array_equal(known, np.isfinite(part.error))
    # Other angles for each pixel: both are off by as much as they say.
    apart = (part.mean - whole.mean)[known & seen]
    said = np.sqrt(np.mean((part.error**2 + whole.error**2)[known & seen]))
    assert 0.0 < np.sqrt(np.mean(apart**2)) < 1.5 * said
    again = converged(gbuffer, GtaoParams(radius=0.6), pixels=80, slices=32, rebuild=True)
    np.testing.assert_array_equal(part.mean, again.mean)


def test_pixels_are_spread_evenly_over_the_mask() -> None:
    seen = np.ones((60, 80), bool)
    seen[:, 40:] = False
    rows, columns = spread_pixels(seen, 400)
    assert len(rows) == len(set(zip(rows.tolist(), columns.tolist(), strict=True))) == 400
    assert seen[rows, columns].all()
    counts, _, _ = np.histogram2d(rows, columns, bins=(4, 4), range=((0, 60), (0, 40)))
    # 25 in each of 16 parts on average; at random they would be off by 5.
    assert np.abs(counts - 25).max() <= 5
    assert len(spread_pixels(seen, 1 << 20)[0]) == 2400


def test_what_is_no_part_of_the_model_changes_nothing(rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    plain = converged(gbuffer, GtaoParams(radius=0.6), pixels=50, slices=16)
    other = GtaoParams(radius=0.6, slices=7, taps=3, tap_power=2.0, resolution="half", blur_radius=5, blur_passes=2)
    assert converged(gbuffer, other, pixels=50, slices=16).key == plain.key
    assert converged(gbuffer, GtaoParams(radius=0.5), pixels=50, slices=16).key != plain.key


def test_radius_below_a_pixel_is_open(rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(size=(16, 21)), rng)
    truth = converged(gbuffer, HbaoParams(radius=1e-4), pixels=ALL, slices=8)
    assert (truth.mean == 1.0).all()


def test_wrong_arguments_are_named(rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    with pytest.raises(TypeError, match="params is SsaoParams: expected those of hbao, gtao or"):
        converged(gbuffer, SsaoParams())  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="gbuffer is NoneType"):
        converged(None, GtaoParams())  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="joined is True: expected False"):
        converged(gbuffer, BitmaskParams(joined=True))
    with pytest.raises(ValueError, match="slices is 0: expected an integer >= 1"):
        converged(gbuffer, GtaoParams(), slices=0)
