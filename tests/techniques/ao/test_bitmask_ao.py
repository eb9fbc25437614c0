"""Bitmask AO: its own parameters. Tests of all that scan slices: test_slices.py."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.reference.ao.bitmask_ao import bitmask_reference, turn
from ssgi_cl.techniques.ao.bitmask import BitmaskParams
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.truth.ray_ao import ray_ao

from ...closed_forms import hidden_by_wall
from ...rasterize.meshes import scene_of
from ..analytic import camera, scene, tilted, trace, view_of
from ..walls import wall_and_floor


def test_polynomial_of_the_sector_measure_is_as_accurate_as_it_says() -> None:
    angle = np.linspace(0.0, np.pi, 2001)
    c = np.cos(angle)
    exact = c * np.sin(angle) + np.arcsin(c)
    assert np.abs(turn(c) - exact).max() < 1.1e-3


@pytest.mark.parametrize("sectors", ["cosine", pytest.param("angle", marks=pytest.mark.slow)])
def test_thinner_surfaces_let_more_light_pass(runtime: Runtime, sectors: str) -> None:
    gbuffer = view_of("bumpy")
    images = [
        bitmask_ao(gbuffer, 0.6, thickness=t, sectors=sectors, joined=False, blur_radius=0, runtime=runtime)
        for t in (0.0, 0.05, 0.3, 2.0)
    ]
    for thin, thick in pairwise(images):
        assert np.all(thick <= thin)  # of the same sectors, more are covered
        assert np.mean(thin - thick) > 1e-3
    # A surface without thickness covers no sector but by rounding, and that of both ends alike.
    assert float(images[0].mean()) > 0.999


def test_joined_taps_find_what_lies_between_them_and_up_to_the_radius(runtime: Runtime) -> None:
    gbuffer, distance = wall_and_floor("perspective")
    joined, single = (
        bitmask_ao(gbuffer, 1.0, joined=choice, blur_radius=0, runtime=runtime) for choice in (True, False)
    )
    there = (distance > 0.1) & (distance < 0.95)
    wanted = np.array([1.0 - hidden_by_wall(c, "cosine", "none") for c in distance[there]])
    # One plane and another that meet: 14 taps see both, so that nothing is left but the rounding
    # of sectors, half of 1/32 in each of the 32 slices of a tile, and hundreds of pixels to average
    # them.
    assert float(np.mean(joined[there] - wanted)) == pytest.approx(0.0, abs=2e-3)
    assert float(np.mean(single[there] - wanted)) > 0.01


def test_joined_taps_do_not_bridge_a_silhouette(runtime: Runtime) -> None:
    # A plate that floats more than a radius before a wall.
    made = camera(size=(64, 64))
    gbuffer = trace(made, [tilted(made, 0.0)])
    depth = np.array(gbuffer.depth)
    depth[20:44, 20:44] -= 1.5
    plate = GBuffer(camera=made, depth=depth, normal=gbuffer.normal)
    a = bitmask_ao(plate, 1.0, thickness=0.0, blur_radius=0, runtime=runtime)
    # Nothing lies within the radius of anything else; a bridge to the plate would reach the wall.
    np.testing.assert_array_equal(a, 1.0)


def two_layers(made: Camera, rng: np.random.Generator, margin: tuple[int, int] = (0, 0)) -> GBuffer:
    """Return bumps and a second layer up to .5 scene units behind them."""
    front = scene("bumpy", made, rng, margin=margin)
    depth = np.asarray(front.depth)
    deeper = depth + rng.uniform(0.05, 0.5, depth.shape).astype(np.float32)
    return GBuffer(camera=made, depth=np.stack([depth, deeper]), normal=front.normal)


@pytest.mark.parametrize(
    ("joined", "end", "kind", "given"),
    [
        (True, "layer", "perspective", 2),
        (False, "thickness", "perspective", 0),
        *(
            pytest.param(joined, end, kind, given, marks=pytest.mark.slow)
            for kind in ("perspective", "orthographic")
            for joined in (True, False)
            for end in ("thickness", "layer")
            for given in (1, 2)
        ),
    ],
)
def test_thickness_of_each_pixel_and_the_next_layer_agree_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, joined: bool, end: str, kind: str, given: int
) -> None:
    gbuffer = two_layers(camera(kind, size=(31, 39)), rng, (2, 3))
    thickness = rng.uniform(0.0, 0.4, gbuffer.depth.shape).astype(np.float32)
    thickness[:, ::5, ::3] = np.inf
    thickness[:, 1::5, ::3] = 0.0
    thickness[:, 2::5] = -1.0  # not known
    gbuffer = replace(gbuffer, thickness=(None, thickness[0], thickness)[given])
    params = {"radius": 0.6, "blur_radius": 0, "joined": joined, "end": end}
    a = bitmask_ao(gbuffer, **params, runtime=variant_runtime)
    wanted = bitmask_reference(gbuffer, BitmaskParams(**params))
    # A sector or the radius may fall to the other side in a pixel or two.
    assert np.mean(~(np.abs(a - wanted) <= 1e-5)) <= 2e-3


def test_layers_behind_are_read_at_every_third_tap_of_a_wide_radius(runtime: Runtime, rng: np.random.Generator) -> None:
    # The radius covers up to 60 px, so that all 24 taps lie in pixels of their own and those of the
    # second layer are three apart; in the first, pieces are between neighbouring taps.
    gbuffer = two_layers(camera(size=(64, 80)), rng)
    params = {"radius": 3.0, "blur_radius": 0, "slack": 0.02}
    a = bitmask_ao(gbuffer, **params, runtime=runtime)
    wanted = bitmask_reference(gbuffer, BitmaskParams(**params))
    # A sector or the radius may fall to the other side in a pixel or two of 5120; with the first
    # layer's pieces as wide as the second's, 27 are off.
    assert np.mean(~(np.abs(a - wanted) <= 1e-5)) <= 1e-3


@pytest.mark.parametrize("layers", [1, 2])
def test_thickness_that_is_not_known_counts_as_none_given(
    runtime: Runtime, rng: np.random.Generator, layers: int
) -> None:
    gbuffer = two_layers(camera(size=(31, 39)), rng)
    unknown = np.full(gbuffer.depth.shape, -1.0, np.float32)[:layers]
    # With several layers less slack joins taps, see `BitmaskParams.beside_known`.
    params = BitmaskParams(radius=0.6, blur_radius=0).beside_known(layers)
    given = bitmask_ao(replace(gbuffer, thickness=unknown[0] if layers == 1 else unknown), 0.6, blur_radius=0)
    without = bitmask_ao(gbuffer, 0.6, thickness=params.thickness, slack=params.slack, blur_radius=0, runtime=runtime)
    np.testing.assert_array_equal(given, without)


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_solids_of_known_thickness_are_what_rays_meet(runtime: Runtime, kind: str, layers: int) -> None:
    # A bar floats before a wall, another stands on it.
    pytest.importorskip("embreex")
    wall = (6.0, 6.0, 0.5), (0.0, 0.0, -0.25)
    bars = ((0.3, 2.0, 0.3), (0.1, 0.2, 0.5)), ((0.2, 0.2, 1.2), (0.9, 0.1, 0.6))
    corners = []
    for extents, middle in (wall, *bars):
        mesh = trimesh.creation.box(extents)
        corners.append((mesh.vertices[mesh.faces] + middle).reshape(-1, 3))
    points = np.concatenate(corners)
    normals = np.repeat(np.cross(points[1::3] - points[::3], points[2::3] - points[::3]), 3, axis=0)
    made_of = scene_of(points, normals=normals / np.linalg.norm(normals, axis=1, keepdims=True))
    eye, target, size = (1.2, 1.6, 5.0), (0.4, 0.1, 0.0), (120, 160)
    if kind == "orthographic":
        made = Camera.orthographic(eye, target, view_height=2.6, width=size[1], height=size[0])
    else:
        made = Camera.look_at(eye, target, yfov=0.5, width=size[1], height=size[0])
    known = rasterized(made_of, made, layers=layers, thickness=True, runtime=runtime)
    truth = ray_ao(made_of, made, 0.8, 256)
    errors = [
        float(np.sqrt(np.mean((bitmask_ao(gbuffer, 0.8, slices=4, taps=24, runtime=runtime) - truth) ** 2)))
        for gbuffer in (known, replace(known, thickness=None))
    ]
    # .010 to .012 and .015 to .049: what is left is the noise of 8 sectors and 24 taps, blurred.
    assert errors[0] < 0.015
    assert errors[1] > 1.3 * errors[0]
