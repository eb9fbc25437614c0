"""Multiresolution splatting: against all lights at all pixels, limits, seams, bad input."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import box_corners
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.rsm import on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.multires.multires_splat import multires_splat_reference
from ssgi_cl.reference.occupancy.occupancy_grid import OccupancyGridReference
from ssgi_cl.reference.vpl.vpl_splat import receivers, vpl_splat_reference
from ssgi_cl.reference.vpl.vpl_tree import VplTreeReference
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams, multires_splat
from ssgi_cl.techniques.vpl.vpl_choice import choose_vpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplatParams, vpl_splat
from ssgi_cl.techniques.vpl.vpl_tree import GROUP, SHARES
from ssgi_cl.truth import one_bounce

from ..analytic import Plane, camera, scene, slow_but, trace
from ..vpl.given import (
    NO_LIGHTS,
    assert_no_light_where_nothing_is,
    assert_second_run_allocates_nothing,
    assert_what_does_not_fit_is_refused,
    cornell_box,
    in_view,
    lit_scene,
    uploaded,
    walls_between,
)
from ..vpl.test_vpl_tree import lights

Floats = NDArray[np.float32]


def splatted(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls, **params: Any) -> tuple[Floats, MultiresSplat]:
    """Return irradiance, and what made it."""
    chosen = MultiresSplatParams(**{"vpls": max(len(vpls), 1), **params})
    technique = MultiresSplat(runtime, gbuffer.size, chosen)
    return np.moveaxis(technique.run(uploaded(runtime, gbuffer), vpls).download(), 0, -1), technique


def full(gbuffer: GBuffer, vpls: Vpls) -> NDArray[np.float64]:
    return vpl_splat_reference(gbuffer, vpls, VplSplatParams(cutoff=0.0))


def relative(off: NDArray[Any], image: NDArray[Any], seen: NDArray[np.bool_]) -> float:
    """Root of the mean square of a difference, relative to the mean of an image."""
    return math.sqrt(np.mean(off[seen] ** 2)) / float(image[seen].mean())


def box(runtime: Runtime, camera_of: Any = None, count: int = 1024) -> tuple[GBuffer, Vpls]:
    made = BUILTIN_SCENES["cornell_box"]()
    view = camera_of(made) if camera_of else made.camera(160, 120)
    seen = rsm(made.scene, made.lights[0], size=256, runtime=runtime)  # type: ignore[arg-type]
    return drawn(made.scene, view, runtime=runtime), choose_vpls(seen, count, runtime=runtime)


def wall(size: tuple[int, int] = (96, 128)) -> GBuffer:
    """A wall z = 0 of 4 high, seen from the front."""
    view = camera("orthographic", size=size, eye=(0, 0, 3), target=(0, 0, 0))
    return trace(view, [Plane((0, 0, 0), (0, 0, 1))])


def spots(at: Any, height: float, flux: float = 1.0) -> Vpls:
    """Lights above points (x, y) of that wall, which look at it."""
    position = np.concatenate([np.asarray(at), np.full((len(at), 1), height)], axis=1)
    return Vpls(position, np.tile([0.0, 0.0, -1.0], (len(at), 1)), np.full((len(at), 3), flux), np.full(len(at), 1e-3))


# ---- against all lights at all pixels


@pytest.mark.parametrize("margin", [(0, 0), (3, 5)], ids=str)
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (17, 31)], ids=str)
def test_every_kernel_variant_has_all_light_where_every_pixel_is_computed(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int], margin: tuple[int, int]
) -> None:
    gbuffer, vpls = scene("corner", camera(size=size), rng, margin=margin), lights(rng, 50)
    e, technique = splatted(variant_runtime, gbuffer, vpls, coarsest=1, light_error=0.0)
    wanted = full(gbuffer, vpls)
    # A few roundings of 2^-24; grazing lights are differences of float32 positions.
    np.testing.assert_allclose(e, wanted, rtol=1e-3, atol=1e-5 * wanted.mean())
    there = np.isfinite(gbuffer.inner(np.asarray(gbuffer.depth)))
    assert sum(technique.grid.counts().values()) == there.sum()


def test_a_margin_changes_nothing(runtime: Runtime, rng: np.random.Generator) -> None:
    wide, vpls = scene("ball", camera(size=(45, 61)), rng, margin=(3, 5)), lights(rng)
    inner = GBuffer(
        camera=wide.camera, depth=wide.inner(np.asarray(wide.depth)), normal=wide.inner(np.asarray(wide.normal))
    )
    one, other = (splatted(runtime, gbuffer, vpls)[0] for gbuffer in (wide, inner))
    # Positions round differently: columns count from the margin's.
    np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3 * other.mean())


@pytest.mark.parametrize("params", [{}, {"cutoff": 0.2}, {"near": "clamped", "coarsest": 8}])
def test_kernels_agree_with_numpy_reference(runtime: Runtime, rng: np.random.Generator, params: dict[str, Any]) -> None:
    gbuffer, vpls = scene("ball", camera(size=(61, 87)), rng), lights(rng, 100)
    e, technique = splatted(runtime, gbuffer, vpls, light_error=0.0, **params)
    mean = float(technique.tree.limits.download()[0]) / technique.params.interpolation_error
    wanted, steps = multires_splat_reference(gbuffer, vpls, technique.params, mean)
    computed = technique.grid.computed()
    assert 0.02 < np.mean(steps > 0) < 0.8
    # An error next to the bound may round to either side of it, which moves what lies around.
    assert np.mean(computed != steps) < 0.01
    close = np.abs(e - wanted) < 1e-3 * (wanted + 0.1 * wanted.mean())
    assert np.mean(close) > 0.98
    both = (computed > 0) & (steps > 0)
    np.testing.assert_allclose(e[both], wanted[both], rtol=1e-3, atol=1e-5 * wanted.mean())


@pytest.mark.parametrize("count", [200, 300, 1024])
def test_errors_are_shares_of_the_mean_with_few_lights_and_many(runtime: Runtime, count: int) -> None:
    gbuffer, vpls = box(runtime, count=count)
    e, technique = splatted(runtime, gbuffer, vpls)
    seen = np.isfinite(gbuffer.inner(np.asarray(gbuffer.depth)))
    mean = float(technique.tree.limits.download()[0]) / technique.params.interpolation_error
    # The points of the coarsest level are few, and runs are not their lights: 5 % here.
    np.testing.assert_allclose(mean, e[seen].mean(), rtol=0.15)


@pytest.mark.parametrize("name", [pytest.param("hall", marks=pytest.mark.slow), "cornell_box"])
def test_few_pixels_and_few_lights_are_close_to_all(runtime: Runtime, name: str) -> None:
    gbuffer, vpls = lit_scene(runtime, name, 320, 240)
    every, _ = splatted(runtime, gbuffer, vpls, coarsest=1, light_error=0.0)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    errors, pixels = [], []
    for error in (0.005, 0.01, 0.04):
        e, technique = splatted(runtime, gbuffer, vpls, interpolation_error=error, light_error=0.5 * error)
        errors.append(relative(e - every, every, seen))
        pixels.append(sum(technique.grid.counts().values()))
    # The error is estimated, not bounded: at corners light bends more than samples can tell.
    assert errors[0] < errors[1] < errors[2]
    assert errors[1] < 0.015
    assert pixels[0] > pixels[1] > pixels[2]


# ---- light that is easy or hard to interpolate


def test_constant_light_stays_constant(variant_runtime: Runtime) -> None:
    # A light so far away that float32 sees no difference over the wall.
    e, technique = splatted(variant_runtime, wall(), spots([(0.0, 0.0)], 1e4, 1e8))
    # Its direction differs by (2 / 1e4)^2.
    np.testing.assert_allclose(e, np.broadcast_to(e[48, 64], e.shape), rtol=1e-6)
    # The coarsest level is complete, with the last column and row of no finer one.
    assert technique.grid.counts() == {16: 48, 8: 0, 4: 0, 2: 0, 1: 0}


def test_sharp_light_on_a_flat_wall_is_not_blurred(runtime: Runtime) -> None:
    # Hot spots two to six pixels wide, between the points of the coarsest level.
    at = [(0.13, 0.21), (-0.71, 0.43), (0.9, -0.66)]
    sharp_spots, wide = spots(at, 0.25, 1e-2), spots([(0.0, 0.0)], 3.0, 10.0)
    both = ((v.position, v.normal, v.flux, v.area) for v in (sharp_spots, wide))
    gbuffer, vpls = wall(), Vpls(*map(np.concatenate, zip(*both, strict=True)))
    wanted = full(gbuffer, vpls)
    seen = np.ones(wanted.shape[:2], np.bool_)
    sharp, technique = splatted(runtime, gbuffer, vpls, interpolation_error=0.01)
    blurred, coarse = splatted(runtime, gbuffer, vpls, interpolation_error=1e6)
    assert relative(sharp - wanted, wanted, seen) < 0.01
    assert relative(blurred - wanted, wanted, seen) > 3.0 * relative(sharp - wanted, wanted, seen)
    assert sum(coarse.grid.counts().values()) < sum(technique.grid.counts().values()) < 4000


def test_a_camera_that_moves_by_a_hundredth_pixel_changes_little(runtime: Runtime) -> None:
    def moved(pixels: float) -> Any:
        def camera_of(made: Any) -> Camera:
            view = made.camera(160, 120)
            projection = view.projection.copy()
            projection[0, 2] += 2.0 * pixels / 160
            return replace(view, projection=projection)

        return camera_of

    found = []
    for pixels in (0.0, 0.01):
        gbuffer, vpls = box(runtime, moved(pixels))
        e, _ = splatted(runtime, gbuffer, vpls)
        found.append((e, np.asarray(gbuffer.depth), full_on_device(runtime, gbuffer, vpls)))
    (a, depth, a_full), (b, other, b_full) = found
    mean = a[np.isfinite(depth)].mean()
    # Where the same surface is seen and all lights themselves change little.
    same = np.abs(1.0 / depth - 1.0 / other) < 1e-3
    calm = np.abs(a_full - b_full).max(axis=-1) < 0.002 * mean
    change = np.abs(a - b).max(axis=-1)[same & calm]
    # Measured: 0.001 and 0.0012. A pixel that is computed in one image and not in the other jumps
    # by the error of its interpolation, which is estimated, not bounded.
    assert np.mean(change > 0.01 * mean) < 0.002
    assert math.sqrt(np.mean(change**2)) < 0.002 * mean


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hall", "cornell_box"])
def test_a_path_of_sixty_frames_pops_little_more_than_all_lights_at_all_pixels(runtime: Runtime, name: str) -> None:
    made = BUILTIN_SCENES[name]()
    view = made.camera(320, 240)
    punctual_lights = [light for light in made.lights if type(light).__name__ != "Environment"]
    maps = [rsm(made.scene, punctual_light, size=256, runtime=runtime) for punctual_light in punctual_lights]  # type: ignore[arg-type]
    vpls = choose_vpls(maps, 1024, runtime=runtime)
    kinds = [
        MultiresSplat(runtime, view.size, params)
        for params in (MultiresSplatParams(), MultiresSplatParams(coarsest=1, light_error=0.0))
    ]
    before: tuple[Any, ...] | None = None
    fractions = []
    for frame in range(60):
        projection = view.projection.copy()
        projection[0, 2] += 2.0 * 0.01 * frame / view.width
        gbuffer = drawn(made.scene, replace(view, projection=projection), runtime=runtime)
        device, near = uploaded(runtime, gbuffer), 1.0 / np.asarray(gbuffer.depth)
        images = [np.moveaxis(kind.run(device, vpls).download(), 0, -1) for kind in kinds]
        if before is not None:
            same = (near > 0.0) & (np.abs(near - before[0]) < 1e-3 * near)
            mean = images[1][near > 0.0].mean()
            few, every = (np.abs(one - other).max(axis=-1) / mean for one, other in zip(images, before[1], strict=True))
            calm = few[same & (every < 0.002)]
            changes = ((few[same], 0.01), (every[same], 0.01), (calm, 0.01), (calm, 0.02), (calm, 0.05))
            fractions.append([np.mean(jumps > limit) for jumps, limit in changes])
        before = near, images
    # Measured in the Cornell box and the hall: 0.0024 and 0.0249 of the pixels change by more than
    # a hundredth of the mean, where with all lights at all pixels it is 0.0019 and 0.0239. Of those
    # that are calm then 0.0004 and 0.0009 do; more than 0.02: 0.00014 and 0.00036, than 0.05:
    # 0.00002 and 0.0001. Most lie next to a point that shows another surface, or light that jumps.
    few_change, every_change, *interior_changes = np.mean(fractions, axis=0)
    assert few_change < 1.4 * every_change
    assert (np.array(interior_changes) < (0.0015, 0.0006, 0.0002)).all()


def full_on_device(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls) -> Floats:
    return splatted(runtime, gbuffer, vpls, coarsest=1, light_error=0.0)[0]


def test_parts_bring_light_near_its_receivers_closer_to_all_texels(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 160, 120, 256)
    every = vpl_splat(gbuffer, seen, 1 << 16, 0.0, runtime=runtime)
    found = [
        multires_splat(gbuffer, seen, 1024, 0.005, light_error=0.001, refine=r, runtime=runtime) for r in (4.0, 0.0)
    ]
    rmse = [math.sqrt(np.mean((e - every) ** 2)) for e in found]
    off = [float(e.mean() / every.mean()) - 1.0 for e in found]
    # Measured: 0.45 and 0.46 times.
    assert rmse[0] < 0.6 * rmse[1]
    assert abs(off[0]) < 0.6 * abs(off[1])


# ---- walls


@pytest.fixture(scope="module")
def walled(runtime: Runtime) -> tuple[GBuffer, Any, Vpls]:
    """The Cornell box with two layers, its light's map, and lights from it."""
    gbuffer, seen = cornell_box(runtime, 72, 54, 64, layers=2, overscan=0.1)
    return gbuffer, seen, choose_vpls(seen, 500, runtime=runtime)


def receivers_and_walls(
    walled: tuple[GBuffer, Any, Vpls], cells: int
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64], OccupancyGridReference]:
    """Return which pixels show a surface, position and normal of each in view space, and walls."""
    gbuffer, seen, vpls = walled
    there, point, normal = receivers(gbuffer)
    walls = walls_between(gbuffer, seen, vpls, cells)
    return there, in_view(gbuffer, point), normal @ gbuffer.camera.view[:3, :3].T, walls


# Of 4 lights in a square all are as near to the mean, and rounding decides which one is taken.
@pytest.mark.parametrize("share", slow_but(SHARES[1:], SHARES[1]))
def test_lines_of_sight_agree_with_numpy_reference(
    variant_runtime: Runtime, walled: tuple[GBuffer, Any, Vpls], share: int
) -> None:
    gbuffer, seen, vpls = walled
    params = MultiresSplatParams(vpls=500, coarsest=1, light_error=0.0, visibility=True, grid=32, share=share)
    technique = MultiresSplat(variant_runtime, gbuffer.size, params)
    device, map_ = uploaded(variant_runtime, gbuffer), on_device_rsm(seen, variant_runtime)
    e = np.moveaxis(technique.run(device, vpls, rsms=[map_]).download(), 0, -1)
    there, point, normal, walls = receivers_and_walls(walled, params.grid)
    tree = VplTreeReference(vpls, gbuffer.camera)
    every = np.arange(tree.count)
    wanted = np.zeros_like(e, np.float64)
    wanted[there] = tree.irradiance(every, point, normal, walls, share)
    # A point on the side of a cell may be in either: 1 of some 30 lines of a pixel then differs.
    assert np.mean(np.abs(e - wanted).max(axis=-1) > 1e-3 * wanted.mean()) < 0.03
    assert e.mean() == pytest.approx(wanted.mean(), rel=1e-3)
    assert wanted.mean() < 0.95 * full(gbuffer, vpls).mean()


def test_orthographic_lines_of_sight_agree_too(runtime: Runtime) -> None:
    # Rays that start in an occupied cell start towards the eye, which then is nowhere.
    made = BUILTIN_SCENES["cornell_box"]()
    seen = rsm(made.scene, made.lights[0], size=64, runtime=runtime)  # type: ignore[arg-type]
    view = Camera.orthographic(made.eye, made.target, view_height=1.1, width=40, height=30, near=0.01)
    gbuffer = drawn(made.scene, view, runtime=runtime)
    vpls = choose_vpls(seen, 500, runtime=runtime)
    test_lines_of_sight_agree_with_numpy_reference(runtime, (gbuffer, seen, vpls), 16)


@pytest.mark.parametrize("light_error", [6.0, 0.7])
def test_the_less_light_the_more_lights_share_a_ray(
    variant_runtime: Runtime, walled: tuple[GBuffer, Any, Vpls], light_error: float
) -> None:
    gbuffer, seen, vpls = walled
    params = MultiresSplatParams(
        vpls=500, coarsest=1, interpolation_error=0.0, light_error=light_error, visibility=True, grid=32
    )
    technique = MultiresSplat(variant_runtime, gbuffer.size, params)
    device, map_ = uploaded(variant_runtime, gbuffer), on_device_rsm(seen, variant_runtime)
    e = np.moveaxis(technique.run(device, vpls, rsms=[map_]).download(), 0, -1)
    there, point, normal, walls = receivers_and_walls(walled, params.grid)
    ((rows, columns),) = (level.listed().T for level in technique.grid._levels)
    order = (np.cumsum(there.ravel()) - 1).reshape(there.shape)[rows, columns]
    point, normal = point[order], normal[order]
    tree = VplTreeReference(vpls, gbuffer.camera)
    groups = -(-len(point) // GROUP)
    wanted, alone, kinds = [], [], []
    lists = technique.tree
    listed = zip(lists.cuts(groups), lists.shared(groups), lists.bright(groups), strict=True)
    for number, (records, shared, bright) in enumerate(listed):
        own = slice(number * GROUP, (number + 1) * GROUP)
        given = records, point[own], normal[own], walls
        wanted.append(tree.irradiance(*given, shared=shared, bright=bright))
        alone.append(tree.irradiance(*given))
        kinds.append(shared if light_error > 1.0 else bright)
    light, found = np.concatenate(wanted), e[rows, columns]
    off = np.abs(found - light).max(axis=-1) > 1e-3 * light.mean()
    # A point on the side of a cell may be in either: 1 of some 10 lines of a pixel then differs.
    assert np.mean(off) < 0.03
    assert 0.1 < np.mean(np.concatenate(kinds)) < 0.95
    # With as many lights to every ray it would be another light.
    other = np.abs(np.concatenate(alone) - light).max(axis=-1) > 1e-3 * light.mean()
    assert np.mean(other) > 0.1


def test_walls_take_light_away_alone_and_in_bit_identical_results_again(
    variant_runtime: Runtime, walled: tuple[GBuffer, Any, Vpls]
) -> None:
    gbuffer, seen, vpls = walled
    device, map_ = uploaded(variant_runtime, gbuffer), on_device_rsm(seen, variant_runtime)
    made = []
    for visibility in (False, True, True):
        params = MultiresSplatParams(vpls=500, coarsest=1, light_error=0.01, visibility=visibility, grid=32)
        technique = MultiresSplat(variant_runtime, gbuffer.size, params)
        made.append(technique.run(device, vpls, rsms=[map_]).download())
    np.testing.assert_array_equal(made[1], made[2])
    assert (made[1] <= made[0]).all()
    assert 0.5 < made[1].sum() / made[0].sum() < 0.95


def test_where_nothing_shone_the_grid_spans_the_scene(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    device = uploaded(runtime, drawn(made.scene, made.camera(40, 30), runtime=runtime))
    found = MultiresSplat(runtime, device.size, MultiresSplatParams(visibility=True, grid=32)).block(device, made.scene)
    assert device.camera is not None
    corners = box_corners(made.scene.bounds) @ device.camera.view[:3, :3].T + device.camera.view[:3, 3]
    box = found.box.download().astype(np.float64)
    at = (corners / found.unit - box[:3]) * box[3]
    # Three cells beside it, and the longest side has all others.
    np.testing.assert_allclose(at.min(axis=0), 3.0, atol=1e-3)
    assert at.max() == pytest.approx(29.0, abs=1e-3)
    assert found.grid.download()[: 32**3 // 32].any()


@pytest.mark.slow
def test_light_that_walls_block_is_close_to_a_path_tracer(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    view = made.camera(160, 120)
    world = one_bounce(made.scene, view, made.lights, 256)
    gbuffer = drawn(made.scene, view, layers=4, overscan=0.1, runtime=runtime)
    seen = rsm(made.scene, made.lights[0], size=512, runtime=runtime)  # type: ignore[arg-type]
    there = np.isfinite(gbuffer.inner(np.asarray(gbuffer.first("depth"))))
    noise = relative(world.error, world.mean, there)
    found = []
    for visibility in (False, True):
        e = multires_splat(gbuffer, seen, 4096, 0.05, visibility=visibility, runtime=runtime)
        off = relative(e - world.mean, world.mean, there)
        found.append(math.sqrt(off**2 - noise**2))
    # Measured: 0.29 and 0.13, noise aside.
    assert found[1] < 0.15 < found[0]


# ---- nothing there


def test_empty_pixels_and_images_get_no_light(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    vpls = lights(rng, 40)
    assert_no_light_where_nothing_is(rng, lambda gbuffer: splatted(variant_runtime, gbuffer, vpls)[0])


def test_no_light_is_skipped_and_said(runtime: Runtime) -> None:
    gbuffer = uploaded(runtime, wall())
    technique = MultiresSplat(runtime, gbuffer.size)
    with runtime.frame():
        result = technique.run(gbuffer, NO_LIGHTS)
    np.testing.assert_array_equal(result.download(), 0.0)
    assert [(p.name, p.skipped) for p in runtime.times()] == [("multires splat", "no light")]
    np.testing.assert_array_equal(multires_splat(wall(), [], runtime=runtime), 0.0)


def test_a_map_without_light_gives_none(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 40, 30, 32)
    dark = replace(seen, flux=np.zeros_like(np.asarray(seen.flux)))
    np.testing.assert_array_equal(multires_splat(gbuffer, dark, 64, runtime=runtime), 0.0)
    assert multires_splat(gbuffer, seen, 64, runtime=runtime).any()


def test_noise_in_the_normals_makes_every_pixel_a_sample_and_no_more(
    runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer, vpls = box(runtime)
    turned = rng.standard_normal((*gbuffer.size, 3))
    normal = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    noisy = replace(gbuffer, normal=normal.astype(np.float32))
    e, technique = splatted(runtime, noisy, vpls, light_error=0.0)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    computed = technique.grid.computed()[seen] > 0
    assert computed.mean() > 0.9
    # Points of coarse levels count columns anew: grazing lights are differences of float32.
    np.testing.assert_allclose(
        e[seen][computed], full_on_device(runtime, noisy, vpls)[seen][computed], rtol=1e-3, atol=1e-3 * e[seen].mean()
    )


@pytest.mark.slow
def test_noise_in_the_normals_costs_little_more_than_every_pixel(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = box(runtime, lambda made: made.camera(400, 300))
    turned = rng.standard_normal((*gbuffer.size, 3))
    normal = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    device = uploaded(runtime, replace(gbuffer, normal=normal.astype(np.float32)))
    techniques = [
        MultiresSplat(runtime, gbuffer.size, MultiresSplatParams(vpls=len(vpls), light_error=0.0, coarsest=coarsest))
        for coarsest in (1, 16)
    ]
    sums: list[list[float]] = [[], []]
    for _ in range(10):
        for technique, taken in zip(techniques, sums, strict=True):
            with runtime.frame():
                technique.run(device, vpls)
            taken.append(sum(entry.ms for entry in runtime.times()))
    found = [min(taken) for taken in sums]
    # Measured: 1.0 to 1.15 on a machine with nothing else to do.
    assert found[1] < 1.3 * found[0]


def test_errors_of_nothing_and_of_everything_are_limits(runtime: Runtime) -> None:
    gbuffer, vpls = box(runtime)
    every, seen = full_on_device(runtime, gbuffer, vpls), np.isfinite(np.asarray(gbuffer.depth))
    exact, most = splatted(runtime, gbuffer, vpls, interpolation_error=0.0, light_error=0.0)
    gradient, least = splatted(runtime, gbuffer, vpls, interpolation_error=1e6, light_error=1e6)
    # With no error allowed, what is left to interpolate lies on straight lines but for rounding.
    assert relative(exact - every, every, seen) < 1e-4
    assert np.isfinite(gradient).all()
    assert sum(least.grid.counts().values()) < 0.1 * sum(most.grid.counts().values())
    assert 0.5 < gradient[seen].mean() / every[seen].mean() < 2.0


# ---- prepared once, called many times


def test_second_call_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer, vpls = uploaded(variant_runtime, scene("ball", camera(), rng)), lights(rng)
    technique = MultiresSplat(variant_runtime, gbuffer.size)
    assert_second_run_allocates_nothing(variant_runtime, lambda: technique.run(gbuffer, vpls))


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"vpls": 0}, ValueError, r"vpls is 0: expected an integer >= 1"),
        (
            {"interpolation_error": -0.1},
            ValueError,
            r"interpolation_error is -0.1: expected a number >= 0.*mean irradiance",
        ),
        ({"light_error": math.nan}, ValueError, r"light_error is nan: expected a number"),
        ({"cutoff": -1.0}, ValueError, r"cutoff is -1.0: expected a number >= 0"),
        ({"near": "far"}, ValueError, r"near is 'far': expected one of 'disk', 'clamped'"),
        ({"coarsest": 3}, ValueError, r"coarsest is 3: expected one of"),
        ({"grid": 100}, ValueError, r"grid is 100: expected 0 or one of \(32, 64, 128, 256\)"),
        ({"colour": 1}, TypeError, r"colour"),
        ({"method": "best"}, ValueError, r"method is 'best': expected one of 'adaptive', 'publish"),
        (
            {"interpolation_error": 0.02, "method": "published"},
            ValueError,
            r"interpolation_error=0.02 applies only to method='adaptive' \(got method='published'\)",
        ),
        ({"visibility": True, "method": "published"}, ValueError, r"visibility=True applies only to method='adaptive'"),
        ({"levels": 5}, ValueError, r"levels=5 applies only to method='published' \(got method='adaptive'\)"),
        ({"levels": 0, "method": "published"}, ValueError, r"levels is 0: expected an integer"),
        ({"depth_threshold": -1.0, "method": "published"}, ValueError, r"depth_threshold is -1.0"),
        ({"colour": 1, "method": "published"}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        multires_splat(wall(), [], runtime=runtime, **params)


def test_other_sizes_too_many_lights_and_an_empty_gbuffer_are_refused(
    runtime: Runtime, rng: np.random.Generator
) -> None:
    technique = MultiresSplat(runtime, (8, 8), MultiresSplatParams(vpls=10))
    assert_what_does_not_fit_is_refused(runtime, technique, lights(rng, 11))
