"""Ray-cast ambient occlusion: against closed forms, and against itself under what must not matter.

Rays are drawn by a fixed rule, so that every test gives the same numbers in every run.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

import ssgi_cl.truth.ray_ao as module
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.truth.ray_ao import RayAo, ray_ao

from ...closed_forms import (
    FAR,
    FLOOR,
    SIDE,
    START,
    WALL,
    Quad,
    above,
    beside_sphere,
    hidden_by_sphere,
    hidden_by_wall,
    made,
    quads,
    with_mesh,
)

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")

Doubles = NDArray[np.float64]

ROUNDING = 1e-6
"""Of A where every ray has the same fate: one rounding of float32 and some."""
STANDARD_ERRORS = 3.0
"""The mean over an image is that many of its standard errors from the closed form, at most."""


def closely(a: NDArray[np.float32], error: NDArray[np.float32], expected: float | Doubles, other: float = 0.0) -> None:
    """Assert that the mean of A is that of `expected`, within standard errors and `other`."""
    difference = float(np.mean(a.astype(np.float64) - expected))
    own = math.sqrt(float(np.sum(error.astype(np.float64) ** 2))) / a.size
    assert abs(difference) <= STANDARD_ERRORS * own + other, (difference, own)
    assert own < 2e-3, "the test would notice nothing"


@pytest.fixture(params=["cosine", "uniform"])
def weighting(request: pytest.FixtureRequest) -> str:
    """Each weighting of directions."""
    return str(request.param)


# ---- closed forms


@pytest.mark.parametrize("radius", [0.5, math.inf])
def test_open_plane_is_open(weighting: str, radius: float, rng: np.random.Generator) -> None:
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    plane = quads((-turn[0] * 5 - turn[1] * 5, turn[0] * 10, turn[1] * 10))
    camera = Camera.look_at(turn[2] * 3 + turn[0], (0, 0, 0), turn[1], width=32, height=24)
    a, error = ray_ao(plane, camera, radius, 64, weighting=weighting, return_error=True)
    assert (a == 1.0).all()
    assert (error == 0.0).all()


def test_half_of_the_sky_is_seen_beside_an_infinite_wall(weighting: str) -> None:
    a, error = ray_ao(quads(FLOOR, WALL), above(0.7), math.inf, 256, weighting=weighting, return_error=True)
    closely(a, error, 0.5, other=1e-4)  # 0.7 / FAR


@pytest.mark.parametrize("distance", [0.3, 2.0])
def test_wall_of_finite_height_hides_its_form_factor(weighting: str, distance: float) -> None:
    height = 1.1
    wall: Quad = ((0, 0, -FAR), (0, height, 0), (0, 0, 2 * FAR))
    a, error = ray_ao(quads(FLOOR, wall), above(distance), math.inf, 256, weighting=weighting, return_error=True)
    # Infinitely long: the angle in the profile decides.
    if weighting == "cosine":
        hidden = 0.5 * (1.0 - distance / math.hypot(distance, height))
    else:
        hidden = math.atan(height / distance) / math.pi
    closely(a, error, 1.0 - hidden, other=2e-4)  # 2 / FAR


def test_a_quarter_of_the_sky_is_seen_in_the_corner_of_three_planes(weighting: str) -> None:
    a, error = ray_ao(quads(FLOOR, WALL, SIDE), above(0.4, 0.9), math.inf, 256, weighting=weighting, return_error=True)
    closely(a, error, 0.25, other=2e-4)  # (0.4 + 0.9) / FAR


@pytest.mark.parametrize("attenuation", ["none", "linear", "quadratic"])
@pytest.mark.parametrize("distance", [0.05, 0.3])
def test_wall_within_the_radius_hides_half_a_cone(weighting: str, attenuation: str, distance: float) -> None:
    a, error = ray_ao(
        quads(FLOOR, WALL), above(distance), 0.8, 256, weighting=weighting, attenuation=attenuation, return_error=True
    )
    hidden = hidden_by_wall(distance / 0.8, weighting, attenuation)
    closely(a, error, 1.0 - hidden, other=START / 0.8)


def test_two_walls_within_the_radius_hide_two_half_cones_that_do_not_meet(weighting: str) -> None:
    a, error = ray_ao(quads(FLOOR, WALL, SIDE), above(0.6, 0.7), 0.8, 256, weighting=weighting, return_error=True)
    # 0.6^2 + 0.7^2 > 0.8^2: no direction reaches both.
    hidden = sum(hidden_by_wall(h / 0.8, weighting, "none") for h in (0.6, 0.7))
    closely(a, error, 1.0 - hidden, other=START / 0.8)


CURVE = (1.0, 0.9, 0.3, 0.5, 0.0)
"""An attenuation by values."""
CURVES: dict[str, Callable[[Doubles], Doubles]] = {
    "none": np.ones_like,
    "linear": lambda d: 1.0 - d,
    "quadratic": lambda d: 1.0 - d * d,
    "exponential": lambda d: np.exp(-d),
    "values": lambda d: np.interp(d, np.linspace(0.0, 1.0, len(CURVE)), CURVE),
}


@pytest.mark.parametrize("name", CURVES)
def test_ceiling_hides_the_integral_of_its_attenuation(weighting: str, name: str) -> None:
    c = 0.4  # height of the ceiling in radii
    room = quads(((-50, 0, -50), (0, 0, 100), (100, 0, 0)), ((-50, 0.2, -50), (100, 0, 0), (0, 0, 100)))
    attenuation: Any = CURVE if name == "values" else name
    a, error = ray_ao(room, above(0.0), 0.2 / c, 256, weighting=weighting, attenuation=attenuation, return_error=True)
    # Over cos t, by the midpoint rule in 1e5 steps: exact to 1e-9.
    z = c + (1.0 - c) * (np.arange(100_000) + 0.5) / 100_000
    density = 2.0 * z if weighting == "cosine" else np.ones_like(z)
    hidden = float(np.mean(CURVES[name](c / z) * density)) * (1.0 - c)
    closely(a, error, 1.0 - hidden, other=2.0**-20 * 150 / 0.5)  # height of the start, in radii
    if weighting == "cosine" and name == "linear":
        np.testing.assert_allclose(hidden, (1.0 - c) ** 2, atol=1e-9)


@pytest.mark.parametrize("lift", [1.0, 1.6])
def test_sphere_above_a_plane_hides_its_form_factor(weighting: str, lift: float) -> None:
    scene, camera = beside_sphere(lift)
    a, error = ray_ao(scene, camera, math.inf, 256, weighting=weighting, return_error=True)
    hidden = hidden_by_sphere(camera, lift, weighting)
    # The facets' mean radius is right to 1e-4; so is the start of the rays.
    closely(a, error, 1.0 - hidden, other=2e-4)


def test_each_pixel_beside_a_wall_has_the_closed_form_of_its_distance() -> None:
    floor: Quad = ((0, 0, -9), (0, 0, 18), (9, 0, 0))
    wall: Quad = ((0, 0, -9), (0, 9, 0), (0, 0, 18))
    camera = Camera.orthographic((0.5, 2, 0), (0.5, 0, 0), (0, 0, 1), view_height=0.9, width=48, height=48)
    a, error = ray_ao(quads(floor, wall), camera, 0.8, 1024, return_error=True)
    x = np.abs(camera.unproject(np.full(camera.size, 2.0, np.float32))[..., 0])
    expected = [1.0 - hidden_by_wall(c, "cosine", "none") if c < 1.0 else 1.0 for c in x.ravel() / 0.8]
    off = a - np.reshape(expected, a.shape)
    np.testing.assert_array_equal(a[x > 0.8001], 1.0)
    # The largest of 2304 errors of pixels: 8 batches have heavier tails than a normal law.
    assert (np.abs(off) <= 8.0 * error + 1e-3).all()


def test_closed_box_is_black_inside() -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    camera = Camera.look_at((0.1, 0.2, 0.3), (0.4, -0.4, -0.5), yfov=1.8, width=40, height=30)
    a, error = ray_ao(made(box.vertices, box.faces), camera, math.inf, 64, return_error=True)
    assert (a == 0.0).all()
    assert (error == 0.0).all()


# ---- which surface, which hemisphere


def test_back_of_a_plane_is_open_too() -> None:
    plane = quads(((-5, 0, -5), (10, 0, 0), (0, 0, 10)))  # its triangles face down
    for height in (2.0, -2.0):
        camera = Camera.look_at((0, height, 0.5), (0, 0, 0), (0, 0, 1), width=16, height=16)
        np.testing.assert_array_equal(ray_ao(plane, camera, 3.0, 16), 1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rays_below_the_triangle_of_a_tilted_normal_are_blocked_at_distance_zero(sign: float) -> None:
    tilt = 0.6
    normal = sign * np.array([math.sin(tilt), math.cos(tilt), 0.0])
    corners = [(-5, 0, -5), (-5, 0, 5), (5, 0, 5), (5, 0, -5)]
    plane = made(corners, [(0, 1, 2), (0, 2, 3)], np.tile(normal, (4, 1)))
    camera = Camera.look_at((0, 3, 1), (0, 0, 0), width=24, height=24)
    for attenuation in ("none", "linear"):
        a, error = ray_ao(plane, camera, 0.5, 256, attenuation=attenuation, return_error=True)
        # The hemisphere's part below a plane tilted by t, by cosine: (1 - cos t) / 2.
        closely(a, error, 0.5 * (1.0 + math.cos(tilt)))


def test_empty_view_is_open() -> None:
    plane = quads(((-5, 0, -5), (10, 0, 0), (0, 0, 10)))
    camera = Camera.look_at((0, 1, 0), (0, 2, 0), (0, 0, 1), width=16, height=9)
    a, error = ray_ao(plane, camera, math.inf, return_error=True)
    assert a.shape == (9, 16)
    assert a.dtype == error.dtype == np.float32
    assert (a == 1.0).all()
    assert (error == 0.0).all()


def test_near_and_far_plane_bound_what_is_seen() -> None:
    floor: Quad = ((-5, 0, -5), (10, 0, 0), (0, 0, 10))
    lid: Quad = ((-5, 1, -5), (10, 0, 0), (0, 0, 10))
    camera = Camera.look_at((0, 2, 0), (0, 0, 0), (0, 0, 1), width=8, height=8, near=1.5)
    np.testing.assert_array_equal(ray_ao(quads(floor, lid), camera, 0.5, 16), 1.0)
    # The lid occludes unseen: of its height 1 and half width 5, about 1 / 26 looks past it.
    assert ray_ao(quads(floor, lid), camera, 50.0, 64).mean() < 0.1
    short = Camera.look_at((0, 2, 0), (0, 0, 0), (0, 0, 1), width=8, height=8, near=1.2, far=1.5)
    np.testing.assert_array_equal(ray_ao(quads(floor, lid), short, 50.0, 16), 1.0)


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre"])
def test_surface_of_a_gbuffer_gives_what_primary_rays_give(kind: str, runtime: Runtime) -> None:
    scene = with_mesh(
        quads(((-50, 0, -50), (0, 0, 100), (100, 0, 0))), trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    )
    camera = Camera.look_at((2, 3, 4), (0, 0.3, 0), yfov=0.7, width=48, height=40)
    if kind == "orthographic":
        camera = Camera.orthographic((2, 3, 4), (0, 0.3, 0), view_height=3.0, width=48, height=40)
    if kind == "off-centre":
        projection = camera.projection.copy()
        projection[0, 2], projection[1, 2] = 0.4, -0.3
        camera = replace(camera, projection=projection)
    seen = gbuffer(scene, camera, overscan=0.1, runtime=runtime)
    own = ray_ao(scene, camera, 1.0, 64)
    given = ray_ao(scene, camera, 1.0, 64, gbuffer=seen)
    bare = ray_ao(scene, camera, 1.0, 64, gbuffer=replace(seen, normal=None))
    # The same rays from points that differ by roundings: some that graze an edge change their
    # fate, and at edges a pixel's centre may fall on another triangle.
    assert np.mean(np.abs(own - given) > 0.05) < 0.01
    assert np.mean(np.abs(own - bare) > 0.05) < 0.01
    np.testing.assert_allclose(own.mean(), given.mean(), atol=1e-3)


def test_gbuffer_of_another_surface_is_taken_at_its_word() -> None:
    room = quads(FLOOR, WALL)
    camera = above(0.3)
    made_up = GBuffer(
        camera=camera,
        depth=np.full(camera.size, 0.005, np.float32),  # above the floor, where nothing is
        normal=np.tile(np.array((0.0, 0.0, 1.0)), (*camera.size, 1)),  # along the wall
    )
    a, error = ray_ao(room, camera, math.inf, 256, gbuffer=made_up, return_error=True)
    closely(a, error, 0.25, other=2e-4)  # half of the half above the floor; 2 * 0.3 / FAR
    empty = GBuffer(camera=camera, depth=np.full(camera.size, np.inf, np.float32))
    np.testing.assert_array_equal(ray_ao(room, camera, math.inf, 16, gbuffer=empty), 1.0)


# ---- the estimate and its error


def posts(scale: float = 1.0, shift: ArrayLike = 0.0) -> tuple[Scene, Camera]:
    """Return a floor with posts, and a view of it."""
    parts: list[Quad] = [((-4, 0, -4), (0, 0, 8), (8, 0, 0))]
    for x, z in ((-1.0, 0.2), (0.1, -0.7), (0.8, 0.4)):
        for edge in ((0.3, 0.0, 0.1), (-0.1, 0.0, 0.3)):
            parts.append(((x, 0, z), edge, (0, 0.9, 0)))
    ends = ((0.5, 2.0, 3.0), (0.0, 0.3, 0.0))
    eye, target = (scale * np.asarray(end) + np.asarray(shift) for end in ends)
    camera = Camera.look_at(eye, target, yfov=0.8, width=48, height=36)
    return quads(*parts, scale=scale, shift=shift), camera


@pytest.fixture(scope="module")
def nearly_exact() -> NDArray[np.float32]:
    """A of the posts from 4096 rays, 16 times as many as in the tests.

    Its own error is an eighth of theirs, which fall as n^-0.75; of what they are off, 1 %.
    """
    return ray_ao(*posts(), 1.0, 4096)


@pytest.mark.parametrize("rays", [16, 64, 256])
def test_stated_error_is_the_actual_error(rays: int, nearly_exact: NDArray[np.float32]) -> None:
    a, error = ray_ao(*posts(), 1.0, rays, return_error=True)
    actual = math.sqrt(float(np.mean((a - nearly_exact) ** 2)))
    stated = math.sqrt(float(np.mean(error**2)))
    # The variance is estimated without bias; 1700 pixels, half of them open, tell it to some 4 %.
    assert stated == pytest.approx(actual, rel=0.08)  # measured: 1.03, 1.01, 0.98
    # Student's t with 3 and 7 degrees of freedom is beyond 3 in 5.8 % and 2.0 % of cases. Means
    # of few rays take few values, often all the same, so that more are.
    partly = (nearly_exact > 0.1) & (nearly_exact < 0.9)
    beyond = np.mean(np.abs(a - nearly_exact)[partly] > 3.0 * error[partly])
    assert beyond < {16: 0.2, 64: 0.05, 256: 0.03}[rays]  # measured: 0.155, 0.034, 0.015


def test_rays_that_need_not_tell_their_error_are_better_spread(nearly_exact: NDArray[np.float32]) -> None:
    scene, camera = posts()
    split, _ = ray_ao(scene, camera, 1.0, 256, return_error=True)
    whole, unknown = RayAo(scene)(camera, 1.0, 256, estimate_error=False)
    np.testing.assert_array_equal(whole, ray_ao(scene, camera, 1.0, 256))
    error = [math.sqrt(float(np.mean((a - nearly_exact) ** 2))) for a in (whole, split)]
    assert error[0] < 0.75 * error[1]
    assert set(np.unique(unknown)) <= {0.0, math.inf}


def test_stratified_rays_beat_independent_ones(nearly_exact: NDArray[np.float32]) -> None:
    a = ray_ao(*posts(), 1.0, 256)
    actual = float(np.mean((a - nearly_exact) ** 2))
    independent = float(np.mean(nearly_exact * (1.0 - nearly_exact))) / 256
    assert actual < 0.15 * independent


@pytest.mark.parametrize("target", [0.02, 0.008])
def test_rays_stop_when_the_error_is_met(
    target: float, nearly_exact: NDArray[np.float32], runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    traced = 0
    weights = RayAo._weights

    def counted(self: RayAo, start: Any, way: Any, below: Any, settings: Any) -> Any:
        nonlocal traced
        traced += len(start)
        return weights(self, start, way, below, settings)

    monkeypatch.setattr(RayAo, "_weights", counted)
    scene, camera = posts()
    a, error = ray_ao(scene, camera, 1.0, 4096, target_error=target, return_error=True)
    surface = np.isfinite(gbuffer(scene, camera, runtime=runtime).depth)
    stated = math.sqrt(float(np.mean(error[surface] ** 2)))
    actual = math.sqrt(float(np.mean((a - nearly_exact)[surface] ** 2)))
    assert stated <= target
    assert actual <= 1.1 * target  # what is stated is known to some 4 %
    assert stated >= target / 1.6  # 1.5 times the rays at each look, error as n^-0.75, and noise
    assert traced < 4096 * a.size / 4


def test_target_that_cannot_be_met_takes_all_rays() -> None:
    scene, camera = posts()
    a, _ = ray_ao(scene, camera, 1.0, 64, return_error=True)
    np.testing.assert_array_equal(ray_ao(scene, camera, 1.0, 64, target_error=0.0), a)


@pytest.mark.parametrize("rays", [1, 2, 3, 17, 100])
def test_any_number_of_rays_is_at_most_used(rays: int, nearly_exact: NDArray[np.float32]) -> None:
    a, error = ray_ao(*posts(), 1.0, rays, return_error=True)
    spread = math.sqrt(float(np.mean(nearly_exact * (1.0 - nearly_exact))) / rays)
    np.testing.assert_allclose(a.mean(), nearly_exact.mean(), atol=4.0 * spread / math.sqrt(a.size))
    assert np.isfinite(error).all() == (rays > 1)


def test_same_arguments_give_bit_identical_results_with_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, camera = posts()
    first, error = ray_ao(scene, camera, 1.0, 64, attenuation="linear", return_error=True)
    monkeypatch.setattr(module, "threads", lambda: 1)
    again, error_again = RayAo(scene)(camera, 1.0, 64, attenuation="linear")
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(error, error_again)


def test_results_of_different_seeds_are_independent(nearly_exact: NDArray[np.float32]) -> None:
    scene, camera = posts()
    np.testing.assert_array_equal(ray_ao(scene, camera, 1.0, 16, seed=5), ray_ao(scene, camera, 1.0, 16, seed=5))
    np.testing.assert_array_equal(ray_ao(scene, camera, 1.0, 16, seed=0), ray_ao(scene, camera, 1.0, 16))
    off = np.stack([ray_ao(scene, camera, 1.0, 16, seed=i) for i in (0, 1, 2, 3, 2**62)])
    off = (off - nearly_exact)[:, (nearly_exact > 0.1) & (nearly_exact < 0.9)]
    correlation = np.corrcoef(off)[~np.eye(len(off), dtype=bool)]
    # Of some 380 pixels, each correlation is 0 with a standard error of 0.05.
    assert np.abs(correlation).max() < 0.2
    assert off.shape[1] > 300


def test_size_of_a_block_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, camera = posts()
    first = ray_ao(scene, camera, 1.0, 64)
    monkeypatch.setattr(module, "BLOCK_PIXELS", 100)
    monkeypatch.setattr(module, "BLOCK_RAYS", 3000)
    np.testing.assert_array_equal(ray_ao(scene, camera, 1.0, 64), first)


@pytest.mark.parametrize("scale", [1e-4, 2.0**-20, 1e4, 2.0**40])
def test_scale_of_the_world_does_not_matter(scale: float) -> None:
    whole = ray_ao(*posts(), 1.0, 64)
    scaled = ray_ao(*posts(scale), scale, 64)
    if math.frexp(scale)[0] == 0.5:
        np.testing.assert_array_equal(scaled, whole)  # a power of two changes no digit
    else:
        # Rounded corners: a ray in some 1e5 passes an edge on the other side.
        assert np.mean(scaled != whole) < 0.01
        np.testing.assert_allclose(scaled.mean(), whole.mean(), atol=1e-4)


def test_place_in_the_world_does_not_matter() -> None:
    here = ray_ao(*posts(), 1.0, 64)
    there = ray_ao(*posts(shift=(1e6, -1e6, 1e6)), 1.0, 64)
    # Float64 has 1e-10 left there, less than float32 has near the origin.
    assert np.mean(here != there) < 0.01
    np.testing.assert_allclose(there.mean(), here.mean(), atol=1e-4)


def test_distance_of_the_eye_does_not_matter() -> None:
    scene, _ = posts()
    views = [
        Camera.orthographic(np.array([0.5, 2.0, 3.0]) * far, (0, 0, 0), view_height=3.0, width=48, height=36)
        for far in (2.0, 1e5)
    ]
    near, far = (ray_ao(scene, view, 1.0, 64) for view in views)
    assert np.mean(near != far) < 0.01  # as for a shift


def test_progress_grows_to_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BLOCK_PIXELS", 200)
    told: list[float] = []
    ray_ao(*posts(), 1.0, 16, progress=told.append)
    assert told == sorted(told)
    assert len(told) == 9
    assert told[-1] == 1.0


def test_tree_is_built_once_for_a_scene_and_freed_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, camera = posts()
    kept = len(module._kept)
    ray_ao(scene, camera, 1.0, 4)
    ray_ao(scene, camera, 1.0, 4)
    assert len(module._kept) == kept + 1
    del scene
    assert len(module._kept) == kept


# ---- bad input


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"radius": 0.0}, r"radius is 0\.0: expected a number > 0 \(scene units\)"),
        ({"radius": math.nan}, r"radius is nan"),
        ({"rays": 0}, r"rays is 0: expected an integer >= 1 and <= 1048576 \(rays per pixel\)"),
        ({"weighting": "cos"}, r"weighting is 'cos': expected one of 'cosine', 'uniform'"),
        ({"attenuation": "square"}, r"attenuation is 'square': expected one of 'none', 'linear'"),
        ({"attenuation": [1.0]}, r"attenuation has 1 values"),
        ({"attenuation": []}, r"attenuation has 0 values"),
        ({"attenuation": [1.0, 1.5]}, r"attenuation has 2 values from 1 to 1\.5: expected 2 to"),
        ({"attenuation": "linear", "radius": math.inf}, r"radius is inf: expected a finite number"),
        ({"target_error": -0.1}, r"target_error is -0\.1: expected a number >= 0"),
        ({"seed": -1}, r"seed is -1: expected an integer >= 0"),
    ],
)
def test_bad_argument_is_named_with_its_value(arguments: dict[str, Any], message: str) -> None:
    scene, camera = posts()
    with pytest.raises(ValueError, match=message):
        ray_ao(scene, camera, **arguments)


def test_argument_of_a_wrong_type_is_named() -> None:
    scene, camera = posts()
    wrong: Any
    for wrong, message in (
        ({"scene": "room.glb"}, "scene is str: expected a Scene"),
        ({"camera": None}, "camera is None"),
        ({"gbuffer": "depth.exr"}, "gbuffer is str"),
        ({"rays": 2.5}, r"rays is 2\.5: expected an integer"),
    ):
        with pytest.raises(TypeError, match=message):
            ray_ao(**{"scene": scene, "camera": camera, **wrong})


def test_gbuffer_of_another_camera_is_refused() -> None:
    scene, camera = posts()
    small = replace(camera, width=20)
    with pytest.raises(ValueError, match="gbuffer has 36 rows and 20 columns: expected 36 x 48"):
        ray_ao(scene, camera, gbuffer=GBuffer(camera=small, depth=np.ones((36, 20), np.float32)))
    moved = Camera.look_at((0, 2, 3), (0, 0, 0), width=48, height=36)
    with pytest.raises(ValueError, match="gbuffer has another camera"):
        ray_ao(scene, camera, gbuffer=GBuffer(camera=moved, depth=np.ones((36, 48), np.float32)))


def test_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[truth\]"):
        RayAo(posts()[0])
