"""Multiresolution splatting as published: against float64, subsplats, convergence, bad input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.reference.multires.multires_published import multires_published_reference, subsplats, upsampled
from ssgi_cl.techniques.multires.multires_published import MultiresPublished, MultiresPublishedParams
from ssgi_cl.techniques.multires.multires_splat import multires_splat
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams

from ..analytic import CAMERAS, Plane, camera, scene, slow_but, tilted, trace
from ..vpl.given import assert_second_run_allocates_nothing, cornell_box, uploaded
from ..vpl.test_vpl_tree import lights
from .test_multires_splat import box, relative, spots, wall

Floats = NDArray[np.float32]

DEPTH, NORMAL = 0.02, 0.1
"""Thresholds that leave subsplats of several sizes in small images."""
FLIPS = 2e-3
"""Share of pixels that may differ more than by rounding: a variation next to a threshold may round
to either side of it."""


def splatted(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls, **params: Any) -> tuple[Floats, MultiresPublished]:
    """Return irradiance, and what made it."""
    chosen = MultiresPublishedParams(vpls=max(len(vpls), 1), **params)
    technique = MultiresPublished(runtime, gbuffer.size, chosen)
    return np.moveaxis(technique.run(uploaded(runtime, gbuffer), vpls).download(), 0, -1), technique


def full(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls) -> Floats:
    """Return the irradiance of the same lights at every pixel."""
    params = VplSplatParams(vpls=len(vpls), cutoff=0.0, refine=0.0, cull=False)
    technique = VplSplat(runtime, gbuffer.size, params)
    return np.moveaxis(technique.run(uploaded(runtime, gbuffer), vpls).download(), 0, -1)


# ---- against float64


@pytest.mark.parametrize("name", ["corner", *(pytest.param(name, marks=pytest.mark.slow) for name in ("ball", "step"))])
@pytest.mark.parametrize("margin", [(0, 0), (3, 5)], ids=str)
def test_every_kernel_variant_agrees_with_the_reference(
    variant_runtime: Runtime, rng: np.random.Generator, name: str, margin: tuple[int, int]
) -> None:
    gbuffer = scene(name, camera(size=(61, 87)), rng, margin=margin)
    vpls = lights(rng, 40)
    params = {"levels": 5, "depth_threshold": DEPTH, "normal_threshold": NORMAL}
    e, technique = splatted(variant_runtime, gbuffer, vpls, **params)
    wanted, kept = multires_published_reference(gbuffer, vpls, 5, DEPTH, NORMAL)
    assert sum(count > 0 for count in technique.counts()) >= 3
    assert [abs(a - b.sum()) <= 2 for a, b in zip(technique.counts(), kept, strict=True)] == ([True] * 5)
    # Measured 7e-6 of the mean at most; grazing lights are differences of float32 positions.
    off = (np.abs(e - wanted) > 1e-3 * wanted + 1e-4 * wanted.mean()).any(axis=-1)
    assert off.mean() <= FLIPS


@pytest.mark.parametrize("kind", slow_but(CAMERAS, "perspective", "orthographic"))
def test_the_reference_is_met_in_every_camera(runtime: Runtime, rng: np.random.Generator, kind: str) -> None:
    gbuffer, vpls = scene("bumpy", camera(kind), rng), lights(rng, 20)
    e, _ = splatted(runtime, gbuffer, vpls, levels=4, depth_threshold=0.1, normal_threshold=0.3)
    wanted, kept = multires_published_reference(gbuffer, vpls, 4, 0.1, 0.3)
    assert kept[1].any()
    off = (np.abs(e - wanted) > 1e-3 * wanted + 1e-4 * wanted.mean()).any(axis=-1)
    assert off.mean() <= FLIPS


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (33, 1), (17, 31), (16, 64)], ids=str)
@pytest.mark.parametrize("levels", [1, 3, 7])
def test_images_of_any_size(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int], levels: int
) -> None:
    gbuffer, vpls = scene("corner", camera(size=size), rng), lights(rng, 20)
    e, _ = splatted(variant_runtime, gbuffer, vpls, levels=levels, depth_threshold=0.2, normal_threshold=NORMAL)
    wanted, _ = multires_published_reference(gbuffer, vpls, levels, 0.2, NORMAL)
    np.testing.assert_allclose(e, wanted, rtol=1e-3, atol=1e-4 * wanted.mean())


def test_a_margin_and_deeper_layers_change_nothing(runtime: Runtime, rng: np.random.Generator) -> None:
    wide, vpls = scene("step", camera(size=(45, 61)), rng, margin=(3, 5)), lights(rng)
    depth, normal = np.asarray(wide.depth), np.asarray(wide.normal)
    inner = GBuffer(camera=wide.camera, depth=wide.inner(depth), normal=wide.inner(normal))
    layered = GBuffer(camera=wide.camera, depth=np.stack([depth, depth * 1.5]), normal=normal)
    one, other, deep = (splatted(runtime, g, vpls)[0] for g in (wide, inner, layered))
    # Positions round differently: columns count from the margin's.
    np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3 * other.mean())
    np.testing.assert_array_equal(one, deep)


# ---- subsplats


@pytest.mark.parametrize("size", [(128, 192), (100, 130)], ids=str)
def test_a_flat_wall_has_the_coarsest_subsplats_alone(variant_runtime: Runtime, size: tuple[int, int]) -> None:
    _, technique = splatted(variant_runtime, wall(size), spots([(0.0, 0.0)], 1.0))
    coarsest = -(-size[0] // 64) * -(-size[1] // 64)
    assert technique.counts() == [0] * 6 + [coarsest]


def test_every_pixel_with_a_surface_lies_in_one_subsplat(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(size=(90, 121)), rng)
    _, technique = splatted(variant_runtime, gbuffer, lights(rng, 5), depth_threshold=DEPTH, normal_threshold=0.4)
    there = np.isfinite(np.asarray(gbuffer.depth))
    assert not there.all()
    covered = np.zeros(there.shape, int)
    for level in technique._levels:
        kept = level.fractions.download()[0].astype(int)
        wide = kept.repeat(level.step, axis=0).repeat(level.step, axis=1)
        covered += wide[: there.shape[0], : there.shape[1]]
    np.testing.assert_array_equal(covered, there.astype(int))
    steps = technique.computed()
    assert set(np.unique(steps[there])) >= {1, 2, 4}
    np.testing.assert_array_equal(steps > 0, there)


def test_edges_of_depth_and_of_normals_are_refined(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("step", camera(size=(96, 128)), rng)
    _, technique = splatted(variant_runtime, gbuffer, lights(rng, 5), depth_threshold=0.05, normal_threshold=NORMAL)
    depth, normal = np.asarray(gbuffer.depth), np.asarray(gbuffer.normal)
    steps = technique.computed()
    # Pixels beside another surface are subsplats of their own, whichever block border they lie at.
    jump = np.abs(np.diff(depth, axis=1)) > 0.2 * depth[:, 1:]
    assert jump.sum() > 50
    assert (steps[:, 1:][jump] == 1).all()
    assert (steps[:, :-1][jump] == 1).all()
    assert steps.max() >= 8
    # A roof: no jump of depth, normals turn. One over and one upright fold.
    for axis in (0, 1):
        across = np.eye(3)[1 - axis]
        sides = [Plane((0, 0, 0), sign * 0.5 * across + (0, 0, 1), (sign * across, 0.0)) for sign in (1.0, -1.0)]
        roof = trace(camera("orthographic", (96, 128), eye=(0, 0, 5), target=(0, 0, 0)), sides)
        _, technique = splatted(variant_runtime, roof, lights(rng, 5), depth_threshold=10.0, normal_threshold=NORMAL)
        steps = technique.computed()
        normal = np.asarray(roof.normal)
        turn = np.abs(np.diff(normal, axis=axis)).max(axis=-1) > 0.5
        ends = (steps[1:], steps[:-1]) if axis == 0 else (steps[:, 1:], steps[:, :-1])
        assert turn.any()
        for end in ends:
            assert (end[turn] == 1).all()
        assert steps.max() >= 16


def test_thresholds_are_stricter_for_coarser_levels() -> None:
    params = MultiresPublishedParams(depth_threshold=0.3)
    limits = [params.depth_limit(level) for level in range(7)]
    assert limits[0] == math.inf
    np.testing.assert_allclose(limits[1:], [0.9, 0.45, 0.3, 0.225, 0.18, 0.15])


def test_a_tilted_wall_is_refined_where_its_depth_varies_more(runtime: Runtime) -> None:
    view = camera(size=(128, 128))
    counts = []
    for degrees in (20.0, 60.0):
        gbuffer = trace(view, [tilted(view, degrees)])
        _, technique = splatted(runtime, gbuffer, spots([(0.0, 0.0)], 1.0))
        counts.append(sum(technique.counts()))
        kept = subsplats(SurfaceView.of(gbuffer), 7, 0.1 / 16.0, 0.1)
        assert abs(counts[-1] - sum(level.sum() for level in kept)) <= 6
    assert counts[0] < counts[1]


# ---- light


def test_constant_light_stays_constant(variant_runtime: Runtime) -> None:
    # A light so far away that float32 sees no difference over the wall, and an edge in it.
    vpls = spots([(0.0, 0.0)], 1e4, 1e8)
    view = camera("orthographic", size=(96, 128), eye=(0, 0, 3), target=(0, 0, 0))
    near = Plane((0, 0, 0.5), (0, 0, 1), ((1.0, 0.3, 0.0), 0.2))
    gbuffer = trace(view, [Plane((0, 0, 0), (0, 0, 1)), near])
    e, technique = splatted(variant_runtime, gbuffer, vpls)
    assert sum(count > 0 for count in technique.counts()) > 3
    every = full(variant_runtime, gbuffer, vpls)
    # Its direction differs by (2 / 1e4)^2, the two walls' distances by 5e-5.
    np.testing.assert_allclose(e, np.broadcast_to(e[0, 0], e.shape), rtol=2e-4)
    np.testing.assert_allclose(e, every, rtol=2e-4)
    flat = wall()
    e, _ = splatted(variant_runtime, flat, vpls, levels=5)
    one = full(variant_runtime, flat, vpls)
    assert np.ptp(e) <= np.ptp(one)  # interpolation adds no rounding of its own


def test_one_level_is_full_shooting(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("ball", camera(size=(61, 87)), rng, margin=(3, 5)), lights(rng, 150)
    e, technique = splatted(variant_runtime, gbuffer, vpls, levels=1)
    np.testing.assert_array_equal(e, full(variant_runtime, gbuffer, vpls))
    assert technique.counts() == [int(np.isfinite(gbuffer.inner(np.asarray(gbuffer.depth))).sum())]


def test_many_lights_come_in_batches(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("ball", camera(size=(20, 31)), rng), lights(rng, 3000)
    e, _ = splatted(runtime, gbuffer, vpls, levels=1)
    np.testing.assert_array_equal(e, full(runtime, gbuffer, vpls))


def test_light_converges_to_full_shooting_as_thresholds_fall(runtime: Runtime) -> None:
    # From beside, as a threshold of 0 refines no wall that is parallel to the image.
    def aside(made: Any) -> Camera:
        eye = np.add(made.eye, (0.1, 0.05, 0.0))
        return Camera.look_at(eye, made.target, made.up, yfov=made.yfov, width=112, height=84)

    gbuffer, vpls = box(runtime, aside, 256)
    every = full(runtime, gbuffer, vpls)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    errors, counts = [], []
    for share in (16.0, 4.0, 1.0, 0.25, 0.0):
        e, technique = splatted(
            runtime, gbuffer, vpls, depth_threshold=0.1 / 16.0 * share, normal_threshold=min(0.1 * share, 2.0)
        )
        errors.append(relative(e - every, every, seen))
        counts.append(sum(technique.counts()))
    assert counts == sorted(counts)
    assert errors == sorted(errors, reverse=True)
    # All light is there; what is left is the interpolation's last pass over 3 x 3 pixels.
    nothing = np.zeros((42, 56), np.bool_)
    filtered, _ = upsampled(np.zeros((42, 56, 3)), nothing, every, seen)
    np.testing.assert_allclose(e, filtered, rtol=1e-5, atol=1e-6 * every.mean())
    # Measured: 0.38, 0.108, 0.100, 0.098, 0.093 of the mean, with 1294 to 6410 subsplats.
    assert errors[-1] < 0.3 * errors[0]


def test_lights_of_maps_are_those_of_splatting(runtime: Runtime) -> None:
    from ssgi_cl.techniques.vpl.vpl_splat import vpl_splat

    gbuffer, seen = cornell_box(runtime, 80, 60, 64)
    params = {"vpls": 300, "runtime": runtime}
    e = multires_splat(gbuffer, [seen, seen], method="published", levels=1, **params)
    every = vpl_splat(gbuffer, [seen, seen], cutoff=0.0, refine=0.0, cull=False, **params)
    np.testing.assert_array_equal(e, every)


# ---- nothing, and bad input


def test_nothing_seen_and_no_light_give_nothing(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    view = camera(size=(37, 53))
    nothing = GBuffer(camera=view, depth=np.full((37, 53), np.inf))
    e, technique = splatted(variant_runtime, nothing, lights(rng, 5))
    assert not e.any()
    assert not any(technique.counts())
    assert not multires_splat(wall(), [], method="published", runtime=variant_runtime).any()


def test_second_call_allocates_and_builds_nothing(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = uploaded(variant_runtime, scene("ball", camera(), rng)), lights(rng, 20)
    technique = MultiresPublished(variant_runtime, gbuffer.size, MultiresPublishedParams(vpls=20))
    assert_second_run_allocates_nothing(variant_runtime, lambda: technique.run(gbuffer, vpls))


def test_a_gbuffer_of_another_size_is_refused(runtime: Runtime) -> None:
    technique = MultiresPublished(runtime, (8, 8))
    with pytest.raises(ValueError, match=r"the G-buffer's size is \(96, 128\): expected \(8, 8\)"):
        technique.run(uploaded(runtime, wall()), spots([(0.0, 0.0)], 1.0))
