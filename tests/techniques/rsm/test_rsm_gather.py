"""Gathering from reflective shadow maps: against formulas, its numpy reference and traced light."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm, on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.rsm.rsm_gather import rsm_gather_reference
from ssgi_cl.techniques.rsm.rsm_gather import RsmGather, RsmGatherParams, rsm_gather
from ssgi_cl.techniques.rsm.rsm_published import RsmPublished, RsmPublishedParams
from ssgi_cl.truth import store
from ssgi_cl.truth.light import one_bounce

from ..analytic import CAMERAS, camera, check_second_run, scene, slow_but, uploaded

LIGHTS = {
    "spot": SpotLight((0.28, 0.54, 0.28), (0.2, -1.0, 0.1), 0.9, (1.0, 2.0, 3.0)),
    "point": PointLight((0.15, 0.3, 0.25), (3.0, 2.0, 1.0)),
    "directional": DirectionalLight((0.1, -0.2, 1.0), (2.0, 2.0, 1.0)),
}
GATHER_METHODS: dict[str, dict[str, Any]] = {
    "all": {"pattern": "all"},
    "flux": {},
    "fixed": {"pattern": "fixed"},
    "rotated": {"pattern": "rotated"},
    "every": {"resolution": "adaptive", "interpolation_error": 0.0},
}
REFERENCE = 1e-4
"""Relative to the mean and to the pixel itself. Measured in nearly all: 4e-5 at most, 4e-7 in the
mean."""
FLIPS = 2e-3
"""Share of pixels that may differ more: of those whose place in the map is rounded, one texel in
1e5 is another; an interpolated pixel may pass a limit that it passes not in float64."""


@cache
def box(columns: int = 40, rows: int = 30) -> GBuffer:
    """Return the Cornell box."""
    view = BUILTIN_SCENES["cornell_box"]()
    return rasterized(view.scene, view.camera(columns, rows), runtime=Runtime.open())


@cache
def box_map(kind: str = "spot", size: int = 33) -> ReflectiveShadowMap:
    scene_ = BUILTIN_SCENES["cornell_box"]().scene
    return rsm(scene_, LIGHTS[kind], size=size, runtime=Runtime.open())


def texel(*, flux: float = 2.0, distance: float = 1.0, cone: float = 0.5, size: int = 1) -> ReflectiveShadowMap:
    """Return what a light at the origin that looks down -z sees of a wall: `size`^2 texels."""
    seen = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=2.0 * cone, width=size, height=size)
    depth = np.full((size, size), distance, np.float32)
    return ReflectiveShadowMap(
        light=SpotLight((0, 0, 0), (0, 0, -1), cone, 1.0),
        camera=seen,
        depth=depth,
        position=seen.unproject(depth),
        normal=np.broadcast_to([0.0, 0.0, 1.0], (size, size, 3)),
        flux=np.full((size, size, 3), flux),
    )


def facing(distance: float, size: tuple[int, int] = (1, 1), view_height: float = 1e-3) -> GBuffer:
    """Return a wall that faces -z and the wall of `texel`, the given distance from it."""
    z = -1.0 + distance
    made = Camera.orthographic((0, 0, z - 1.0), (0, 0, z), view_height=view_height, width=size[1], height=size[0])
    normal = np.broadcast_to([0.0, 0.0, -1.0], (*size, 3))
    return GBuffer(camera=made, depth=np.ones(size), normal=normal)


def relative(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the RMSE of a, relative to the mean of b."""
    return float(np.sqrt(np.mean((a - b) ** 2)) / b.mean())


def share_off(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the share of pixels that differ by more than REFERENCE, or are no numbers."""
    return float(np.mean(~(np.abs(a - b) <= REFERENCE * (b.mean() + b)).all(axis=-1)))


@pytest.fixture(params=GATHER_METHODS)
def gather_method(request: pytest.FixtureRequest) -> str:
    """Each way to gather."""
    return str(request.param)


# ---- against the numpy reference


@pytest.mark.parametrize("light", slow_but(LIGHTS, "point"))
@pytest.mark.parametrize("gather_method", ["flux", "fixed", "rotated", "every"])
def test_every_kernel_variant_agrees_with_numpy_reference(
    variant_runtime: Runtime, light: str, gather_method: str
) -> None:
    params = RsmGatherParams(samples=60, **GATHER_METHODS[gather_method])
    e = RsmGather(variant_runtime, box().size, params)(box(), box_map(light))
    assert share_off(e, rsm_gather_reference(box(), box_map(light), params)) <= FLIPS


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("gather_method", ["flux", "fixed", "every"])
def test_kernel_agrees_with_numpy_reference_in_every_camera_and_with_a_margin(
    runtime: Runtime, rng: np.random.Generator, kind: str, gather_method: str
) -> None:
    gbuffer = scene("bumpy", camera(kind), rng, margin=(3, 6))
    params = RsmGatherParams(samples=50, **GATHER_METHODS[gather_method])
    e = RsmGather(runtime, gbuffer.size, params, gbuffer.margin)(gbuffer, box_map())
    assert share_off(e, rsm_gather_reference(gbuffer, box_map(), params)) <= FLIPS


@pytest.mark.parametrize(("light", "size"), [("spot", 64), ("point", 33), ("directional", 33)])
def test_with_all_texels_every_pixel_is_the_sum_over_the_map(variant_runtime: Runtime, light: str, size: int) -> None:
    params = RsmGatherParams(pattern="all")
    seen = box_map(light, size)
    e = rsm_gather(box(20, 15), seen, pattern="all", runtime=variant_runtime)
    assert share_off(e, rsm_gather_reference(box(20, 15), seen, params)) == 0.0


# ---- several maps


@pytest.mark.parametrize("gather_method", ["flux", "rotated", "all", "every"])
def test_several_maps_give_the_sum_of_their_light(variant_runtime: Runtime, gather_method: str) -> None:
    maps = [box_map("spot"), box_map("point", 16), box_map("directional")]
    each = [rsm_gather(box(), seen, 60, runtime=variant_runtime, **GATHER_METHODS[gather_method]) for seen in maps]
    e = rsm_gather(box(), maps, 60, runtime=variant_runtime, **GATHER_METHODS[gather_method])
    # Sums of three float32; "every" may leave another pixel to interpolation with no error.
    off = np.abs(e - sum(each)) > 1e-5 * (e + e.mean())
    assert np.mean(off) <= FLIPS
    assert each[1].any()


def test_no_map_gives_no_light(runtime: Runtime) -> None:
    for method in ("unbiased", "published"):
        e = rsm_gather(box(), [], runtime=runtime, method=method)
        assert e.shape == (*box().size, 3)
        assert not e.any()


def test_maps_that_change_places_are_told_apart(runtime: Runtime) -> None:
    technique = RsmGather(runtime, box().size)
    one, other = box_map("spot"), box_map("directional")
    first = technique(box(), [one, other])
    np.testing.assert_allclose(technique(box(), [other, one]), first, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(technique(box(), other), rsm_gather(box(), other, runtime=runtime))


# ---- formulas


@pytest.mark.parametrize("distance", [0.0, 1e-6, 0.01, 0.3, 2.0])
def test_one_texel_is_a_disc_however_near(runtime: Runtime, distance: float) -> None:
    area = (2.0 * math.tan(0.5)) ** 2  # of a texel of one camera pixel at depth 1
    e = rsm_gather(facing(distance), texel(), 1, runtime=runtime)
    # Facing each other, both cosines are 1; the pixel centre is on the axis. At distance 0 there
    # is no direction, and nothing.
    expected = 2.0 / (math.pi * distance**2 + area) if distance else 0.0
    np.testing.assert_allclose(e[0, 0], expected, rtol=1e-5, atol=1e-6)


def test_a_bright_disc_seen_from_everywhere_gives_back_its_flux(runtime: Runtime) -> None:
    # A cosine lobe of flux Phi, gathered on a plane so near and wide that nearly all falls on it.
    view = facing(0.05, (101, 101), view_height=8.0)
    seen = texel(cone=1e-3, flux=3.0)
    e = rsm_gather(view, seen, 1, runtime=runtime).astype(np.float64)
    fine = rsm_gather(facing(0.05, (401, 401), 1.0), seen, 1, runtime=runtime).astype(np.float64)
    inside = np.abs(np.linspace(-4.0, 4.0, 102)[:-1] + 4.0 / 101.0) < 0.5
    outer = e[~(inside[:, None] & inside)].sum() / 3.0 * (8.0 / 101.0) ** 2
    total = outer + fine.sum() / 3.0 * (1.0 / 401.0) ** 2
    # Beyond the 8 units: about h^2 / R^2 of it; between both rasters half a pixel of the coarse.
    assert total == pytest.approx(3.0, rel=2e-2)


def test_surfaces_that_face_away_get_and_give_nothing(runtime: Runtime) -> None:
    behind = facing(-0.5)
    assert not rsm_gather(behind, texel(), 1, runtime=runtime).any()
    away = GBuffer(
        camera=Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=1.0, width=3, height=3),
        depth=np.full((3, 3), 0.5),
        normal=np.broadcast_to([0.0, 0.0, 1.0], (3, 3, 3)),
    )
    assert not rsm_gather(away, texel(), 1, runtime=runtime).any()


def test_nothing_is_brighter_than_discs_allow(runtime: Runtime) -> None:
    # Seen from the light itself, every pixel lies on a texel.
    seen = box_map("spot", 64)
    view = BUILTIN_SCENES["cornell_box"]()
    own = rasterized(view.scene, replace(seen.cameras[0], width=80, height=80), runtime=runtime)
    every = rsm_gather(own, seen, pattern="all", runtime=runtime)
    for gather_method in ("flux", "fixed", "rotated", "every"):
        e = rsm_gather(own, seen, 64, runtime=runtime, **GATHER_METHODS[gather_method])
        assert np.isfinite(e).all()
        # Larger discs in place of texels are darker near by; twice the largest sum is no firefly.
        assert e.max() < 2.0 * every.max()


# ---- what samples converge to


@pytest.mark.parametrize("light", slow_but(LIGHTS, "spot"))
@pytest.mark.parametrize("pattern", ["fixed", "rotated", "flux"])
def test_unbiased_samples_converge_to_the_sum_over_all_texels(runtime: Runtime, light: str, pattern: str) -> None:
    seen = box_map(light, 64)
    every = rsm_gather(box(), seen, pattern="all", runtime=runtime)
    errors = [relative(rsm_gather(box(), seen, n, pattern=pattern, runtime=runtime), every) for n in (100, 6400, 65536)]
    # Well-spread points: the error falls by more than the root of the number. Measured: 0.14 to
    # 0.42, then 0.005 to 0.042, then 0.0009 to 0.01.
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.02


# ---- irradiance of a scene


@pytest.mark.parametrize("light", ["spot", "directional"])
@pytest.mark.parametrize("sizes", [(256, 512), pytest.param((256, 512, 1024, 2048), marks=pytest.mark.slow)], ids=str)
def test_irradiance_does_not_depend_on_the_maps_resolution(
    runtime: Runtime, light: str, sizes: tuple[int, ...]
) -> None:
    small = box(12, 9)
    means = [
        rsm_gather(
            small,
            rsm(BUILTIN_SCENES["cornell_box"]().scene, LIGHTS[light], size=size, runtime=runtime),
            pattern="all",
            runtime=runtime,
        ).mean()
        for size in sizes
    ]
    np.testing.assert_allclose(means, means[-1], rtol=0.01)


@pytest.mark.slow  # the sum over all texels has its reference above, samples converge to it
def test_the_cornell_box_has_the_light_that_mitsuba_traces_through_walls(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    monkeypatch.setattr(store, "truth_folder", lambda: tmp_path)
    view = BUILTIN_SCENES["cornell_box"]()
    light = view.lights[0]
    assert isinstance(light, SpotLight)
    small = box(48, 36)
    truth = one_bounce(view.scene, small.camera, [light], 256, visibility=False).mean
    seen = rsm(view.scene, light, size=512, runtime=runtime)
    for gather_method in ({"pattern": "all"}, {"samples": 4096}, {"samples": 4096, "pattern": "fixed"}):
        e = rsm_gather(small, seen, runtime=runtime, **gather_method)
        np.testing.assert_allclose(e.mean(axis=(0, 1)), truth.mean(axis=(0, 1)), rtol=0.02)


@pytest.mark.parametrize("albedo", [0.0, 1.0])
def test_black_walls_reflect_nothing_and_white_ones_all(runtime: Runtime, albedo: float) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    painted = replace(view.scene, materials=tuple(replace(m, albedo=(albedo,) * 3) for m in view.scene.materials))
    e = rsm_gather(box(), rsm(painted, LIGHTS["spot"], size=32, runtime=runtime), runtime=runtime)
    assert np.isfinite(e).all()
    assert e.any() == bool(albedo)


def test_a_scene_far_from_the_origin_looks_like_one_there(runtime: Runtime) -> None:
    results = []
    for shift in (0.0, 1e6):
        seen = texel(size=16)
        there = Camera.look_at((shift, 0, 0), (shift, 0, -max(1.0, shift)), yfov=1.0, width=16, height=16)
        moved = replace(
            seen,
            camera=there,
            light=SpotLight((shift, 0, 0), (0, 0, -1), 0.5, 1.0),
            position=there.unproject(np.asarray(seen.depth)),
        )
        eye = (shift + 0.5, 0.5, -3.0)
        made = Camera.look_at(eye, np.add(eye, (0, 0, 1e6)), width=20, height=15)
        gbuffer = GBuffer(
            camera=made, depth=np.full((15, 20), 3.5), normal=np.broadcast_to([0.6, 0.0, -0.8], (15, 20, 3))
        )
        results.append(rsm_gather(gbuffer, moved, 200, runtime=runtime))
    assert results[0].any()
    np.testing.assert_allclose(results[1], results[0], rtol=1e-4, atol=1e-6)


# ---- at fewer pixels


def test_pixels_of_the_finest_level_are_gathered_for_as_at_full_size(variant_runtime: Runtime) -> None:
    params = RsmGatherParams(samples=30, resolution="adaptive")
    technique = RsmGather(variant_runtime, box().size, params)
    e = technique(box(), box_map())
    every = rsm_gather(box(), box_map(), 30, runtime=variant_runtime)
    same = (e == every).all(axis=-1)
    assert 0.0 < technique.computed < 1.0
    assert 0.5 * technique.computed < np.mean(same)
    # Measured: 0.095; with 40 x 30 pixels most lie at an edge.
    assert relative(e, every) < 0.12


def test_fewer_pixels_are_within_the_error_that_is_allowed(runtime: Runtime) -> None:
    large, seen = box(400, 300), box_map("spot", 128)
    every = rsm_gather(large, seen, runtime=runtime)
    fractions, off = [], []
    for error in (0.01, 0.03):
        params = RsmGatherParams(resolution="adaptive", interpolation_error=error)
        technique = RsmGather(runtime, large.size, params)
        off.append(relative(technique(large, seen), every))
        fractions.append(technique.computed)
    # Measured at 800 x 600 with 400 samples: 0.6 and 1.4 % of the mean.
    assert off[0] < 0.015
    assert off[0] < off[1] < 0.03
    assert 0.0 < fractions[1] < fractions[0] < 0.15


def test_a_plain_wall_needs_few_pixels(runtime: Runtime) -> None:
    wall = facing(0.7, (129, 129), view_height=1.0)
    params = RsmGatherParams(resolution="adaptive", pattern="all")
    technique = RsmGather(runtime, wall.size, params)
    e = technique(wall, texel(size=8))
    every = rsm_gather(wall, texel(size=8), pattern="all", runtime=runtime)
    assert relative(e, every) < 0.02
    assert technique.computed < 0.1


def test_at_full_size_everything_is_computed(runtime: Runtime) -> None:
    technique = RsmGather(runtime, box().size)
    technique(box(), box_map())
    assert technique.computed == 1.0


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (7, 1), (3, 17), (9, 16)], ids=str)
@pytest.mark.parametrize("resolution", ["full", "adaptive"])
def test_images_of_any_size(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int], resolution: str
) -> None:
    gbuffer = scene("corner", camera(size=size), rng)
    params = RsmGatherParams(samples=20, resolution=resolution, interpolation_error=0.0)
    e = RsmGather(variant_runtime, size, params)(gbuffer, box_map())
    assert share_off(e, rsm_gather_reference(gbuffer, box_map(), params)) <= FLIPS


# ---- prepared once, called many times


@pytest.mark.parametrize("gather_method", ["flux", "rotated", "every", "published"])
def test_second_run_allocates_and_builds_nothing_and_gives_bit_identical_results(
    variant_runtime: Runtime, gather_method: str
) -> None:
    technique: RsmGather | RsmPublished
    if gather_method == "published":
        technique = RsmPublished(variant_runtime, box().size, RsmPublishedParams(samples=20))
    else:
        params = RsmGatherParams(samples=20, **GATHER_METHODS[gather_method])
        technique = RsmGather(variant_runtime, box().size, params)
    gbuffer, light = uploaded(variant_runtime, box()), on_device_rsm(box_map(), variant_runtime)
    check_second_run(variant_runtime, lambda: technique.run(gbuffer, light).download())


def test_what_depends_on_the_map_alone_is_made_when_it_changes(runtime: Runtime) -> None:
    technique = RsmGather(runtime, box().size)
    light = DeviceRsm(runtime, (33, 33))

    def passes(seen: ReflectiveShadowMap) -> set[str]:
        light.upload(seen)
        with runtime.frame():
            technique(box(), light)
            return {time.name for time in runtime.times()}

    one, other = box_map(), box_map("directional")
    assert "rsm_gather_pick" in passes(one)
    assert "rsm_gather_pick" not in passes(one)
    assert "rsm_gather_pick" in passes(other)
    np.testing.assert_array_equal(technique(box(), light), rsm_gather(box(), other, runtime=runtime))


def test_result_is_written_to_the_given_array(runtime: Runtime) -> None:
    out = np.zeros((*box().size, 3), np.float32)
    technique = RsmGather(runtime, box().size)
    assert technique(box(), box_map(), out) is out
    np.testing.assert_array_equal(out, rsm_gather(box(), box_map(), runtime=runtime))


# ---- bad input


def _dark(seen: ReflectiveShadowMap) -> ReflectiveShadowMap:
    return replace(seen, flux=np.zeros_like(np.asarray(seen.flux)))


def _empty(seen: ReflectiveShadowMap) -> ReflectiveShadowMap:
    return replace(seen, depth=np.full(np.shape(seen.depth), np.inf))


@pytest.mark.parametrize("change", [_dark, _empty])
@pytest.mark.parametrize("light", ["spot", "point"])
def test_a_map_without_light_gives_none(
    runtime: Runtime, change: Callable[[ReflectiveShadowMap], ReflectiveShadowMap], light: str, gather_method: str
) -> None:
    e = rsm_gather(box(), change(box_map(light)), 30, runtime=runtime, **GATHER_METHODS[gather_method])
    assert not e.any()


@pytest.mark.parametrize("light", LIGHTS)
def test_maps_of_one_texel_a_face(runtime: Runtime, light: str, gather_method: str) -> None:
    params = RsmGatherParams(samples=30, **GATHER_METHODS[gather_method])
    seen = box_map(light, 1)
    e = RsmGather(runtime, box().size, params)(box(), seen)
    assert share_off(e, rsm_gather_reference(box(), seen, params)) <= FLIPS


@pytest.mark.parametrize("factor", [1e-12, 1e6, 1e20])
def test_lights_of_any_power_scale_the_result(runtime: Runtime, factor: float, gather_method: str) -> None:
    seen = box_map()
    brighter = replace(seen, flux=np.asarray(seen.flux, np.float64) * factor)
    one = rsm_gather(box(), seen, 30, runtime=runtime, **GATHER_METHODS[gather_method])
    other = rsm_gather(box(), brighter, 30, runtime=runtime, **GATHER_METHODS[gather_method])
    np.testing.assert_allclose(other.astype(np.float64) / factor, one, rtol=1e-3, atol=1e-4 * one.mean())


def test_texels_a_million_times_brighter_than_others(runtime: Runtime, gather_method: str) -> None:
    seen = box_map()
    flux = np.asarray(seen.flux).copy()
    flux[16, 16] *= 1e6
    e = rsm_gather(box(), replace(seen, flux=flux), 30, runtime=runtime, **GATHER_METHODS[gather_method])
    assert np.isfinite(e).all()
    flux[16, 16] = 3e38
    e = rsm_gather(box(), replace(seen, flux=flux), 30, runtime=runtime, **GATHER_METHODS[gather_method])
    assert np.isfinite(e).all()


def test_a_light_inside_a_wall_lights_it_from_within(runtime: Runtime) -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    inside = PointLight((0.186, 0.08, 0.168), 1.0)  # in the short block
    seen = rsm(view.scene, inside, size=32, runtime=runtime)
    for gather_method in ("flux", "fixed", "rotated", "every"):
        e = rsm_gather(box(), seen, runtime=runtime, **GATHER_METHODS[gather_method])
        assert np.isfinite(e).all()


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e9, 1e15])
def test_a_scene_of_any_scale_gives_numbers_or_is_refused(runtime: Runtime, size: float) -> None:
    made = Camera.look_at(np.multiply(size, (0.1, 0.2, 1)), (0, 0, 0), width=9, height=9)
    gbuffer = GBuffer(camera=made, depth=np.full((9, 9), size))
    seen = texel(size=9, distance=size)
    for gather_method in GATHER_METHODS.values():
        if size not in (1e-6, 1e9):  # float32 does not hold fourth powers of distances there
            with pytest.raises(ValueError, match=r"expects 1e-07 to 1e\+09 \(scene units"):
                rsm_gather(gbuffer, seen, 30, runtime=runtime, **gather_method)
            continue
        assert np.isfinite(rsm_gather(gbuffer, seen, 30, runtime=runtime, **gather_method)).all()


@pytest.mark.parametrize(
    ("params", "error", "message"),
    [
        ({"samples": 0}, ValueError, r"samples is 0: expected an integer >= 1 and <= 65536"),
        ({"samples": 65537}, ValueError, r"samples is 65537: expected an integer >= 1 and"),
        ({"samples": 2.5}, TypeError, r"samples is 2.5: expected an integer"),
        ({"radius": 0.0}, ValueError, r"radius is 0.0: expected a number > 0.*sides of a face"),
        ({"radius": math.nan}, ValueError, r"radius is nan: expected a number > 0"),
        ({"radius": "wide"}, TypeError, r"radius is 'wide': expected a number"),
        ({"method": "xi"}, ValueError, r"method is 'xi': expected one of 'unbiased', 'published'"),
        ({"spacing": 4}, ValueError, r"spacing=4 applies only to method='published' \(got method"),
        ({"pattern": "disk"}, ValueError, r"pattern is 'disk': expected one of 'flux', 'fixed'"),
        ({"resolution": "third"}, ValueError, r"resolution is 'third': expected one of 'full'"),
        ({"interpolation_error": -0.1}, ValueError, r"interpolation_error is -0.1: expected a number >= 0"),
        ({"plane_tolerance": math.inf}, ValueError, r"plane_tolerance is inf: expected a number"),
        ({"colour": 1}, TypeError, r"colour"),
    ],
    ids=str,
)
def test_bad_parameter_is_refused_with_its_name_value_and_range(
    runtime: Runtime, params: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        rsm_gather(box(), box_map(), runtime=runtime, **params)


def test_other_sizes_and_things_are_refused(runtime: Runtime) -> None:
    technique = RsmGather(runtime, (8, 8))
    with pytest.raises(ValueError, match=r"size and margin are \(30, 40\).*expected \(8, 8\)"):
        technique(box(), box_map())
    with pytest.raises(ValueError, match=r"device G-buffer is empty: draw or upload something"):
        technique.run(DeviceGBuffer(runtime, (8, 8)), on_device_rsm(box_map(), runtime))
    with pytest.raises(TypeError, match=r"rsm is int: expected ReflectiveShadowMap or DeviceRsm"):
        rsm_gather(box(), 3, runtime=runtime)  # type: ignore[arg-type]


def test_faces_in_another_order_suit_flux_but_no_disk(runtime: Runtime) -> None:
    seen = box_map("point")
    order = [1, 0, 2, 3, 4, 5]

    def shuffled(name: str) -> NDArray[np.float32]:
        return np.concatenate([np.split(np.asarray(getattr(seen, name)), 6)[i] for i in order])

    names = ("depth", "position", "normal", "flux")
    other = replace(seen, camera=tuple(seen.cameras[i] for i in order), **{n: shuffled(n) for n in names})
    with pytest.raises(ValueError, match=r"has 6 faces: expected one, or the six of rasterize.rsm"):
        rsm_gather(box(), other, pattern="fixed", runtime=runtime)
    a, b = (rsm_gather(box(), m, pattern="all", runtime=runtime) for m in (seen, other))
    np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6 * a.mean())
