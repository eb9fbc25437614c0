"""Splatting of virtual point lights: against its references, closed forms, limits, walls, bad
input."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.rsm import on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.vpl.vpl_splat import receivers, vpl_splat_reference, vpl_visibility_reference
from ssgi_cl.techniques.occupancy.occupancy_grid import cells_for
from ssgi_cl.techniques.vpl.packed_vpls import NEAR_CAPACITY
from ssgi_cl.techniques.vpl.vpl_choice import choose_vpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams, vpl_splat
from ssgi_cl.truth import one_bounce

from ...closed_forms import quads
from ..analytic import CAMERAS, Plane, camera, scene, slow_but, trace
from .given import (
    NO_LIGHTS,
    assert_no_light_where_nothing_is,
    assert_second_run_allocates_nothing,
    assert_what_does_not_fit_is_refused,
    cornell_box,
    in_view,
    uploaded,
    walls_between,
)

ROUNDING = 1e-4
"""Relative to a pixel's irradiance and to a hundredth of the mean."""
GRAZED = 1e-3
"""Share of values that may be further off: where the only bright lights graze a surface, their sine
is a difference of float32 positions."""


INTERLEAVED: dict[str, Any] = {"cutoff": 0.0, "interleave": True, "blur_radius": 0, "grid": 64}


def lights(rng: np.random.Generator, count: int = 100, *, scale: float = 1.0) -> Vpls:
    """Lights round the analytic scenes, which lie within 2 of the origin."""
    normal = rng.standard_normal((count, 3))
    return Vpls(
        scale * rng.uniform((-1.5, -0.2, -1.5), (1.5, 1.5, 1.5), (count, 3)),
        normal / np.linalg.norm(normal, axis=1, keepdims=True),
        rng.random((count, 3)) * 10.0 ** rng.uniform(-4, 4, (count, 1)),
        scale**2 * 10.0 ** rng.uniform(-4, -1, count),
    )


def irradiance(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls, **params: Any) -> NDArray[np.float32]:
    """Without what the cutoff leaves out, unless asked for, as the references have it."""
    params = {"vpls": max(len(vpls), 1), "restore": False, **params}
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(**params))
    return np.moveaxis(technique.run(uploaded(runtime, gbuffer), vpls).download(), 0, -1)


def assert_close(a: NDArray[Any], b: NDArray[Any], tolerance: float = ROUNDING) -> None:
    allowed = tolerance * (np.abs(b) + 0.01 * b.mean())
    assert np.mean(~(np.abs(a - b) <= allowed)) <= GRAZED


# ---- against the reference


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("name", slow_but(["corner", "ball", "bumpy"], "bumpy"))
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    gbuffer, vpls = scene(name, camera(kind), rng), lights(rng)
    for cutoff in (0.0, 0.05):
        params = VplSplatParams(vpls=100, cutoff=cutoff)
        e = irradiance(runtime, gbuffer, vpls, cutoff=cutoff)
        assert_close(e, vpl_splat_reference(gbuffer, vpls, params))


@pytest.mark.parametrize(
    "params",
    [
        {"cutoff": 0.3, "cull": False},
        {"cutoff": 0.3, "unit_distance": 0.7},
        {"cutoff": 0.0, "near": "clamped"},
        {"cutoff": 0.2, "interleave": True, "blur_radius": 0, "near": "clamped"},
    ],
    ids=str,
)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, rng: np.random.Generator, params: dict[str, Any]
) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(35, 50)), rng), lights(rng)
    e = irradiance(variant_runtime, gbuffer, vpls, **params)
    assert_close(e, vpl_splat_reference(gbuffer, vpls, VplSplatParams(vpls=100, **params)))


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 5), (17, 31)], ids=str)
@pytest.mark.parametrize("margin", [(0, 0), (3, 5)], ids=str)
@pytest.mark.parametrize("interleave", [False, True])
def test_every_kernel_variant_agrees_with_numpy_reference_at_odd_sizes_and_margins(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int], margin: tuple[int, int], interleave: bool
) -> None:
    gbuffer, vpls = scene("corner", camera(size=size), rng, margin=margin), lights(rng, 33)
    params = {"cutoff": 0.01, "interleave": interleave, "blur_radius": 0}
    e = irradiance(variant_runtime, gbuffer, vpls, **params)
    wanted = vpl_splat_reference(gbuffer, vpls, VplSplatParams(vpls=33, **params))
    assert_close(e, wanted)


def test_all_texels_sum_up_as_in_float64(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 32, 24, 64)
    vpls = choose_vpls(seen, 64 * 64, runtime=runtime)
    assert len(vpls) > 2048  # more than one batch
    e = vpl_splat(gbuffer, seen, 64 * 64, 0.0, runtime=runtime)
    wanted = vpl_splat_reference(gbuffer, vpls, VplSplatParams(vpls=len(vpls), cutoff=0.0))
    np.testing.assert_allclose(e, wanted, rtol=1e-4, atol=1e-6 * wanted.mean())


@pytest.mark.parametrize("kind", slow_but(["perspective", "orthographic", "reversed-z"], "perspective"))
@pytest.mark.parametrize("cutoff", [0.0, 0.01, 1.0, 30.0])
def test_tiles_leave_out_only_lights_that_give_them_nothing(
    runtime: Runtime, rng: np.random.Generator, kind: str, cutoff: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(kind, size=(80, 100)), rng), lights(rng, 1000)
    culled, whole = (irradiance(runtime, gbuffer, vpls, cutoff=cutoff, cull=cull) for cull in (True, False))
    # Other blocks of 64 lights are summed, so that the sums round differently.
    np.testing.assert_allclose(culled, whole, rtol=3e-6)
    np.testing.assert_array_equal(culled > 0.0, whole > 0.0)


def test_cut_stays_within_what_float32_holds() -> None:
    assert VplSplatParams().scaled_cutoff(unit=1e26) == 1e30
    assert VplSplatParams(unit_distance=1e30).scaled_cutoff(unit=1.0) == 1e-30
    assert VplSplatParams(cutoff=0.0).scaled_cutoff(unit=1e26) == 0.0


def test_a_greater_cutoff_leaves_tiles_shorter_lists(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(80, 100)), rng), lights(rng, 1000)
    lengths = []
    for cutoff in (0.0, 0.1, 1.0, 10.0):
        params = VplSplatParams(vpls=1000, cutoff=cutoff, restore=False)
        technique = VplSplat(runtime, gbuffer.size, params)
        technique.run(uploaded(runtime, gbuffer), vpls)
        lengths.append(np.mean([len(numbers) for numbers in technique.lists().flat]))
    assert lengths[0] < 800.0  # those behind a tile are left out without a cutoff
    assert lengths[0] > 1.05 * lengths[1] > 1.5 * lengths[2] > 3.0 * lengths[3]


# ---- closed forms and limits


def facing_wall(size: tuple[int, int] = (9, 9)) -> GBuffer:
    """A wall z = 0 seen from (0, 0, 3); its middle pixel shows the origin."""
    view = camera("orthographic", size=size, eye=(0, 0, 3), target=(0, 0, 0))
    return trace(view, [Plane((0, 0, 0), (0, 0, 1))])


@pytest.mark.parametrize("distance", [0.01, 0.5, 4.0])
@pytest.mark.parametrize("near", ["disk", "clamped"])
def test_one_light_gives_the_form_factor_of_its_disc(variant_runtime: Runtime, distance: float, near: str) -> None:
    vpls = Vpls(
        np.array([[0.0, 0.0, distance]]), np.array([[0.0, 0.0, -1.0]]), np.array([[1.0, 2.0, 3.0]]), np.array([0.3])
    )
    e = irradiance(variant_runtime, facing_wall(), vpls, cutoff=0.0, near=near)[4, 4]
    sphere = math.pi * distance**2
    spread = sphere + 0.3 if near == "disk" else max(sphere, 0.3)
    # Some roundings of 2^-24.
    np.testing.assert_allclose(e, np.array([1.0, 2.0, 3.0]) / spread, rtol=1e-6)


def test_the_cut_fades_between_its_level_and_twice_that(runtime: Runtime) -> None:
    levels = np.array([0.5, 1.01, 1.5, 1.99, 3.0])
    found = []
    for level in levels:
        # 1 / (pi d^2 + A) with A = 0 but for rounding, so k = 0.01 is met at d = 10.
        distance = 10.0 / math.sqrt(level)
        vpls = Vpls(np.array([[0.0, 0.0, distance]]), np.array([[0.0, 0.0, -1.0]]), np.ones((1, 3)), np.array([1e-9]))
        e = irradiance(runtime, facing_wall(), vpls, cutoff=0.01)
        found.append(e[4, 4, 0] * math.pi * 100.0)
    np.testing.assert_allclose(found, [0.0, 0.02, 1.0, 1.98, 3.0], rtol=0, atol=1e-4)


def test_no_pixel_is_brighter_than_the_discs_allow(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    _, point, normal = receivers(gbuffer)
    index = rng.choice(len(point), 200)
    # At, before and behind the very points that are seen, as near as float64 can say.
    offset = np.where(rng.random(200) < 0.3, 0.0, 10.0 ** rng.uniform(-17, -2, 200))[:, None]
    turned = np.where(rng.random((200, 1)) < 0.5, 1.0, -1.0) * normal[index]
    vpls = Vpls(
        point[index] + offset * rng.standard_normal((200, 3)),
        turned,
        np.ones((200, 3)),
        10.0 ** rng.uniform(-12, 0, 200),
    )
    for near in ("disk", "clamped"):
        e = irradiance(variant_runtime, gbuffer, vpls, cutoff=0.0, near=near)
        assert np.isfinite(e).all()
        assert (e >= 0.0).all()
        for i in range(0, 200, 50):
            names = ("position", "normal", "flux", "area")
            one = Vpls(*(getattr(vpls, name)[i : i + 1] for name in names))
            most = irradiance(variant_runtime, gbuffer, one, cutoff=0.0, near=near).max()
            assert most <= 1.0 / max(one.area[0], 1e-11) * (1.0 + 1e-5)


@pytest.mark.parametrize("power", [1e-38, 1e-20, 1e20, 1e38, 1e300])
def test_any_flux_gives_finite_light(variant_runtime: Runtime, power: float) -> None:
    vpls = Vpls(
        np.array([[0.0, 0.0, 1e-3], [0.0, 0.0, 1.0]]),
        np.array([[0.0, 0.0, -1.0]] * 2),
        np.full((2, 3), power),
        np.array([1e-9, 1e9]),
    )
    e = irradiance(variant_runtime, facing_wall(), vpls, cutoff=0.0)
    assert np.isfinite(e).all()
    assert e.max() <= 1.001e30


def test_lights_of_all_brightnesses_add_up(runtime: Runtime, rng: np.random.Generator) -> None:
    # 5000 lights whose fluxes span 10^8: a plain float32 sum of them is off by up to 1e-4.
    gbuffer = scene("corner", camera(size=(20, 24)), rng)
    vpls = lights(rng, 5000)
    e = irradiance(runtime, gbuffer, vpls, cutoff=0.0)
    wanted = vpl_splat_reference(gbuffer, vpls, VplSplatParams(vpls=5000, cutoff=0.0))
    # Some roundings of 2^-24, and grazing lights.
    assert_close(e, wanted, 1e-5)


@pytest.mark.parametrize("interleave", [False, True])
def test_no_lights_give_no_light(variant_runtime: Runtime, interleave: bool) -> None:
    params = {"cutoff": 0.0, "interleave": interleave, "visibility": interleave}
    e = irradiance(variant_runtime, facing_wall(), NO_LIGHTS, **params)
    np.testing.assert_array_equal(e, 0.0)


def test_empty_pixels_and_images_get_no_light(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    for on in (False, True):
        lit = partial(irradiance, variant_runtime, vpls=lights(rng), cutoff=0.0, interleave=on, visibility=on)
        assert_no_light_where_nothing_is(rng, lit)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_unit_of_length_does_not_matter(runtime: Runtime, rng: np.random.Generator, kind: str, scale: float) -> None:
    found = []
    for s in (1.0, scale):
        generator = np.random.default_rng(3)
        gbuffer = scene("corner", camera(kind, scale=s), generator, scale=s)
        e = irradiance(runtime, gbuffer, lights(generator, scale=s), cutoff=0.1, unit_distance=s)
        found.append(e * s**2)
    # Scaled depths round differently, by 2^-24.
    assert_close(found[1], found[0], 1e-3)


def test_scene_far_from_the_origin_looks_as_at_the_origin(runtime: Runtime) -> None:
    found = []
    for shift in (np.zeros(3), np.array([1e6, -1e6, 1e6])):
        generator = np.random.default_rng(3)
        gbuffer = scene("corner", camera(shift=shift), generator, shift=shift)
        vpls = lights(generator)
        vpls = replace(vpls, position=vpls.position + shift)
        found.append(irradiance(runtime, gbuffer, vpls, cutoff=0.05))
    # A double resolves 1e-10 at 1e6, so only the rounding of float32 depths may differ.
    assert_close(found[1], found[0], 1e-3)


# ---- what the cutoff leaves out


def test_what_the_cut_leaves_out_is_told_and_can_be_put_back(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 80, 60, 128)
    vpls = choose_vpls(seen, 1024, runtime=runtime)
    whole = irradiance(runtime, gbuffer, vpls, cutoff=0.0).mean()
    params = {"cutoff": 0.05, "unit_distance": 0.1}
    cut = irradiance(runtime, gbuffer, vpls, **params).mean()
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(**params))
    lost = technique.lost(uploaded(runtime, gbuffer), vpls)
    assert 0.1 < lost < 0.9
    # The loss is computed with 64 lights in place of 1024.
    assert lost == pytest.approx(1.0 - cut / whole, abs=0.02)
    for interleave in (False, True):
        restored = irradiance(runtime, gbuffer, vpls, restore=True, interleave=interleave, **params).mean()
        assert restored == pytest.approx(whole, rel=0.03)


def test_without_a_cut_nothing_is_lost(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = uploaded(runtime, facing_wall())
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(cutoff=0.0))
    assert technique.lost(gbuffer, lights(rng)) == 0.0


# ---- parts


def test_close_lights_are_the_lights_that_they_are_made_of(variant_runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(variant_runtime, 40, 30, 64)
    vpls = choose_vpls(seen, 1, parts=True, runtime=variant_runtime)
    assert vpls.parts is not None
    assert len(vpls.parts) == 16
    refined = irradiance(variant_runtime, gbuffer, vpls, cutoff=0.0, refine=1e6)
    parts = irradiance(variant_runtime, gbuffer, vpls.parts, cutoff=0.0)
    # A tile looks at all parts of its lights, others only at those that face it.
    np.testing.assert_allclose(refined, parts, rtol=3e-6)


def test_parts_bring_lights_closer_to_all_texels(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 160, 120, 256)
    every = vpl_splat(gbuffer, seen, 1 << 16, 0.0, runtime=runtime)
    found = [vpl_splat(gbuffer, seen, n, 0.0, refine=r, runtime=runtime) for n, r in ((1024, 4.0), (1024, 0.0))]
    rmse = [math.sqrt(np.mean((e - every) ** 2)) for e in found]
    # Measured: 0.68 times; at 400 x 300, where fewer pixels lie in corners, 0.54 times.
    assert rmse[0] < 0.8 * rmse[1]


def test_interleaved_pixels_take_parts_of_all_lights_near_by(variant_runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(variant_runtime, 32, 24, 64)
    vpls = choose_vpls(seen, 40, parts=True, runtime=variant_runtime)
    e = irradiance(variant_runtime, gbuffer, vpls, **INTERLEAVED)
    assert_close(e, vpl_splat_reference(gbuffer, vpls, VplSplatParams(vpls=40, **INTERLEAVED)))
    whole = irradiance(variant_runtime, gbuffer, vpls, refine=0.0, **INTERLEAVED)
    every = irradiance(variant_runtime, gbuffer, vpls.parts, **{**INTERLEAVED, "interleave": False})
    off, whole_off = (math.sqrt(np.mean((x - every) ** 2)) for x in (e, whole))
    # Measured: 0.80 times, before the blur.
    assert off < 0.9 * whole_off


def test_more_lights_near_by_than_there_is_room_for_stay_whole(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 20, 15, 64)
    vpls = choose_vpls(seen, NEAR_CAPACITY + 100, parts=True, runtime=runtime)
    whole, refined = (irradiance(runtime, gbuffer, vpls, refine=r, **INTERLEAVED) for r in (0.0, 1e6))
    np.testing.assert_array_equal(refined, whole)


def test_a_full_list_keeps_lights_whole(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 40, 30, 64)
    whole, refined = (vpl_splat(gbuffer, seen, 128, 0.0, refine=r, runtime=runtime) for r in (0.0, 1e6))
    # Room for 256 of 2048 parts, whose flux is the lights'.
    assert refined.mean() == pytest.approx(whole.mean(), rel=0.05)


# ---- interleaved, and walls


def test_interleaved_lights_are_close_to_all_of_them(runtime: Runtime) -> None:
    gbuffer, seen = cornell_box(runtime, 160, 120, 256)
    all_of_them = vpl_splat(gbuffer, seen, 4096, 0.0, runtime=runtime)
    some = vpl_splat(gbuffer, seen, 4096, 0.0, interleave=True, runtime=runtime)
    rough = vpl_splat(gbuffer, seen, 4096, 0.0, interleave=True, blur_radius=0, runtime=runtime)
    rmse, rough_rmse = (math.sqrt(np.mean((e - all_of_them) ** 2)) / all_of_them.mean() for e in (some, rough))
    # Measured: 0.119 and 0.159, most of it where a corner is a few pixels wide; without the parts
    # of lights near by 0.125 and 0.223.
    assert rmse < 0.14
    assert rmse < 0.85 * rough_rmse
    assert rough_rmse < 0.19
    assert some.mean() == pytest.approx(all_of_them.mean(), rel=0.01)


def capacity(runtime: Runtime, size: tuple[int, int] = (48, 64)) -> tuple[GBuffer, Any, Vpls]:
    gbuffer, seen = cornell_box(runtime, size[1], size[0], 64, layers=3, overscan=0.125)
    return gbuffer, seen, choose_vpls(seen, 512, runtime=runtime)


@pytest.mark.parametrize(
    ("size", "cells"),
    [((10, 10), 32), ((48, 95), 32), ((48, 96), 64), ((191, 100), 64), ((192, 100), 128), ((2000, 3000), 128)],
)
def test_cells_are_half_as_wide_again_as_pixels(size: tuple[int, int], cells: int) -> None:
    assert cells_for(size) == cells


def test_lines_of_sight_agree_with_numpy_reference(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, seen, vpls = capacity(variant_runtime)
    # The chosen send alike: of lights that share a ray, the brighter are to get it more often.
    vpls = replace(vpls, flux=vpls.flux * 10.0 ** rng.uniform(-1, 1, (len(vpls), 1)))
    params = VplSplatParams(vpls=512, cutoff=0.0, interleave=True, visibility=True, blur_radius=0, grid=32, share=5)
    device = uploaded(variant_runtime, gbuffer)
    technique = VplSplat(variant_runtime, gbuffer.size, params)
    e = np.moveaxis(technique.run(device, vpls, rsms=[on_device_rsm(seen, variant_runtime)]).download(), 0, -1)
    walls = walls_between(gbuffer, seen, vpls, params.grid)

    def hidden(x: Any, n: Any, y: Any, m: Any) -> NDArray[np.bool_]:
        turn = gbuffer.camera.view[:3, :3].T
        return walls.hidden(in_view(gbuffer, x), n @ turn, in_view(gbuffer, y), m @ turn)

    wanted = vpl_visibility_reference(gbuffer, vpls, params, technique.lists(), hidden)
    mean = wanted.mean()
    # A point on the side of a cell may be in either: 1 of some 60 lines of a pixel then differs.
    off = np.abs(e - wanted).max(axis=-1) > 1e-3 * mean
    assert off.mean() < 0.03
    assert e.mean() == pytest.approx(mean, rel=1e-3)
    assert wanted.mean() < 0.95 * vpl_splat_reference(gbuffer, vpls, params).mean()


def parted_floor(
    runtime: Runtime, height: float, eye: tuple[float, float, float] = (2.0, 2.5, 0.01)
) -> tuple[GBuffer, Vpls]:
    """A floor and a wall along x = 0, seen from the right, and lights on its left."""
    parts = [((-1, 0, -1), (2, 0, 0), (0, 0, 2))]
    if height > 0.0:
        for x in (-0.05, 0.05):
            parts.append(((x, 0, -1), (0, height, 0), (0, 0, 2)))
        parts.append(((-0.05, height, -1), (0.1, 0, 0), (0, 0, 2)))
    view = camera(size=(160, 200), eye=eye, target=(0.0, 0.0, 0.0))
    gbuffer = drawn(quads(*parts), view, layers=2, runtime=runtime)
    generator = np.random.default_rng(4)
    position = generator.uniform((-0.7, 0.15, -0.1), (-0.5, 0.3, 0.1), (256, 3))
    return gbuffer, Vpls(position, np.tile([1.0, 0.0, 0.0], (256, 1)), np.ones((256, 3)), np.full(256, 0.01))


def beyond_wall(gbuffer: GBuffer) -> NDArray[np.bool_]:
    """Return which pixels show the floor on the right of that wall."""
    seen, point, _ = receivers(replace(gbuffer, normal=np.ones((*gbuffer.size, 3))))
    x, z = np.full((2, *seen.shape), np.nan)
    x[seen], z[seen] = point[:, 0], point[:, 2]
    return np.asarray((x > 0.2) & (x < 0.9) & (abs(z) < 0.4))


@pytest.mark.parametrize(
    ("height", "eye", "grid", "most"),
    [
        (0.0, (2.0, 2.5, 0.01), 64, 1.0),
        # The highest lights pass within a cell of the wall's top.
        (0.4, (2.0, 2.5, 0.01), 64, 0.02),
        # The wall is seen at a slant, a pixel in some 4 cells, of which the outermost stay empty.
        (0.4, (1.0, 3.5, 0.01), 64, 0.04),
        pytest.param(0.4, (1.0, 3.5, 0.01), 128, 0.04, marks=pytest.mark.slow),
    ],
)
def test_a_wall_blocks_light_and_open_space_does_not(
    variant_runtime: Runtime, height: float, eye: tuple[float, float, float], grid: int, most: float
) -> None:
    gbuffer, vpls = parted_floor(variant_runtime, height, eye)
    params = {**INTERLEAVED, "grid": grid}
    free, tested = (irradiance(variant_runtime, gbuffer, vpls, visibility=v, **params) for v in (False, True))
    beyond = beyond_wall(gbuffer)
    assert free[beyond].mean() > 0.1
    if height > 0.0:
        assert tested[beyond].mean() < most * free[beyond].mean()
    else:
        np.testing.assert_array_equal(tested, free)


def test_a_wall_blocks_the_parts_of_near_lights(variant_runtime: Runtime) -> None:
    gbuffer, vpls = parted_floor(variant_runtime, 0.4)
    # All lights count as near: of each, a pixel takes one of 16 parts, which lie where it does.
    whole = Vpls(vpls.position[::8], vpls.normal[::8], vpls.flux[::8], np.ones(32))
    each = np.repeat(np.arange(32), 16)
    parts = Vpls(whole.position[each], whole.normal[each], whole.flux[each] / 16.0, np.full(512, 1.0 / 16.0))
    lights = replace(whole, parts=parts)
    params = {**INTERLEAVED, "refine": 100.0}
    free, tested = (irradiance(variant_runtime, gbuffer, lights, visibility=v, **params) for v in (False, True))
    # The whole lights alone would give another result: parts are smaller.
    assert not np.allclose(free, irradiance(variant_runtime, gbuffer, whole, **params), rtol=0.01)
    beyond = beyond_wall(gbuffer)
    assert free[beyond].mean() > 0.01
    assert tested[beyond].mean() < 0.02 * free[beyond].mean()


def test_dark_maps_and_lights_a_million_times_brighter_are_no_trouble(runtime: Runtime) -> None:
    gbuffer, seen, _ = capacity(runtime)
    flux = np.asarray(seen.flux)
    dark, bright = (replace(seen, flux=flux * np.float32(k)) for k in (0.0, 1e6))
    np.testing.assert_array_equal(vpl_splat(gbuffer, dark, 64, runtime=runtime), 0.0)
    one = vpl_splat(gbuffer, seen, 64, 0.0, runtime=runtime)
    np.testing.assert_array_equal(vpl_splat(gbuffer, [dark, seen], 64, 0.0, runtime=runtime), one)
    both = vpl_splat(gbuffer, [seen, bright], 64, 0.0, runtime=runtime)
    assert np.isfinite(both).all()
    assert both.mean() == pytest.approx(1e6 * one.mean(), rel=0.02)


@pytest.mark.parametrize(
    ("position", "size"), [((0.45, 0.1, 0.2), 64), ((0.278, 0.0, 0.28), 64), ((0.278, 0.5, 0.28), 1)]
)
def test_a_light_in_a_wall_and_a_map_of_one_texel_give_finite_light(
    runtime: Runtime, position: tuple[float, float, float], size: int
) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    gbuffer = drawn(made.scene, made.camera(40, 30), runtime=runtime)
    seen = rsm(made.scene, SpotLight(position, (0, -1, 0), 0.8, 0.2), size=size, runtime=runtime)
    for interleave in (False, True):
        e = vpl_splat(gbuffer, seen, 64, interleave=interleave, visibility=interleave, runtime=runtime)
        assert np.isfinite(e).all()
        assert (e >= 0.0).all()


def test_several_maps_add_up(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    gbuffer = drawn(made.scene, made.camera(40, 30), runtime=runtime)
    spots = [SpotLight((x, 0.5, 0.28), (0, -1, 0), 0.8, 0.2) for x in (0.15, 0.4)]
    maps = [rsm(made.scene, spot, size=32, runtime=runtime) for spot in spots]
    every = 2 * 32 * 32
    both = vpl_splat(gbuffer, maps, every, 0.0, runtime=runtime)
    apart = [vpl_splat(gbuffer, m, every, 0.0, runtime=runtime) for m in maps]
    # Every texel is a light, so that only the order of the sum differs.
    np.testing.assert_allclose(both, apart[0] + apart[1], rtol=1e-5)


# ---- against path tracing


def mean_irradiance(runtime: Runtime, map_size: int, count: int) -> float:
    """Return that of an image of the Cornell box."""
    return float(vpl_splat(*cornell_box(runtime, 80, 60, map_size), count, 0.0, runtime=runtime).mean())


@pytest.mark.slow
def test_the_cornell_box_has_the_bounce_that_paths_through_walls_have(runtime: Runtime) -> None:
    pytest.importorskip("mitsuba")
    made = BUILTIN_SCENES["cornell_box"]()
    world = one_bounce(made.scene, made.camera(80, 60), made.lights, 256, visibility=False)
    means = [mean_irradiance(runtime, size, count) for size, count in ((256, 4096), (512, 4096), (512, 16384))]
    np.testing.assert_allclose(means, world.mean.mean(), rtol=0.02)


@pytest.mark.parametrize("sizes", [(128, 256, 512), pytest.param((256, 512, 1024), marks=pytest.mark.slow)], ids=str)
def test_irradiance_does_not_depend_on_the_map_s_size(runtime: Runtime, sizes: tuple[int, ...]) -> None:
    means = [mean_irradiance(runtime, size, 4096) for size in sizes]
    np.testing.assert_allclose(means, means[-1], rtol=0.01)


# ---- chosen on the device


@pytest.mark.parametrize(
    "params",
    [{}, {"cutoff": 0.0, "refine": 0.0}, {"cutoff": 0.0, "interleave": True, "visibility": True, "importance": False}],
    ids=str,
)
def test_lights_chosen_on_the_device_shine_like_those_of_the_host(
    variant_runtime: Runtime, params: dict[str, Any]
) -> None:
    gbuffer, seen, _ = capacity(variant_runtime)
    device, maps = uploaded(variant_runtime, gbuffer), [on_device_rsm(seen, variant_runtime)]
    technique = VplSplat(variant_runtime, gbuffer.size, VplSplatParams(vpls=512, **params))
    vpls = choose_vpls(maps, 512, parts=technique.params.parted, runtime=variant_runtime)
    chosen = technique.run(device, rsms=maps).download()
    given = technique.run(device, vpls, rsms=maps).download()
    # Lights may be on either side of a rounded edge; of the coarse ones for what a cutoff leaves
    # out, the given are merged from lights, not from texels.
    assert_close(chosen, given, 0.02 if technique.params.cutoff > 0.0 else ROUNDING)


def test_lights_are_chosen_anew_when_a_map_changes(runtime: Runtime) -> None:
    gbuffer, seen, _ = capacity(runtime)
    device, maps = uploaded(runtime, gbuffer), [on_device_rsm(seen, runtime)]
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(vpls=512))
    first = technique.run(device, rsms=maps).download()
    maps[0].upload(replace(seen, flux=2.0 * np.asarray(seen.flux)))
    np.testing.assert_allclose(technique.run(device, rsms=maps).download(), 2.0 * first, rtol=1e-5)


def test_neither_lights_nor_maps_are_refused(runtime: Runtime) -> None:
    technique = VplSplat(runtime, (9, 9), VplSplatParams(vpls=10))
    with pytest.raises(ValueError, match="vpls is None and there are no maps"):
        technique.run(uploaded(runtime, facing_wall()), None)


# ---- prepared once, called many times


@pytest.mark.parametrize(("visibility", "given_lights"), [(False, True), (True, False)])
def test_second_call_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, visibility: bool, given_lights: bool
) -> None:
    gbuffer, seen, vpls = capacity(variant_runtime)
    device, maps = uploaded(variant_runtime, gbuffer), [on_device_rsm(seen, variant_runtime)]
    params = VplSplatParams(vpls=512, cutoff=0.5, restore=True, interleave=visibility, visibility=visibility)
    technique = VplSplat(variant_runtime, gbuffer.size, params)
    given = vpls if given_lights else None
    assert_second_run_allocates_nothing(variant_runtime, lambda: technique.run(device, given, rsms=maps))


def test_fewer_lights_than_prepared_for_leave_no_trace_of_the_others(
    runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer, many, few = scene("corner", camera(), rng), lights(rng, 3000), lights(rng, 5)
    params = VplSplatParams(vpls=3000, cutoff=0.0, restore=False)
    technique = VplSplat(runtime, gbuffer.size, params)
    device = uploaded(runtime, gbuffer)
    technique.run(device, many)
    np.testing.assert_array_equal(
        np.moveaxis(technique.run(device, few).download(), 0, -1), irradiance(runtime, gbuffer, few, cutoff=0.0)
    )


# ---- bad input


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"vpls": 0}, ValueError, r"vpls is 0: expected an integer >= 1"),
        ({"vpls": 1.5}, TypeError, r"vpls is 1.5: expected an integer"),
        ({"cutoff": -0.1}, ValueError, r"cutoff is -0.1: expected a number >= 0"),
        ({"cutoff": math.nan}, ValueError, r"cutoff is nan: expected a number"),
        ({"unit_distance": 0.0}, ValueError, r"unit_distance is 0.0: expected a number > 0.*scene"),
        ({"near": "far"}, ValueError, r"near is 'far': expected one of 'disk', 'clamped'"),
        ({"grid": 48}, ValueError, r"grid is 48: expected 0 or one of \(32, 64, 128, 256\)"),
        ({"visibility": True}, ValueError, r"visibility is True: expected interleave=True"),
        ({"interleave": True, "cull": False}, ValueError, r"cull is False: expected True with"),
        ({"interleave": 1}, TypeError, r"interleave is 1: expected True or False"),
        ({"share": 0}, ValueError, r"share is 0: expected an integer >= 1"),
        ({"colour": 1}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        vpl_splat(facing_wall(), [], runtime=runtime, **params)


def test_other_sizes_and_too_many_lights_are_refused(runtime: Runtime, rng: np.random.Generator) -> None:
    technique = VplSplat(runtime, (8, 8), VplSplatParams(vpls=10))
    assert_what_does_not_fit_is_refused(runtime, technique, lights(rng, 11))


def test_something_else_than_a_map_is_refused(runtime: Runtime) -> None:
    with pytest.raises(TypeError, match=r"int: expected ReflectiveShadowMap or DeviceRsm"):
        vpl_splat(facing_wall(), [3], runtime=runtime)  # type: ignore[list-item]
