"""Tests of every technique that scans slices: HBAO, GTAO and visibility bitmask; see test_occlusion.py."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.constants import SLICES_STRIP
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.bitmask import BitmaskAo
from ssgi_cl.techniques.ao.slices import SliceParams, pattern

from ...closed_forms import hidden_by_wall
from ..analytic import Ball, Plane, camera, share_off, slow_but, trace, view_of
from ..walls import wall_and_floor
from .subjects import FLIPS, RADIUS, ROUNDING, SLICED, WEIGHTS, Subject


@pytest.fixture(params=SLICED)
def subject(request: pytest.FixtureRequest) -> Subject:
    """Each technique."""
    return SLICED[request.param]


def layered(made: Camera, margin: tuple[int, int] = (0, 0)) -> tuple[GBuffer, GBuffer, GBuffer]:
    """Return a corner behind a ball near the eye: one layer, two layers, and without the ball."""
    floor = Plane((0.0, -0.3, 0.0), (0.0, 1.0, 0.0))
    corner = [floor, Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))]
    behind = trace(made, corner, margin=margin)
    ball = Ball(made.position - 1.7 * made.view[2, :3], 0.4 if made.is_orthographic else 0.2)
    front = trace(made, [*corner, ball], margin=margin)
    covered = np.asarray(front.depth) < np.asarray(behind.depth)
    assert 0.01 < covered.mean() < 0.5
    deeper = np.where(covered, behind.depth, np.inf).astype(np.float32)
    both = GBuffer(camera=made, depth=np.stack([np.asarray(front.depth), deeper]), normal=front.normal)
    return front, both, behind


# ---- against the numpy reference


def test_normals_that_turn_away_agree_with_numpy_reference(runtime: Runtime, subject: Subject) -> None:
    gbuffer = view_of("ball", "orthographic")
    seen = np.isfinite(np.asarray(gbuffer.depth))
    ahead = -gbuffer.camera.view[2, :3]
    leaning = np.asarray(gbuffer.normal) + np.where(seen[..., None], 0.3 * ahead, 0.0)
    leaning /= np.maximum(np.linalg.norm(leaning, axis=-1, keepdims=True), 1e-9)
    averted = leaning @ ahead > 0.0
    assert 20 < np.count_nonzero(averted) < 0.1 * averted.size
    smooth = replace(gbuffer, normal=leaning.astype(np.float32))
    a = subject.function(smooth, RADIUS, blur_radius=0, runtime=runtime)
    wanted = subject.expected(smooth, blur_radius=0)
    # Angles are measured in parts of a cosine of .05 there.
    np.testing.assert_allclose(a[averted], wanted[averted], atol=2.0 * ROUNDING)


def test_an_image_of_more_than_a_strip_agrees_with_numpy_reference(runtime: Runtime, subject: Subject) -> None:
    gbuffer = view_of("noisy", "intrinsics", (5, SLICES_STRIP + 64))
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    wanted = subject.expected(gbuffer, blur_radius=0)
    assert (wanted[:, SLICES_STRIP:] < 0.8).mean() > 0.1
    # Slices are some 100 px long, and roundings of a place grow with that.
    assert share_off(a, wanted, 10.0 * ROUNDING) <= 20 * FLIPS


SLOW_MARGINS = [
    ("full", (0, 0)),
    ("full", (2, 7)),
    ("half", (0, 0)),
    ("half", (1, 2)),
    ("quarter", (1, 2)),
    ("quarter", (0, 0)),
]


@pytest.mark.parametrize(
    ("resolution", "margin"),
    [
        ("full", (1, 2)),
        ("half", (2, 7)),
        ("quarter", (2, 7)),
        *(pytest.param(*choice, marks=pytest.mark.slow) for choice in SLOW_MARGINS),
    ],
    ids=str,
)
def test_blurred_layers_with_any_margin_agree_with_numpy_reference_at_every_resolution(
    variant_runtime: Runtime, subject: Subject, resolution: str, margin: tuple[int, int]
) -> None:
    _, both, _ = layered(camera(size=(21, 27)), margin)
    a = subject.function(both, RADIUS, resolution=resolution, runtime=variant_runtime)
    # A flip spreads over the 5 x 5 pixels of the blur and over the pixels of a coarse one.
    assert share_off(a, subject.expected(both, resolution=resolution), WEIGHTS) <= 25 * FLIPS


CHECKERBOARDS = {"layers": {}, "a wide blur, twice": {"blur_radius": 3, "blur_passes": 2}}


@pytest.mark.parametrize("margin", [(0, 0), (1, 2)], ids=str)
@pytest.mark.parametrize("choice", CHECKERBOARDS.values(), ids=CHECKERBOARDS)
def test_a_checkerboard_agrees_with_numpy_reference(
    variant_runtime: Runtime, subject: Subject, choice: dict[str, Any], margin: tuple[int, int]
) -> None:
    _, both, _ = layered(camera(size=(21, 27)), margin)
    a = subject.function(both, RADIUS, checkerboard=True, runtime=variant_runtime, **choice)
    wanted = subject.expected(both, checkerboard=True, **choice)
    # A flip spreads over the pixels of the blur.
    assert share_off(a, wanted, WEIGHTS) <= 49 * FLIPS
    assert share_off(a, subject.expected(both, **choice), WEIGHTS) > 0.2  # of another pattern; much is open


def test_pixels_of_a_checkerboard_that_nothing_fits_are_the_mean_of_their_neighbours(
    variant_runtime: Runtime, subject: Subject
) -> None:
    gbuffer = view_of("noisy", size=(16, 24))
    a = subject.function(gbuffer, RADIUS, checkerboard=True, runtime=variant_runtime)
    assert share_off(a, subject.expected(gbuffer, checkerboard=True), WEIGHTS) <= 25 * FLIPS
    # Of depths without any surface nothing fits: pixels are as they were scanned, or between two such.
    rng = np.random.default_rng(3)
    facing = np.broadcast_to(gbuffer.camera.view[2, :3], (16, 24, 3)).astype(np.float32)
    rough = replace(gbuffer, depth=rng.uniform(1.0, 3.0, (16, 24)).astype(np.float32), normal=facing)
    a = subject.function(rough, RADIUS, checkerboard=True, runtime=variant_runtime)
    assert share_off(a, subject.expected(rough, checkerboard=True), WEIGHTS) <= 25 * FLIPS
    beside = 0.5 * (a[1:-1, :-2] + a[1:-1, 2:])
    between = (np.indices(beside.shape).sum(axis=0)) % 2 == 1  # columns and rows from 1 on
    assert np.mean(np.abs(a[1:-1, 1:-1] - beside)[between] < 1e-5) > 0.2


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (2, 2), (5, SLICES_STRIP + 3)], ids=str)
def test_a_checkerboard_of_a_plane_is_open(runtime: Runtime, subject: Subject, size: tuple[int, int]) -> None:
    made = camera(size=size)
    gbuffer = trace(made, [Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0))])
    a = subject.function(gbuffer, RADIUS, checkerboard=True, runtime=runtime)
    np.testing.assert_allclose(a, 1.0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"resolution": "half"}, "checkerboard is True with resolution='half': expected 'full'"),
        ({"blur_radius": 0}, "checkerboard is True with blur_radius=0: expected 1 or more"),
        ({"blur_passes": 0}, "checkerboard is True with blur_passes=0: expected 1 or more"),
    ],
    ids=str,
)
def test_a_checkerboard_needs_full_size_and_a_blur(subject: Subject, choice: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        subject.params(checkerboard=True, **choice)


# ---- against a formula


@pytest.mark.parametrize(
    ("name", "choice", "weighting", "falloff"),
    [
        ("gtao", {"bent_normals": True}, "cosine", "none"),  # the program of other tests
        pytest.param("bitmask", {"joined": False}, "cosine", "none", marks=pytest.mark.slow),
        ("hbao", {"attenuation": 1e-6}, "uniform", "none"),  # of 0 it is another program
        ("hbao", {"attenuation": 1.0}, "uniform", "quadratic"),
    ],
    ids=str,
)
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_floor_by_an_infinite_wall_is_as_dark_as_the_formula_says(
    runtime: Runtime, name: str, choice: dict[str, Any], weighting: str, falloff: str, kind: str
) -> None:
    gbuffer, distance = wall_and_floor(kind)
    found = SLICED[name].function(gbuffer, 1.0, 16, 48, blur_radius=0, runtime=runtime, **choice)
    a = found[0] if isinstance(found, tuple) else found
    for near, far in ((0.1, 0.2), (0.3, 0.4), (0.6, 0.7), (0.9, 0.95), (1.02, 1.2)):
        there = (distance > near) & (distance < far)
        wanted = [1.0 - hidden_by_wall(min(c, 1.0), weighting, falloff) for c in distance[there]]
        # The highest point within the radius lies up to a tap, a 50th of the radius, beyond the
        # highest tap: .0066 at most, half of it with twice the taps.
        assert np.mean(a[there]) == pytest.approx(np.mean(wanted), abs=8e-3)


# ---- beyond the front layer and the image


@pytest.mark.parametrize("kind", slow_but(("perspective", "orthographic"), "perspective"))
def test_second_layer_shows_what_a_thing_near_the_eye_hides(
    variant_runtime: Runtime, subject: Subject, kind: str
) -> None:
    front, both, behind = layered(camera(kind))
    seen = np.asarray(front.depth) == np.asarray(behind.depth)
    # Joined, the surfaces of the bitmask break where they go from one layer to the next.
    single: dict[str, Any] = {"joined": False, "end": "thickness"} if subject.kind is BitmaskAo else {}
    one, two, whole = (
        subject.function(g, 1.0, blur_radius=0, runtime=variant_runtime, **single) for g in (front, both, behind)
    )
    # The ball is farther away than the radius, so that only what it hides makes a difference.
    assert np.abs(one - whole)[seen].max() > 0.02
    np.testing.assert_array_equal(two[seen], whole[seen])


@pytest.mark.parametrize(
    ("name", "choice", "layers"),
    [
        ("hbao", {}, 4),  # GTAO scans by the same code
        ("bitmask", {"joined": False, "end": "thickness"}, 2),
        pytest.param("gtao", {}, 4, marks=pytest.mark.slow),
        pytest.param("bitmask", {}, 4, marks=pytest.mark.slow),
        pytest.param("bitmask", {"joined": False}, 4, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_empty_layers_change_nothing(runtime: Runtime, name: str, choice: dict[str, Any], layers: int) -> None:
    subject: Any = SLICED[name]
    front, _, _ = layered(camera())
    depth = np.full((layers, *front.size), np.inf, np.float32)
    depth[0] = front.depth
    more = GBuffer(camera=front.camera, depth=depth, normal=front.normal)
    # As many taps as the front one of so many layers is read at.
    taps = subject.params(**choice).in_front_of(layers).taps
    a = subject.function(front, RADIUS, **{**choice, "taps": taps}, runtime=runtime)
    np.testing.assert_array_equal(a, subject.function(more, RADIUS, **choice, runtime=runtime))


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_radius_beyond_the_scene_sees_the_scene_and_no_more(runtime: Runtime, subject: Subject, kind: str) -> None:
    gbuffer = view_of("bumpy", kind)
    far, farther = (subject.function(gbuffer, radius, blur_radius=0, runtime=runtime) for radius in (1e4, 1e8))
    assert far.min() < 0.5
    # Nor does what is infinitely far away occlude, however large the radius.
    assert share_off(far, farther, ROUNDING) <= FLIPS


def test_pattern_of_a_tile_spreads_angles_and_distances_evenly() -> None:
    made = pattern(SliceParams(slices=2, taps=3, tap_power=1.0))
    even = (np.arange(16) + 0.5) / 16
    for number in (0, 1):
        angle, share = made.angle[..., number], made.share[..., number, :]
        np.testing.assert_allclose(np.sort(2.0 * angle.ravel() / np.pi), number + even)
        for tap in range(3):
            np.testing.assert_allclose(np.sort(3.0 * share[..., tap].ravel()), tap + even)


# ---- bad input


@pytest.mark.parametrize(
    ("name", "params", "error", "message"),
    [
        ("hbao", {"radius": (0.5, 1.0)}, TypeError, r"radius is \(0.5, 1.0\): expected"),
        ("hbao", {"slices": 0}, ValueError, r"slices is 0: expected an integer >= 1 and <= 32"),
        ("gtao", {"slices": 2.5}, TypeError, r"slices is 2.5: expected an integer"),
        ("gtao", {"taps": 65}, ValueError, r"taps is 65: expected an integer >= 1 and <= 64"),
        ("bitmask", {"tap_power": 0.0}, ValueError, r"tap_power is 0.0: expected a number >= 0.1"),
        ("hbao", {"attenuation": 1.5}, ValueError, r"attenuation is 1.5: expected a number >= 0 and <= 1"),
        ("hbao", {"angle_bias": -0.1}, ValueError, r"angle_bias is -0.1: expected a number >= 0.*radians"),
        ("gtao", {"falloff": 1.5}, ValueError, r"falloff is 1.5: expected a number >= 0 and <= 1.*radii"),
        ("gtao", {"thin_occluder": -1.0}, ValueError, r"thin_occluder is -1.0: expected a number >= 0"),
        ("bitmask", {"thickness": -0.1}, ValueError, r"thickness is -0.1: expected a number >= 0.*radii"),
        ("bitmask", {"sectors": "equal"}, ValueError, r"sectors is 'equal': expected one of 'cosine', 'angle'"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, name: str, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        SLICED[name].function(layered(camera())[0], runtime=runtime, **params)
