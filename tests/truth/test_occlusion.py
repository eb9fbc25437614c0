"""World truth of ambient occlusion: closed forms within its own standard errors, and its keeping.

Rays are drawn by a fixed rule, so that every test gives the same numbers in every run.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl.truth.ray_ao as estimator
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth import ambient_occlusion, layered_occlusion

from ..closed_forms import (
    FAR,
    FLOOR,
    SIDE,
    START,
    WALL,
    above,
    ball,
    beside_sphere,
    hidden_by_sphere,
    hidden_by_wall,
    made,
    quads,
)
from .conftest import same

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")


# ---- closed forms


@dataclass(frozen=True)
class Case:
    """A view, and the A that it must have within `other` and standard errors."""

    scene: Scene
    camera: Camera
    radius: float
    expected: float | NDArray[np.float64]
    other: float
    attenuation: str = "none"


def wall(distance: float, attenuation: str, weighting: str) -> Case:
    hidden = hidden_by_wall(distance / 0.8, weighting, attenuation)
    return Case(quads(FLOOR, WALL), above(distance, size=48), 0.8, 1.0 - hidden, START / 0.8, attenuation)


def sphere(lift: float, weighting: str) -> Case:
    scene, camera = beside_sphere(lift, size=48)
    # The facets' mean radius is right to 1e-4; so is the start of the rays.
    return Case(scene, camera, math.inf, 1.0 - hidden_by_sphere(camera, lift, weighting), 2e-4)


def inside_sphere(reach: float, weighting: str) -> Case:
    """A furnace with attenuation: from a sphere's inside at angle t, the wall is at 2 cos t.

    With k = 2 / reach, what is hidden is the integral of exp(-k c) 2 c dc ("cosine") or
    exp(-k c) dc over c = cos t in [0, 1].
    """
    k = 2.0 / reach
    hidden = (1.0 - math.exp(-k)) / k
    if weighting == "cosine":
        hidden = 2.0 * (1.0 - math.exp(-k) * (1.0 + k)) / k**2
    mesh = ball()
    camera = Camera.look_at((0.1, 0.2, 0.3), (0.7, -0.5, 0.2), yfov=0.9, width=48, height=48)
    # A facet is 0.04 wide: below that angle rays meet the next facet at a distance that is off
    # by up to its size, 0.04 / reach, which 0.04 of all directions do ("uniform").
    return Case(made(mesh.vertices, mesh.faces), camera, reach, 1.0 - hidden, 5e-4, "exponential")


CASES: dict[str, Callable[[str], Case]] = {
    "corner of two planes": lambda w: Case(quads(FLOOR, WALL), above(0.7, size=48), math.inf, 0.5, 0.7 / FAR),
    "corner of three planes": lambda w: Case(
        quads(FLOOR, WALL, SIDE), above(0.4, 0.9, size=48), math.inf, 0.25, 1.3 / FAR
    ),
    "wall within the radius": lambda w: wall(0.3, "none", w),
    "wall, linear": lambda w: wall(0.3, "linear", w),
    "wall, quadratic": lambda w: wall(0.1, "quadratic", w),
    "two walls within the radius": lambda w: Case(
        quads(FLOOR, WALL, SIDE),
        above(0.6, 0.7, size=48),
        0.8,
        # 0.6^2 + 0.7^2 > 0.8^2: no direction reaches both.
        1.0 - sum(hidden_by_wall(h / 0.8, w, "none") for h in (0.6, 0.7)),
        START / 0.8,
    ),
    "sphere that touches the plane": lambda w: sphere(1.0, w),
    "sphere above the plane": lambda w: sphere(1.6, w),
    "inside a sphere, exponential": lambda w: inside_sphere(2.5, w),
}


FAST = {
    "corner of two planes": "uniform",
    "corner of three planes": "cosine",
    "wall, linear": "cosine",
    "wall, quadratic": "cosine",
    "two walls within the radius": "cosine",
    "sphere that touches the plane": "cosine",
    "inside a sphere, exponential": "cosine",
}
"""Cases and weightings that are of one kind with all others, or with fewer triangles."""


@pytest.mark.parametrize(
    ("name", "weighting"),
    [
        pytest.param(name, weighting, marks=() if FAST.get(name) == weighting else pytest.mark.slow)
        for name in CASES
        for weighting in ("cosine", "uniform")
    ],
)
def test_truth_is_within_its_standard_errors_of_the_closed_form(name: str, weighting: str) -> None:
    case = CASES[name](weighting)
    truth = ambient_occlusion(case.scene, case.camera, case.radius, weighting=weighting, attenuation=case.attenuation)
    off = truth.mean.astype(np.float64) - case.expected
    error = truth.error.astype(np.float64)
    # The mean of all pixels: three of its own standard errors, and what the scene leaves out.
    whole = math.sqrt(float(np.sum(error**2))) / error.size
    assert abs(float(off.mean())) <= 3.0 * whole + case.other, (off.mean(), whole)
    # Pixel by pixel: the squares are what the errors say. 2304 pixels tell the squares to 3 %, and
    # errors with 7 degrees of freedom to 1 %: four times that. Measured: 0.97 to 1.08.
    ratio = float(np.mean(off**2) / np.mean(error**2))
    assert ratio == pytest.approx(1.0, abs=0.13)
    # Student's t with 7 degrees of freedom is beyond 3 in 2.0 % of cases, 0.3 % give or take; in
    # more where passes take two or three values only (a wall's edge). Measured: 1.6 to 3.2 %.
    beyond = float(np.mean(np.abs(off) > 3.0 * error + case.other))
    assert beyond < 0.04


@pytest.mark.parametrize("weighting", ["cosine", "uniform"])
@pytest.mark.parametrize("radius", [0.5, math.inf])
def test_open_plane_is_open_without_error(weighting: str, radius: float) -> None:
    floor = quads(((-5, 0, -5), (0, 0, 10), (10, 0, 0)))
    camera = Camera.look_at((0, 2, 3), (0, 0, 0), width=32, height=24)
    truth = ambient_occlusion(floor, camera, radius, 32, weighting=weighting)
    np.testing.assert_array_equal(truth.mean, 1.0)
    np.testing.assert_array_equal(truth.error, 0.0)


@pytest.mark.parametrize("weighting", ["cosine", "uniform"])
def test_furnace_is_black_without_error(weighting: str) -> None:
    mesh = ball(3)
    camera = Camera.look_at((0.1, 0.2, 0.3), (0.4, -0.4, -0.5), yfov=1.8, width=40, height=30)
    room = made(mesh.vertices, mesh.faces)
    truth = ambient_occlusion(room, camera, math.inf, 64, weighting=weighting)
    np.testing.assert_array_equal(truth.mean, 0.0)
    np.testing.assert_array_equal(truth.error, 0.0)


# ---- passes


@pytest.mark.parametrize(
    ("rays", "passes", "traced"),
    [(1, 2, 2), (2, 2, 2), (127, 2, 128), (128, 2, 128), (500, 7, 504), (512, 8, 512), (4096, 16, 4096)],
)
def test_rays_are_split_into_equal_passes_and_rounded_up(
    monkeypatch: pytest.MonkeyPatch, rays: int, passes: int, traced: int
) -> None:
    asked: list[int] = []

    def counted(scene: Any, camera: Camera, radius: Any, rays: int, **rest: Any) -> Any:
        asked.append(rays)
        return np.ones(camera.size, np.float32)

    monkeypatch.setattr(estimator, "ray_ao", counted)
    truth = ambient_occlusion(*posts(), 1.0, rays)
    assert truth.passes == len(asked) == passes
    assert len(set(asked)) == 1
    assert sum(asked) == traced


def test_progress_grows_to_one_within_passes_too() -> None:
    told: list[float] = []
    ambient_occlusion(*posts(), 1.0, 512, progress=told.append)
    assert told == sorted(told)
    assert len(set(told)) >= 8
    assert told[-1] == 1.0


@pytest.mark.slow
def test_more_rays_are_nearer_to_the_truth() -> None:
    scene, camera = posts()
    best = ambient_occlusion(scene, camera, 1.0, 4096).mean
    off = [
        math.sqrt(float(np.mean((ambient_occlusion(scene, camera, 1.0, rays).mean - best) ** 2)))
        for rays in (32, 128, 512)
    ]
    # As n^-0.5 at least: half the error of a quarter of the rays, some 10 % apart.
    for few, many in pairwise(off):
        assert many < 0.6 * few


# ---- kept


def posts() -> tuple[Scene, Camera]:
    """Return a floor with a post, and a view of it."""
    post = ((0.1, 0, -0.2), (0.3, 0, 0.1), (0, 0.9, 0))
    camera = Camera.look_at((0.5, 2, 3), (0, 0.3, 0), yfov=0.8, width=48, height=36)
    return quads(((-4, 0, -4), (0, 0, 8), (8, 0, 0)), post), camera


@pytest.mark.parametrize("layered", [False, True])
def test_kept_truth_is_returned_without_a_ray(monkeypatch: pytest.MonkeyPatch, layered: bool) -> None:
    scene, camera = posts()
    seen = GBuffer(camera=camera, depth=np.full(camera.size, 2.0, np.float32))
    call = partial(layered_occlusion, seen) if layered else partial(ambient_occlusion, scene, camera)
    told: list[float] = []
    first = call(1.0, 128, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0

    def never(*arguments: Any, **options: Any) -> Any:
        raise AssertionError("rays were cast")

    monkeypatch.setattr(estimator.RayAo, "__call__", never)
    assert same(call(1.0, 128), first)
    with pytest.raises(AssertionError, match="rays were cast"):
        call(1.0, 128, rebuild=True)


def test_whatever_changes_the_rays_makes_another_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimator, "ray_ao", lambda scene, camera, *rest, **named: np.ones(camera.size))
    scene, camera = posts()
    depth = np.full(camera.size, 2.0, np.float32)
    up = np.tile(np.array((0.0, 1.0, 0.0), np.float32), (*camera.size, 1))
    moved = replace(scene, positions=scene.positions + np.float32(1e-3))
    calls: list[tuple[Any, ...]] = [
        (scene, camera, 1.0, 16, {}),
        (moved, camera, 1.0, 16, {}),
        (scene, replace(camera, width=50), 1.0, 16, {}),
        (scene, Camera.look_at((0.5, 2, 3), (0, 0, 0), width=48, height=36), 1.0, 16, {}),
        (scene, camera, 1.1, 16, {}),
        (scene, camera, math.inf, 16, {}),
        (scene, camera, 1.0, 18, {}),
        (scene, camera, 1.0, 16, {"weighting": "uniform"}),
        (scene, camera, 1.0, 16, {"attenuation": "linear"}),
        (scene, camera, 1.0, 16, {"attenuation": (1.0, 0.5, 0.0)}),
        (scene, camera, 1.0, 16, {"attenuation": (1.0, 0.4, 0.0)}),
        (scene, camera, 1.0, 16, {"gbuffer": GBuffer(camera=camera, depth=depth)}),
        (scene, camera, 1.0, 16, {"gbuffer": GBuffer(camera=camera, depth=depth + 1.0)}),
        (scene, camera, 1.0, 16, {"gbuffer": GBuffer(camera=camera, depth=depth, normal=up)}),
    ]
    keys = [ambient_occlusion(*call[:-1], **call[-1]).key for call in calls]
    monkeypatch.setattr("ssgi_cl.truth.raycast.embree_version", lambda: "0.0")
    keys.append(ambient_occlusion(scene, camera, 1.0, 16).key)
    assert len(set(keys)) == len(keys)


# ---- bad input


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"radius": -1.0}, ValueError, r"radius is -1\.0: expected a number > 0 \(scene units\)"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected a number"),
        ({"rays": 0}, ValueError, r"rays is 0: expected an integer >= 1"),
        ({"rays": 2.5}, TypeError, r"rays is 2\.5: expected an integer"),
        ({"weighting": "cos"}, ValueError, r"weighting is 'cos': expected one of 'cosine'"),
        ({"attenuation": "cubic"}, ValueError, r"attenuation is 'cubic': expected one of"),
        ({"attenuation": (1.0, 2.0)}, ValueError, r"attenuation has 2 values from 1 to 2"),
        ({"scene": "room.glb"}, TypeError, "scene is str: expected a Scene"),
        ({"camera": None}, TypeError, "camera is None: expected an ssgi_cl.Camera"),
        ({"gbuffer": "depth.exr"}, TypeError, "gbuffer is str: expected an ssgi_cl.GBuffer"),
    ],
)
def test_bad_argument_is_named_and_nothing_is_kept(
    folder: Path, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    scene, camera = posts()
    with pytest.raises(error, match=message):
        ambient_occlusion(**{"scene": scene, "camera": camera, "radius": 1.0, **arguments})
    assert not folder.exists()


def test_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[truth\]"):
        ambient_occlusion(*posts(), 1.0)
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[truth\]"):
        layered_occlusion(GBuffer(camera=posts()[1], depth=np.ones((36, 48), np.float32)), 1.0)
