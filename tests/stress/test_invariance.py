"""Invariants of results: scale, sides, constants, occluders, energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.filters.bilateral import bilateral_blur
from ssgi_cl.techniques.filters.upsample import coarse_size, upsample
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.ssdo.ssdo import ssdo
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams

from ..techniques.analytic import camera, scene
from .inputs import gbuffers, hdr, radii, seeds
from .test_finite import examples, nothing

OCCLUSION: dict[str, Callable[..., Any]] = {name: each.function for name, each in of_kind("ao").items()}
every_occlusion = pytest.mark.parametrize("name", OCCLUSION)

PATTERN = 0.01
"""By which the mean A of some thousand pixels may change where the pattern of samples lies another
way: it is the same for all tiles of 4 x 4 pixels, and 16 pixels of it are not symmetric."""


# ---- scale


@pytest.mark.slow
@every_occlusion
@examples(20)
@given(exponent=st.integers(-80, 80), orthographic=st.booleans())
def test_scale_of_the_world_does_not_matter(runtime: Runtime, name: str, exponent: int, orthographic: bool) -> None:
    kind, scale = "orthographic" if orthographic else "perspective", 2.0**exponent
    small = scene("corner", camera(kind), np.random.default_rng(1))
    large = GBuffer(
        camera=camera(kind, scale=scale), depth=np.asarray(small.depth) * np.float32(scale), normal=small.normal
    )
    one = OCCLUSION[name](small, 0.5, runtime=runtime)
    other = OCCLUSION[name](large, 0.5 * scale, runtime=runtime)
    # Powers of two change no digit, but for limits that are not of the world.
    assert np.mean(np.abs(one - other) > 1e-4) < 0.01


# ---- sides


def seen_from_the_front(depth: NDArray[Any]) -> GBuffer:
    """Return a G-buffer of a camera that looks down -z; its normals are those of the depth."""
    rows, columns = depth.shape
    made = Camera.look_at((0, 0, 0), (0, 0, -1), width=columns, height=rows)
    return GBuffer(camera=made, depth=depth)


def hills(rng: np.random.Generator, side: int = 64) -> NDArray[np.float64]:
    """Return depths of balls in front of a wall."""
    y, x = np.indices((side, side)) / side
    depth = np.full((side, side), 4.0)
    for _ in range(12):
        away = np.hypot(x - rng.random(), y - rng.random()) / rng.uniform(0.05, 0.2)
        top = rng.uniform(2.0, 3.5)
        ball = top - 0.4 * np.sqrt(np.maximum(1.0 - away**2, 0.0))
        depth = np.where(away < 1.0, np.minimum(depth, ball), depth)
    return depth


@pytest.mark.slow
@every_occlusion
@examples(10)
@given(seed=seeds)
def test_a_mirrored_or_turned_world_is_as_open(runtime: Runtime, name: str, seed: int) -> None:
    depth = hills(np.random.default_rng(seed))
    ways = (depth, depth[:, ::-1], depth[::-1], np.rot90(depth))
    means = [float(OCCLUSION[name](seen_from_the_front(way), 0.5, runtime=runtime).mean()) for way in ways]
    np.testing.assert_allclose(means[1:], means[0], atol=PATTERN)


# ---- constants


@examples(20)
@given(gbuffer=gbuffers(), step=st.sampled_from((1, 2, 4)), exponent=st.integers(-60, 60))
def test_a_constant_stays_what_it_is_upsampled(runtime: Runtime, gbuffer: GBuffer, step: int, exponent: int) -> None:
    constant = np.float32(2.0**exponent)
    image = np.full((*coarse_size(gbuffer.size, step), 3), constant)
    found = upsample(image, gbuffer, step=step, runtime=runtime)
    # Sum and sum of weights are rounded alike, as the constant is a power of two.
    assert (found[~nothing(gbuffer)] == constant).all()


@pytest.mark.slow
@examples(50)
@given(gbuffer=gbuffers(), separable=st.booleans(), exponent=st.integers(-60, 60))
def test_a_constant_stays_what_it_is_blurred(
    runtime: Runtime, gbuffer: GBuffer, separable: bool, exponent: int
) -> None:
    image = np.full((*gbuffer.size, 3), np.float32(2.0**exponent))
    found = bilateral_blur(image, gbuffer, separable=separable, runtime=runtime)
    np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize("step", [2, 4])
def test_where_no_neighbour_fits_the_best_counts_alone(runtime: Runtime, step: int) -> None:
    # Cliffs everywhere, each normal another way: some weights are tiny, but none is 0.
    rng = np.random.default_rng(718)
    size = (24, 32)
    made = Camera.orthographic((0, 0, 2), (0, 0, 0), view_height=1.0, width=size[1], height=size[0])
    gbuffer = GBuffer(camera=made, depth=10.0 ** rng.uniform(-0.01, 0.01, size), normal=rng.standard_normal((*size, 3)))
    found = upsample(np.ones(coarse_size(size, step)), gbuffer, step=step, runtime=runtime)
    assert (found == 1.0).all()


# ---- occluders


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ssao", "hbao", "gtao"])
@examples(30)
@given(seed=seeds, filled=st.floats(0.01, 0.5))
def test_an_occluder_in_empty_space_opens_nothing(runtime: Runtime, name: str, seed: int, filled: float) -> None:
    # A pixel of these is the more occluded the higher its highest horizons are, or the more points
    # lie behind something. With an orthographic camera, what others look at stays the same. (The
    # bitmask joins neighbouring taps, so that a new one may part what was one surface.)
    rng = np.random.default_rng(seed)
    size = (24, 40)
    made = Camera.orthographic((0, 0, 2), (0, 0, 0), view_height=1.0, width=size[1], height=size[0])
    depth = rng.uniform(1.0, 3.0, size)
    before = np.where(rng.random(size) < 0.5, depth, np.inf)
    after = np.where(rng.random(size) < filled, depth, before)
    normal = rng.standard_normal((*size, 3))
    normal[..., 2] = np.abs(normal[..., 2])  # else depth tells which of them to turn round
    options: dict[str, Any] = {"blur_radius": 0, "runtime": runtime}
    options |= {"hbao": {"attenuation": 0.0}, "ssao": {"outside": "open"}}.get(name, {})
    one, other = (
        OCCLUSION[name](GBuffer(camera=made, depth=own, normal=normal), 0.5, **options) for own in (before, after)
    )
    there = np.isfinite(before)
    assert (other[there] <= one[there] + 1e-6).all()  # some roundings


# ---- energy


@pytest.mark.slow
@pytest.mark.parametrize("technique", ["vpl_splat", "multires_splat", "rsm_gather"])
@examples(20)
@given(seed=seeds, near=st.sampled_from(("disk", "clamped")))
def test_a_plane_gets_no_more_light_than_is_sent(runtime: Runtime, technique: str, seed: int, near: str) -> None:
    # Pixels of 1/32; lights at least two of them away, so that pixel centres sum as the plane does.
    size = (64, 64)
    made = Camera.orthographic((0, 0, 5), (0, 0, 0), view_height=2.0, width=64, height=64)
    normal = np.broadcast_to((0.0, 0.0, 1.0), (*size, 3))
    gbuffer = on_device(GBuffer(camera=made, depth=np.full(size, 5.0), normal=normal), runtime)
    rng = np.random.default_rng(seed)
    way = rng.standard_normal((20, 3))
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    flux = 10.0 ** rng.uniform(-4.0, 4.0, (20, 3))
    if technique == "rsm_gather":
        # A map of 4 x 5 texels whose light comes from above.
        seen = Camera.orthographic((0, 0, 2), (0, 0, 0), view_height=2.0, width=5, height=4)
        depth = 2.0 - rng.uniform(1 / 16, 1.0, (4, 5))
        rsm = ReflectiveShadowMap(
            light=DirectionalLight((0, 0, -1), 1.0),
            camera=seen,
            depth=depth,
            position=seen.unproject(depth),
            normal=way.reshape(4, 5, 3),
            flux=flux.reshape(4, 5, 3),
        )
        irradiance = rsm_gather(gbuffer, rsm, pattern="all", runtime=runtime)
    else:
        vpls = Vpls(
            rng.uniform((-1.0, -1.0, 1 / 16), (1.0, 1.0, 1.0), (20, 3)), way, flux, 10.0 ** rng.uniform(-6.0, 0.0, 20)
        )
        made_of: Any
        if technique == "vpl_splat":
            made_of = VplSplat(runtime, size, VplSplatParams(vpls=20, cutoff=0.0, near=near))
        else:
            made_of = MultiresSplat(runtime, size, MultiresSplatParams(vpls=20, near=near))
        irradiance = np.moveaxis(made_of.run(gbuffer, vpls).download(), 0, -1)
    received = irradiance.sum(axis=(0, 1), dtype=np.float64) / 32**2
    assert (received <= 1.02 * flux.sum(axis=0)).all()  # what multires_splat may err, twice


@pytest.mark.slow
@examples(40)
@given(gbuffer=gbuffers(), radius=radii, seed=seeds)
def test_surfaces_get_no_more_than_the_brightest_sends(
    runtime: Runtime, gbuffer: GBuffer, radius: float, seed: int
) -> None:
    sent = hdr(np.random.default_rng(seed), (*np.shape(gbuffer.first("depth")), 3))
    sky = 0.5
    direct, bounce = ssdo(
        gbuffer, [Environment(sky)], radius, radiance=sent, runtime=runtime, slices=1, taps=4, samples=4, shadow_taps=4
    )
    # All sectors together are the hemisphere, whose cosines sum to pi.
    assert direct.max() <= math.pi * sky * (1.0 + 1e-5)
    assert bounce.max() <= math.pi * sent.max() * (1.0 + 1e-5)
