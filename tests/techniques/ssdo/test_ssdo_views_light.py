"""Light of auxiliary cameras of SSDO: a wall's light on a floor, in closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime

from ...closed_forms import Quad, lit_by_wall
from ..analytic import camera as camera_of
from ..analytic import scene as scene_of
from ..analytic import slow_but
from .wall import FLOOR, WALL, box, emitting, floor_of, positions, quads_of, seen

Doubles = NDArray[np.float64]

RADIUS = 4.0
"""Radius of SSDO, as wide as the scenes."""

MANY = {"view_taps": 64}
"""With few taps, what lies between them is left out."""


def bounce(gbuffer: GBuffer, views: list[GBuffer], runtime: Runtime, **params: Any) -> Doubles:
    """Return the red irradiance by surfaces, W/m^2."""
    _, found = gi.ssdo(gbuffer, [], RADIUS, auxiliary_views=views, runtime=runtime, **params)
    return np.asarray(found[..., 0], np.float64)


EYE, TARGET = (2.2, 1.5, 1.3), (0.5, 0.2, 0.0)
CASES = {
    "wall": (Camera.look_at(EYE, TARGET, yfov=0.9, width=120, height=90), False),
    "odd size": (Camera.look_at((2.6, 0.9, -0.8), TARGET, yfov=0.8, width=101, height=77), False),
    "orthographic": (Camera.orthographic(EYE, TARGET, (0, 1, 0), view_height=2.0, width=120, height=90), False),
    "box": (Camera.look_at(EYE, TARGET, yfov=0.9, width=120, height=90), True),
    "box, odd": (Camera.look_at((2.0, 2.0, -0.5), TARGET, yfov=0.9, width=93, height=71), True),
}


@pytest.mark.parametrize("case", slow_but(CASES, "odd size"))
def test_auxiliary_cameras_create_no_light(runtime: Runtime, case: str) -> None:
    camera, boxed = CASES[case]
    scene = quads_of(WALL, FLOOR, *(box() if boxed else []))
    gbuffer = seen(scene, camera, runtime)
    on_floor, truth = floor_of(gbuffer, boxed=boxed, nearest=0.02)  # two pixels
    cameras = gi.auxiliary_cameras(camera, gbuffer, 4, size=1.0)
    views = [seen(scene, each, runtime) for each in cameras]
    assert len(views) == 4
    means, errors = [], []
    for count in (0, 1, 2, 4):
        found = bounce(gbuffer, views[:count], runtime)[on_floor]
        means.append(found.mean() / truth.mean())
        errors.append(np.sqrt(np.mean((found - truth) ** 2)) / truth.mean())
    assert np.abs(np.subtract(means, 1.0)).max() < 0.02
    # Behind the box cameras find the wall by few rays, whose noise is within the error they mend.
    assert max(errors) <= 1.01 * errors[0]
    if boxed and len(set(means)) > 1:
        assert errors[-1] < errors[0]


def test_lit_wall_sends_what_a_single_view_says_it_does(runtime: Runtime) -> None:
    # The same by a light that meets the wall face-on, with all defaults.
    camera, scene = CASES["wall"][0], quads_of(WALL, FLOOR)
    sun = gi.DirectionalLight((-1, 0, 0), (1, 1, 1))
    gbuffer = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    views = [
        gi.rasterize.gbuffer(scene, each, runtime=runtime)
        for each in gi.auxiliary_cameras(camera, gbuffer, 4, size=1.0)
    ]
    _, alone = gi.ssdo(gbuffer, [sun], RADIUS, runtime=runtime)
    for count in (1, 2, 4):
        _, found = gi.ssdo(gbuffer, [sun], RADIUS, auxiliary_views=views[:count], runtime=runtime)
        assert np.abs(found - alone).max() < 0.01 * alone.mean()


def near_copies(camera: Camera) -> list[Camera]:
    """Return the camera, a copy moved by less than a hundredth of a pixel, and one with fewer pixels."""
    moved = camera.view.copy()
    moved[:3, 3] += (1e-4, -1e-4, 1e-4)
    rows, columns = camera.size
    return [camera, replace(camera, view=moved), replace(camera, width=columns // 2, height=rows // 2)]


@pytest.mark.parametrize("case", CASES)
def test_view_that_shows_nothing_new_changes_nothing(runtime: Runtime, case: str) -> None:
    camera, boxed = CASES[case]
    scene = quads_of(WALL, FLOOR, *(box() if boxed else []))
    gbuffer = seen(scene, camera, runtime)
    alone = bounce(gbuffer, [], runtime)
    views = [seen(scene, each, runtime) for each in near_copies(camera)]
    for view in views:
        assert np.abs(bounce(gbuffer, [view], runtime) - alone).max() < 0.01 * alone.mean()
    assert np.abs(bounce(gbuffer, views, runtime) - alone).max() < 0.01 * alone.mean()


@pytest.mark.parametrize("name", ["corner", "ball", "bumpy"])
@pytest.mark.parametrize("kind", ["perspective", "orthographic", "off-centre"])
def test_curved_surface_seen_again_changes_nothing(runtime: Runtime, name: str, kind: str) -> None:
    def shining(camera: Camera) -> GBuffer:
        gbuffer = scene_of(name, camera, np.random.default_rng(3))
        there = np.isfinite(np.asarray(gbuffer.depth))[..., None]
        emission = np.where(there, np.ones(3, np.float32), np.float32(0.0))
        return replace(gbuffer, emission=emission)

    camera = camera_of(kind, (61, 83))
    gbuffer = shining(camera)
    alone = bounce(gbuffer, [], runtime)
    assert alone.mean() > 0.05
    for each in near_copies(camera):
        found = bounce(gbuffer, [shining(each)], runtime)
        assert np.abs(found - alone).max() < 0.01 * alone.mean()


def test_second_auxiliary_camera_leaves_what_the_first_shows(runtime: Runtime) -> None:
    # From above the floor alone is seen, so that all light is of the wall that others see.
    above = Camera.look_at((0.9, 2.0, 0.2), (0.9, 0.0, 0.2), (0, 0, 1), yfov=0.6, width=80, height=60)
    scene = quads_of(WALL, FLOOR)
    gbuffer = seen(scene, above, runtime)
    assert not np.asarray(gbuffer.emission).any()
    on_floor, values = floor_of(gbuffer, nearest=0.02)
    truth = values.mean()
    views = [
        seen(scene, each, runtime)
        for each in (*near_copies(CASES["wall"][0]), CASES["orthographic"][0], CASES["odd size"][0])
    ]
    one, two, all_ = (bounce(gbuffer, views[:n], runtime, **MANY)[on_floor] for n in (1, 2, 5))
    assert one.mean() == pytest.approx(truth, rel=0.06)
    assert np.abs(two - one).max() < 0.01 * truth
    assert all_.mean() == pytest.approx(one.mean(), rel=0.01)


def test_back_of_what_a_view_shows_sends_its_light(runtime: Runtime) -> None:
    # A slab whose dark front the camera sees, from above its top, with the floor behind; an
    # auxiliary camera sees its bright back. A part of the floor sees nothing but that back.
    back: Quad = ((-0.1, 0, -0.5), (0, 0, 1), (0, 1, 0))
    ground: Quad = ((-3, 0, -1.5), (0, 0, 3), (6, 0, 0))
    top: Quad = ((-0.1, 1, -0.5), (0, 0, 1), (0.1, 0, 0))
    scene = quads_of(WALL, back, top, ground)

    def lit(camera: Camera) -> GBuffer:
        gbuffer = seen(scene, camera, runtime)
        position = positions(gbuffer)
        return emitting(gbuffer, (np.abs(position[..., 0] + 0.1) < 1e-3) & (position[..., 1] > 1e-3))

    gbuffer = lit(Camera.look_at((1.6, 3.2, 0.3), (-0.6, 0.3, 0.0), yfov=0.9, width=100, height=75))
    view = lit(Camera.look_at((-2.2, 1.1, 0.4), (-0.1, 0.4, 0.0), yfov=0.9, width=100, height=75))
    position = positions(gbuffer)
    # From farther away the slab is less than a sector high, which is too little for few rays.
    x_floor = np.where(np.abs(position[..., 1]) < 1e-3, position[..., 0], 0.0)
    behind = (x_floor < -0.3) & (x_floor > -1.2)
    assert not np.asarray(gbuffer.emission).any()
    assert behind.sum() > 500
    x, z = position[behind][:, 0], position[behind][:, 2]
    truth = math.pi * lit_by_wall(-0.1 - x, 0.5 + z, 0.5 - z, 1.0).mean()
    assert bounce(gbuffer, [], runtime)[behind].mean() == 0.0
    found = bounce(gbuffer, [view], runtime, **MANY)[behind].mean()
    # Rays have 64 taps, which miss what is narrower than the way between them: 9 % here.
    assert found == pytest.approx(truth, rel=0.15)
    assert found <= 1.02 * truth
    # The slab hides once: its back covers 1 % beside its front, and both again 4 %.
    sky = gi.Environment((1.0, 1.0, 1.0))
    alone, both = (
        gi.ssdo(gbuffer, [sky], RADIUS, auxiliary_views=views, runtime=runtime, **MANY)[0][behind]
        for views in ([], [view])
    )
    assert np.abs(both - alone).mean() < 0.02 * alone.mean()
