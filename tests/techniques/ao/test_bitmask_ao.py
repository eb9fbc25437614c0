"""Bitmask AO: its own parameters. Tests of all that scan slices: test_slices.py."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ao.bitmask_ao import bitmask_reference, turn
from ssgi_cl.techniques.ao.bitmask_ao import BitmaskParams, bitmask_ao

from ...closed_forms import hidden_by_wall
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
    ("joined", "end", "kind", "by_pixel"),
    [
        (True, "layer", "perspective", True),
        (False, "thickness", "perspective", False),
        *(
            pytest.param(joined, end, kind, True, marks=pytest.mark.slow)
            for kind in ("perspective", "orthographic")
            for joined in (True, False)
            for end in ("thickness", "layer")
        ),
    ],
)
def test_thickness_of_each_pixel_and_the_next_layer_agree_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, joined: bool, end: str, kind: str, by_pixel: bool
) -> None:
    gbuffer = two_layers(camera(kind, size=(31, 39)), rng, (2, 3))
    thickness = rng.uniform(0.0, 0.4, gbuffer.depth[0].shape).astype(np.float32)
    thickness[::5, ::3] = np.inf
    gbuffer = replace(gbuffer, thickness=thickness if by_pixel else None)
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


def test_even_thickness_is_that_of_the_parameter(runtime: Runtime) -> None:
    gbuffer = view_of("bumpy", size=(31, 39))
    own = replace(gbuffer, thickness=np.full(gbuffer.size, 0.25 * 0.6, np.float32))
    a, thick = (bitmask_ao(gbuffer, 0.6, thickness=share, blur_radius=0, runtime=runtime) for share in (0.25, 3.0))
    # The kernel agrees with the reference of each pixel's thickness, see above. One is a share of
    # the radius, the other scene units: they round differently.
    wanted = bitmask_reference(own, BitmaskParams(radius=0.6, thickness=3.0, blur_radius=0))
    assert np.mean(np.abs(a - wanted) > 1e-5) <= 2e-3
    assert np.abs(a - thick).max() > 0.05
