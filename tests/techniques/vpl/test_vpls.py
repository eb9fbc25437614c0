"""Virtual point lights: how many, where, how strong, and for which surface they stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import LUMINANCE, PARTS, Vpls
from ssgi_cl.device.rsm import on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.vpl.vpls import choose_vpls_reference
from ssgi_cl.techniques.vpl.flux_curve import FluxCurve, curve_key, hilbert_order
from ssgi_cl.techniques.vpl.vpl_choice import choose_vpls

from ...closed_forms import made as scene_of

CORNERS = np.array([(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)])


def floor(shift: ArrayLike = 0.0) -> Scene:
    """4 m^2 in the plane y = 0, normals up."""
    return scene_of(CORNERS + shift, [(0, 1, 2), (0, 2, 3)], np.tile([0.0, 1.0, 0.0], (4, 1)))


FLOOR = floor()
SUN = DirectionalLight((0.3, -1.0, 0.2), (2.0, 3.0, 4.0))
SPOT = SpotLight((0.0, 1.0, 0.0), (0.0, -1.0, 0.0), 0.6, (5.0, 4.0, 3.0))


def with_flux(made: ReflectiveShadowMap, flux: ArrayLike) -> ReflectiveShadowMap:
    return replace(made, flux=np.asarray(flux, np.float32))


def total(made: ReflectiveShadowMap) -> np.ndarray:
    return np.asarray(made.flux, np.float64).sum(axis=(0, 1))


@pytest.mark.parametrize("rows", [1, 2, 7, 8])
@pytest.mark.parametrize("columns", [1, 3, 8, 16])
def test_the_curve_visits_every_pixel_once(rows: int, columns: int) -> None:
    assert sorted(hilbert_order(rows, columns)) == list(range(rows * columns))


@pytest.mark.parametrize("side", [2, 4, 64])
def test_the_curve_goes_from_neighbour_to_neighbour(side: int) -> None:
    row, column = np.divmod(hilbert_order(side, side), side)
    np.testing.assert_array_equal(np.abs(np.diff(row)) + np.abs(np.diff(column)), 1)


def assert_same_lights(a: Vpls, b: Vpls) -> None:
    """Of float32 and float64. A middle may lie between two texels."""
    assert len(a) == len(b)
    # The luminance of texels of other colours rounds differently, so that edges move by some 1e-7
    # of the row: of thousands of pieces, by up to 1e-3 of one.
    np.testing.assert_allclose(a.flux, b.flux, rtol=1e-3)
    np.testing.assert_allclose(a.area, b.area, rtol=1e-3)
    same = np.abs(a.position - b.position).max(axis=1) < 1e-6
    same &= np.abs(a.normal - b.normal).max(axis=1) < 1e-6
    assert same.mean() > 0.995


@pytest.mark.parametrize("parts", [False, True])
@pytest.mark.parametrize("count", [1, 37, 500])
def test_every_kernel_variant_chooses_what_float64_chooses(variant_runtime: Runtime, count: int, parts: bool) -> None:
    runtime, box = variant_runtime, BUILTIN_SCENES["cornell_box"]()
    spots = [SpotLight((x, 0.5, 0.28), (0.0, -1.0, 0.0), 0.8, 0.2) for x in (0.15, 0.4)]
    maps = [rsm(box.scene, spot, size=size, runtime=runtime) for spot, size in zip(spots, (48, 61), strict=True)]
    maps.append(rsm(box.scene, PointLight((0.278, 0.3, 0.1), 1.0), size=17, runtime=runtime))
    found = choose_vpls(maps, count, parts=parts, runtime=runtime)
    wanted = choose_vpls_reference(maps, count, parts=parts)
    assert_same_lights(found, wanted)
    assert (found.parts is None) == (not parts)
    if found.parts is not None and wanted.parts is not None:
        assert_same_lights(found.parts, wanted.parts)


def test_every_kernel_variant_chooses_the_same(runtime: Runtime, other_variant: Runtime) -> None:
    one, other = (
        choose_vpls(rsm(FLOOR, SPOT, size=61, runtime=r), 100, parts=True, runtime=r) for r in (runtime, other_variant)
    )
    assert one.parts is not None
    assert other.parts is not None
    for name in ("position", "normal", "flux", "area"):
        # Maps drawn by other forms may differ by roundings of the device's divisions.
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-5, atol=1e-6)
        a, b = getattr(one.parts, name), getattr(other.parts, name)
        np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-6)


def test_parts_add_up_to_their_lights(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=64, runtime=runtime)
    lights = choose_vpls(made, 100, parts=True, runtime=runtime)
    assert lights.parts is not None
    for name in ("flux", "area"):
        whole, parts = getattr(lights, name), getattr(lights.parts, name)
        added = parts.reshape(100, PARTS, *whole.shape[1:]).sum(axis=1)
        np.testing.assert_allclose(added, whole, rtol=1e-9)


def test_one_texel_in_a_million_keeps_its_flux(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    made = rsm(FLOOR, SUN, size=256, runtime=variant_runtime)
    flux = np.asarray(made.flux) * 10.0 ** rng.uniform(-5, 0, (256, 256, 1))
    found = choose_vpls(with_flux(made, flux), 4096, runtime=variant_runtime)
    wanted = choose_vpls_reference([with_flux(made, flux)], 4096)
    # All texels have one colour, so that edges are where they are in float64; sums of 16 texels
    # that may be 10^5 times the piece's own.
    np.testing.assert_allclose(found.flux, wanted.flux, rtol=1e-5)


def test_sums_are_made_again_only_when_a_map_changes(runtime: Runtime) -> None:
    device = on_device_rsm(rsm(FLOOR, SPOT, size=32, runtime=runtime), runtime)
    curve = FluxCurve(runtime, curve_key([device]))
    curve.update([device])
    curve.update([device])
    assert curve.version == 1
    device.upload(rsm(FLOOR, SPOT, size=32, runtime=runtime))
    curve.update([device])
    assert curve.version == 2


@pytest.mark.parametrize("count", [1, 7, 100, 1000])
@pytest.mark.parametrize("light", [SUN, SPOT], ids=["sun", "spot"])
def test_flux_is_that_of_the_map(runtime: Runtime, light: SpotLight | DirectionalLight, count: int) -> None:
    made = rsm(FLOOR, light, size=64, runtime=runtime)
    lights = choose_vpls(made, count, runtime=runtime)
    assert len(lights) == count
    # Some float32 roundings of the sums of 16 texels, on the average.
    np.testing.assert_allclose(lights.flux.sum(axis=0), total(made), rtol=1e-6)


def test_all_lights_have_the_same_luminous_flux(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=64, runtime=runtime)
    flux = choose_vpls(made, 100, runtime=runtime).flux @ LUMINANCE
    np.testing.assert_allclose(flux, flux.mean(), rtol=2e-6)


def test_lights_lie_where_the_flux_is(runtime: Runtime, rng: np.random.Generator) -> None:
    made = rsm(FLOOR, SUN, size=64, runtime=runtime)
    flux = np.asarray(made.flux) * np.float32(1e-3)
    flux[:32] *= 3000.0
    lights = choose_vpls(with_flux(made, flux), 512, runtime=runtime)
    bright = np.asarray(made.position)[:32][np.asarray(made.flux)[:32, :, 0] > 0]
    low, high = bright.min(axis=0) - 1e-4, bright.max(axis=0) + 1e-4
    inside = ((lights.position >= low) & (lights.position <= high)).all(axis=1)
    # All but a 3000th of the flux, so that at most one light of 512 is elsewhere.
    assert np.count_nonzero(~inside) <= 1


def test_area_is_that_of_the_lit_surface(runtime: Runtime) -> None:
    made = rsm(FLOOR, SUN, size=128, runtime=runtime)
    area = choose_vpls(made, 300, runtime=runtime).area
    # 4 m^2; the outline is resolved to a texel of some 128 along each side.
    np.testing.assert_allclose(area.sum(), 4.0, rtol=0.02)
    # Evenly lit, so that each light has a 300th, but for the outline's texels.
    np.testing.assert_allclose(area, 4.0 / 300, rtol=0.1)


def test_a_spot_s_area_is_that_of_its_cone(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=256, runtime=runtime)
    lights = choose_vpls(made, 100, runtime=runtime)
    # A disc of radius tan(0.6), to a texel of its outline.
    np.testing.assert_allclose(lights.area.sum(), math.pi * math.tan(0.6) ** 2, rtol=0.01)


def test_normals_are_on_the_lit_side(runtime: Runtime) -> None:
    for light in (SUN, SPOT, replace(SPOT, position=(0, -1, 0), direction=(0, 1, 0))):
        made = rsm(FLOOR, light, size=32, runtime=runtime)
        up = -1.0 if light is not SUN and np.asarray(light.position)[1] < 0.0 else 1.0
        for turned in (1.0, -1.0):
            given = replace(made, normal=np.asarray(made.normal) * np.float32(turned))
            normal = choose_vpls(given, 50, runtime=runtime).normal
            np.testing.assert_allclose(normal, np.tile([0.0, up, 0.0], (50, 1)), atol=1e-6)


def test_more_lights_than_lit_texels_are_the_texels(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=16, runtime=runtime)
    lit = np.asarray(made.flux).max(axis=-1) > 0.0
    lights = choose_vpls(made, 1000, runtime=runtime)
    assert len(lights) == np.count_nonzero(lit)
    order = np.lexsort(lights.position.T)
    wanted = np.asarray(made.position, np.float64)[lit]
    # Float32 positions on both sides, one of them from depth.
    np.testing.assert_allclose(lights.position[order], wanted[np.lexsort(wanted.T)], rtol=0, atol=1e-6)


def test_unlit_maps_give_no_light(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=16, runtime=runtime)
    dark = with_flux(made, np.zeros((16, 16, 3)))
    assert len(choose_vpls(dark, 10, runtime=runtime)) == 0
    assert len(choose_vpls([dark, dark], 10, runtime=runtime)) == 0
    assert len(choose_vpls([], 10, runtime=runtime)) == 0


def test_a_map_of_one_texel_gives_one_light(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=1, runtime=runtime)
    lights = choose_vpls(made, 10, runtime=runtime)
    assert len(lights) == 1
    np.testing.assert_allclose(lights.flux[0], total(made), rtol=1e-6)


def test_several_lights_share_by_their_flux(runtime: Runtime) -> None:
    one = rsm(FLOOR, SPOT, size=64, runtime=runtime)
    flux = np.asarray(one.flux)
    lights = choose_vpls([one, with_flux(one, flux * 3), with_flux(one, flux * 0)], 400, runtime=runtime)
    np.testing.assert_allclose(lights.flux.sum(axis=0), 4.0 * total(one), rtol=1e-6)
    # Equal flux each: a quarter of the lights comes first, from the first map.
    np.testing.assert_allclose(lights.flux[:100].sum(axis=0), total(one), rtol=1e-6)


def test_a_light_a_million_times_brighter_takes_nearly_all(runtime: Runtime) -> None:
    one = rsm(FLOOR, SPOT, size=64, runtime=runtime)
    lights = choose_vpls([one, with_flux(one, np.asarray(one.flux) * 1e6)], 100, runtime=runtime)
    assert np.isfinite(lights.flux).all()
    np.testing.assert_allclose(lights.flux.sum(axis=0), (1 + 1e6) * total(one), rtol=1e-6)


def test_a_point_light_s_six_faces_count(runtime: Runtime) -> None:
    box = BUILTIN_SCENES["cornell_box"]()
    made = rsm(box.scene, PointLight((0.278, 0.3, 0.1), 1.0), size=32, runtime=runtime)
    lights = choose_vpls(made, 256, runtime=runtime)
    np.testing.assert_allclose(lights.flux.sum(axis=0), total(made), rtol=1e-6)
    wall = made.cameras[0]
    assert isinstance(wall, Camera)
    assert len(np.unique(np.abs(lights.normal).argmax(axis=1))) == 3  # walls of every direction


def test_a_small_turn_of_the_light_moves_lights_little(runtime: Runtime) -> None:
    first, second = (
        choose_vpls(
            rsm(FLOOR, replace(SPOT, position=(shift, 1.0, 0.0)), size=128, runtime=runtime), 256, runtime=runtime
        )
        for shift in (0.0, 0.01)
    )
    moved = np.linalg.norm(second.position - first.position, axis=1)
    # The light and all that it lights move by 0.01.
    assert np.median(moved) < 0.02
    assert moved.max() < 0.1


def test_far_from_the_origin_lights_are_as_exact_as_near_it(runtime: Runtime) -> None:
    shift = np.array([1e6, -2e6, 5e5])
    near = choose_vpls(rsm(FLOOR, SPOT, size=32, runtime=runtime), 64, runtime=runtime)
    spot = replace(SPOT, position=np.asarray(SPOT.position) + shift)
    far = choose_vpls(rsm(floor(shift), spot, size=32, runtime=runtime), 64, runtime=runtime)
    np.testing.assert_allclose(far.position - shift, near.position, rtol=0, atol=1e-5)
    np.testing.assert_allclose(far.area, near.area, rtol=1e-4)


def test_two_calls_give_the_same_lights(runtime: Runtime) -> None:
    made = rsm(FLOOR, SPOT, size=64, runtime=runtime)
    one, other = (choose_vpls(made, 100, runtime=runtime) for _ in range(2))
    for name in ("position", "normal", "flux", "area"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_merged_lights_keep_flux_and_area(rng: np.random.Generator) -> None:
    many = Vpls(rng.random((1000, 3)), np.tile([0.0, 1.0, 0.0], (1000, 1)), rng.random((1000, 3)), rng.random(1000))
    few = many.merged(13)
    assert len(few) == 13
    np.testing.assert_allclose(few.flux.sum(axis=0), many.flux.sum(axis=0), rtol=1e-12)
    np.testing.assert_allclose(few.area.sum(), many.area.sum(), rtol=1e-12)
    assert many.merged(1000) is many


@pytest.mark.parametrize(
    ("count", "error", "message"),
    [
        (0, ValueError, r"vpls is 0: expected an integer >= 1"),
        (-3, ValueError, r"vpls is -3: expected an integer >= 1"),
        (1 << 25, ValueError, r"vpls is 33554432: expected an integer >= 1 and <= 16777216 \(virt"),
        (2.5, TypeError, r"vpls is 2.5: expected an integer"),
    ],
)
def test_a_bad_count_is_refused(runtime: Runtime, count: int, error: type[Exception], message: str) -> None:
    made = rsm(FLOOR, SPOT, size=4, runtime=runtime)
    with pytest.raises(error, match=message):
        choose_vpls(made, count, runtime=runtime)


def test_something_else_than_a_map_is_refused(runtime: Runtime) -> None:
    with pytest.raises(TypeError, match="ndarray: expected ReflectiveShadowMap or DeviceRsm"):
        choose_vpls([np.ones(3)], 4, runtime=runtime)  # type: ignore[list-item]
