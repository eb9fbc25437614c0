"""Flat surfaces whose normals are not across them: a box with averaged normals, before rays and references."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl import rasterize
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.facets import tilted
from ssgi_cl.reference.ao.gtao import bent_reference
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.techniques.ao.gtao import GtaoParams, gtao
from ssgi_cl.truth.ray_ao import ray_ao
from ssgi_cl.truth.slices import converged

from ...frame.scenes import CORNERS, QUADS, halves, matt, scene_of
from ..analytic import camera, share_off, view_of
from .subjects import FLIPS, RADIUS, ROUNDING, SUBJECTS, WEIGHTS, Subject


@pytest.fixture(params=SUBJECTS)
def subject(request: pytest.FixtureRequest) -> Subject:
    """Each technique."""
    return SUBJECTS[request.param]


def box() -> Scene:
    """Return a cube from -1 to 1 whose normals are the means of its sides', as exporters write them."""
    corners = np.asarray(CORNERS, np.float32)
    return replace(scene_of(CORNERS, halves(QUADS), matt(0.8)), normals=corners / np.float32(np.sqrt(3.0)))


def leaning(gbuffer: GBuffer, by: float = 1.0) -> GBuffer:
    """Return a G-buffer whose normals lean, one way on the left and another on the right."""
    normal = np.asarray(gbuffer.normal)
    turn = np.expm1(np.linspace(-1.5, 0.9, normal.shape[1]))[None, :, None]  # not even: no pixel is between two alike
    other = normal + by * turn * np.float32([0.5, 0.6, -0.6])
    other = other / np.linalg.norm(other, axis=-1, keepdims=True)
    return replace(gbuffer, normal=np.where(np.isfinite(np.asarray(gbuffer.depth))[..., None], other, 0.0))


def rmse(a: NDArray[Any], b: NDArray[Any], where: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean((a - b)[where] ** 2)))


EYES = {
    "corner on": (3.0, 2.2, 4.2),
    "side on": (0.0, 0.0, 4.2),  # depth does not change at all
}


@pytest.mark.parametrize("eye", EYES.values(), ids=EYES)
def test_box_with_averaged_normals_is_as_dark_as_rays_say(
    runtime: Runtime, subject: Subject, eye: tuple[float, float, float]
) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    made = Camera.look_at(eye, (0, 0, 0), yfov=0.7, width=120, height=90)
    gbuffer = rasterize.gbuffer(box(), made)
    weighting = "uniform" if subject is SUBJECTS["hbao"] else "cosine"
    rays = ray_ao(box(), made, 0.5, 1024, weighting=weighting)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    known, _ = tilted(SurfaceView.of(gbuffer))
    assert known.sum() > 0.9 * seen.sum()
    a = subject.function(gbuffer, 0.5, blur_radius=0, runtime=runtime)
    # Nothing occludes, so that the share of directions below the surface is exact; that of 1024 rays is off by .003.
    assert rmse(a, rays, known) < 5e-3
    # At the ends of edges fewer than three pixels of a side lie in a row, and their normals count as before.
    assert rmse(a, rays, seen) < 0.035
    assert np.mean(rays[known]) < 0.95


def test_corner_with_leaning_normals_is_as_dark_as_rays_say(runtime: Runtime, subject: Subject) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    made = Camera.look_at((0.9, 0.9, 0.9), (-1, -1, -1), yfov=1.1, width=100, height=76)
    room = scene_of(CORNERS, halves(QUADS), matt(0.8))
    bare = rasterize.gbuffer(room, made, overscan=0.5)
    upright = replace(bare, normal=SurfaceView.of(bare).normal @ made.view[:3, :3])
    other = leaning(upright, 0.6)  # by 55 degrees at most
    weighting = "uniform" if subject is SUBJECTS["hbao"] else "cosine"
    seen = np.isfinite(upright.inner(np.asarray(upright.depth)))
    errors = []
    for gbuffer in (upright, other):
        rays = ray_ao(room, made, 0.5, 256, weighting=weighting, gbuffer=gbuffer)
        errors.append(rmse(subject.function(gbuffer, 0.5, runtime=runtime), rays, seen))
    # Normals that lean to the walls weigh them more, and with them what is not seen: measured 1.28 times at most.
    assert errors[1] < 1.35 * errors[0]


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_leaning_normals_agree_with_numpy_reference(
    variant_runtime: Runtime, subject: Subject, kind: str, exact: bool
) -> None:
    gbuffer = leaning(view_of("corner", kind))
    object.__setattr__(gbuffer, "exact", exact)
    known, _ = tilted(SurfaceView.of(gbuffer))
    assert 0.5 < known.mean() < 1.0
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=variant_runtime)
    wanted = subject.expected(gbuffer, blur_radius=0)
    assert share_off(a, wanted, 10.0 * ROUNDING) <= 3 * FLIPS
    assert share_off(wanted, subject.expected(view_of("corner", kind), blur_radius=0), 0.05) > 0.2


@pytest.mark.parametrize("choice", [{"resolution": "half"}, {"contrast": 1.5}], ids=str)
def test_leaning_normals_with_other_parameters_agree_with_numpy_reference(
    runtime: Runtime, subject: Subject, choice: dict[str, Any]
) -> None:
    gbuffer = leaning(view_of("corner", "off-centre", margin=(2, 7)))
    a = subject.function(gbuffer, RADIUS, runtime=runtime, **choice)
    assert share_off(a, subject.expected(gbuffer, **choice), WEIGHTS) <= 25 * FLIPS


@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("gtao", {"falloff": 0.6}),
        ("hbao", {"angle_bias": 0.2}),
        ("bitmask", {"sectors": "angle"}),
        ("bitmask", {"joined": False}),
    ],
    ids=str,
)
def test_leaning_normals_agree_with_numpy_reference_in_every_model(
    runtime: Runtime, name: str, choice: dict[str, Any]
) -> None:
    gbuffer = leaning(view_of("corner"))
    a = SUBJECTS[name].function(gbuffer, RADIUS, blur_radius=0, runtime=runtime, **choice)
    wanted = SUBJECTS[name].expected(gbuffer, blur_radius=0, **choice)
    assert share_off(a, wanted, 10.0 * ROUNDING) <= 3 * FLIPS


def test_bent_normals_lean_away_from_the_surface_below(runtime: Runtime) -> None:
    gbuffer = leaning(view_of("corner"))
    params = GtaoParams(radius=RADIUS, blur_radius=0, bent_normals=True)
    _, bent = gtao(gbuffer, RADIUS, blur_radius=0, bent_normals=True, runtime=runtime)
    wanted = bent_reference(gbuffer, params)
    assert share_off(bent, wanted, 1e-4) <= 3 * FLIPS
    upright = np.asarray(view_of("corner").normal)
    known, _ = tilted(SurfaceView.of(gbuffer))
    given = np.sum(np.asarray(gbuffer.normal) * upright, axis=-1)
    assert np.mean((np.sum(bent * upright, axis=-1) - given)[known]) > 0.05


def test_depth_that_is_rounded_to_steps_keeps_its_normals(runtime: Runtime, subject: Subject) -> None:
    row, column = np.indices((47, 61))
    made = camera("perspective")
    depth = np.round(64.0 * (4.0 + 0.002 * row + 0.001 * column)) / 64.0
    normal = np.tile(np.float32(made.view[2, :3] + 0.5 * made.view[0, :3]), (47, 61, 1))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32), normal=normal)
    known, _ = tilted(SurfaceView.of(gbuffer))
    assert not known.any()
    a = subject.function(gbuffer, RADIUS, blur_radius=0, runtime=runtime)
    assert share_off(a, subject.expected(gbuffer, blur_radius=0), 10.0 * ROUNDING) <= 3 * FLIPS


@pytest.mark.parametrize("name", ["gtao", "hbao", "bitmask"])
def test_technique_with_many_taps_tends_to_its_own_truth(runtime: Runtime, name: str) -> None:
    gbuffer = leaning(view_of("corner"))
    single: dict[str, Any] = {"joined": False, "thickness": 0.5, "end": "thickness"} if name == "bitmask" else {}
    truth = converged(gbuffer, SUBJECTS[name].params(radius=RADIUS, **single), pixels=500, slices=16, rebuild=True)
    known = np.isfinite(truth.mean)
    many = SUBJECTS[name].function(gbuffer, RADIUS, 16, 48, blur_radius=0, runtime=runtime, **single) - truth.mean
    # On a picture of 61 pixels, which of them a slice crosses near a corner matters this much.
    assert abs(float(np.mean(many[known]))) < 5e-3
