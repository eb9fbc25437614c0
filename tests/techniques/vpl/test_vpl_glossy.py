"""Virtual point lights with Phong lobes: their flux, their limits, the reference, bounds, bad
input."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Light, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.rsm import DeviceRsm, mirrored_axes, on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import rsm
from ssgi_cl.reference.vpl.vpl_splat import form_factor, lobe_share_exact, vpl_splat_reference
from ssgi_cl.reference.vpl.vpls import choose_vpls_reference
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.vpl.packed_vpls import lobe_share
from ssgi_cl.techniques.vpl.vpl_choice import choose_vpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams, vpl_splat

from ...closed_forms import quads
from ..analytic import Plane, camera, scene, slow_but, trace
from .given import NO_LIGHTS, assert_second_run_allocates_nothing, uploaded

ROUNDING = 2e-4
"""Relative to a pixel's irradiance and to a tenth of the mean: the 1000th power of a cosine that is
2^-24 off is 6e-5 off, and where the cutoff fades in, that counts for more than what is left."""


def lobes(rng: np.random.Generator, count: int = 100) -> Vpls:
    """Lights with lobes round the analytic scenes, which lie within 2 of the origin."""
    normal, axis = rng.standard_normal((2, count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis *= np.sign(np.sum(axis * normal, axis=1, keepdims=True))
    return Vpls(
        rng.uniform((-1.5, -0.2, -1.5), (1.5, 1.5, 1.5), (count, 3)),
        normal,
        rng.random((count, 3)) * 10.0 ** rng.uniform(-2, 2, (count, 1)),
        10.0 ** rng.uniform(-4, -1, count),
        None,
        axis,
        10.0 ** rng.uniform(-0.5, 3.3, count),
    )


def mirrored_light(runtime: Runtime, gbuffer: GBuffer, vpls: Vpls, **params: Any) -> NDArray[np.float32]:
    """Irradiance by lights with lobes alone, without what the cutoff leaves out."""
    params = {"vpls": 1, "glossy_vpls": max(len(vpls), 1), "restore": False, **params}
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(**params))
    result = technique.run(uploaded(runtime, gbuffer), NO_LIGHTS, glossy=vpls)
    return np.moveaxis(result.download(), 0, -1)


def assert_close(a: NDArray[Any], b: NDArray[Any], tolerance: float = ROUNDING) -> None:
    np.testing.assert_array_less(np.abs(a - b), tolerance * (np.abs(b) + 0.1 * b.mean()) + 1e-30)


# ---- flux


def test_the_share_of_a_lobe_above_its_surface_is_the_integral_over_it(rng: np.random.Generator) -> None:
    way = rng.standard_normal((400_000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    for exponent, cosine in ((1.0, 0.3), (4.0, 0.7), (30.0, 0.1), (30.0, 0.5)):
        axis = np.array([math.sqrt(1.0 - cosine**2), 0.0, cosine])
        lobe = np.maximum(way @ axis, 0.0) ** exponent * (exponent + 1.0) * 2.0
        # Standard error of these means: below 0.6 %.
        share = np.mean(lobe * (way[:, 2] > 0.0)) / np.mean(lobe)
        assert lobe_share_exact(exponent, cosine) == pytest.approx(share, abs=0.012)
    assert lobe_share_exact(7.0, 1.0) == pytest.approx(1.0)
    assert lobe_share_exact(7.0, 0.0) == pytest.approx(0.5)


def test_the_formula_of_that_share_is_within_the_error_that_it_names() -> None:
    exponent, cosine = 10.0 ** np.linspace(0.0, 3.0, 31), np.linspace(0.0, 1.0, 41)
    exact = np.array([[lobe_share_exact(n, c) for c in cosine] for n in exponent])
    found = lobe_share(exponent[:, None], cosine)
    np.testing.assert_allclose(found, exact, rtol=0.004)


@pytest.mark.parametrize("exponent", [1.0, 3.0, 20.0, 200.0])
@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.2])
def test_all_flux_of_a_light_arrives_on_a_sphere_round_it(exponent: float, cosine: float) -> None:
    """As in a furnace: what leaves the surface is what the light reflects, however it is tilted."""
    axis = np.array([[math.sqrt(1.0 - cosine**2), 0.0, cosine]])
    one = Vpls(
        np.zeros((1, 3)),
        np.array([[0.0, 0.0, 1.0]]),
        np.ones((1, 3)),
        np.array([1e-9]),
        None,
        axis,
        np.array([exponent]),
    )
    # Points spread evenly over a sphere by a Fibonacci spiral.
    count = 50_000
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * math.pi * (1.0 + math.sqrt(5.0))
    ring = np.sqrt(1.0 - height**2)
    point = 3.0 * np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    weight = form_factor(point, -point / 3.0, one, 0, VplSplatParams(cutoff=0.0))
    # The formula of the share is within 0.4 %, the edge of the lobe at the surface adds 0.1 %.
    assert np.mean(weight) * 4.0 * math.pi * 9.0 == pytest.approx(1.0, abs=5e-3)


def test_a_lobe_of_exponent_1_round_the_normal_is_a_diffuse_light(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(35, 50)), rng), lobes(rng)
    vpls = replace(vpls, axis=vpls.normal, gloss=np.ones(100))
    diffuse = replace(vpls, axis=None, gloss=None)
    for params in ({"cutoff": 0.0}, {"cutoff": 0.2, "interleave": True, "blur_radius": 0}):
        wanted = vpl_splat_reference(gbuffer, diffuse, VplSplatParams(**params))
        assert_close(mirrored_light(variant_runtime, gbuffer, vpls, **params), wanted)


def test_a_light_is_no_sharper_than_its_own_disc_lets_it_be(runtime: Runtime) -> None:
    gbuffer = trace(camera("orthographic", size=(9, 9), eye=(0, 0, 3), target=(0, 0, 0)), [Plane((0, 0, 0), (0, 0, 1))])
    down = np.array([[0.0, 0.0, -1.0]])
    for distance in (1e-3, 0.5, 4.0):
        one = Vpls(
            np.array([[0.0, 0.0, distance]]), down, np.ones((1, 3)), np.array([0.3]), None, down, np.array([500.0])
        )
        e = mirrored_light(runtime, gbuffer, one, cutoff=0.0)[4, 4, 0]
        sphere = 4.0 * math.pi * distance**2
        sharp = 499.0 * sphere / (sphere + 499.0 * 0.3)
        wanted = 1.0 / (2.0 * math.pi * distance**2 / (sharp + 2.0) + 0.3)
        assert e == pytest.approx(wanted, rel=1e-5)
        assert e <= 1.0 / 0.3


# ---- against the reference, and bounds


@pytest.mark.parametrize(
    "params",
    [
        {"cutoff": 0.3, "cull": False},
        {"cutoff": 0.0, "near": "clamped"},
        {"cutoff": 0.2, "interleave": True, "blur_radius": 0},
    ],
    ids=str,
)
def test_every_kernel_variant_agrees_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, params: dict[str, Any]
) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(35, 50)), rng), lobes(rng)
    e = mirrored_light(variant_runtime, gbuffer, vpls, **params)
    assert_close(e, vpl_splat_reference(gbuffer, vpls, VplSplatParams(**params)))


def test_forms_give_the_same_result(runtime: Runtime, other_variant: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(45, 61)), rng), lobes(rng)
    one, other = (mirrored_light(r, gbuffer, vpls, cutoff=0.3) for r in (runtime, other_variant))
    # Contraction is off, so variants differ only where a device's division is not exact; powers of
    # up to 1000 make more of that.
    np.testing.assert_allclose(one, other, rtol=1e-4)


@pytest.mark.parametrize("kind", slow_but(["perspective", "orthographic"], "perspective"))
@pytest.mark.parametrize("cutoff", [0.0, 0.01, 1.0, 30.0])
def test_tiles_leave_out_only_lobes_that_give_them_nothing(
    runtime: Runtime, rng: np.random.Generator, kind: str, cutoff: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(kind, size=(80, 100)), rng), lobes(rng, 1000)
    culled, whole = (mirrored_light(runtime, gbuffer, vpls, cutoff=cutoff, cull=cull) for cull in (True, False))
    # Other blocks of 64 lights are summed, so that the sums round differently.
    np.testing.assert_allclose(culled, whole, rtol=3e-6)
    np.testing.assert_array_equal(culled > 0.0, whole > 0.0)


def test_sharper_lobes_leave_tiles_shorter_lists(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(80, 100)), rng), lobes(rng, 1000)
    vpls = replace(vpls, area=np.full(1000, 1e-4))
    lengths = []
    for exponent in (2.0, 20.0, 200.0):
        params = VplSplatParams(vpls=1, glossy_vpls=1000, cutoff=0.05, restore=False)
        technique = VplSplat(runtime, gbuffer.size, params)
        sharp = replace(vpls, gloss=np.full(1000, exponent))
        technique.run(uploaded(runtime, gbuffer), NO_LIGHTS, glossy=sharp)
        lengths.append(np.mean([len(numbers) for numbers in technique.lists().flat]))
    # A sharper lobe is brighter along its axis too, so that it is cut off further away there.
    assert lengths[0] > 1.2 * lengths[1] > 1.3 * lengths[2]


def test_what_the_cut_leaves_out_of_lobes_can_be_put_back(runtime: Runtime) -> None:
    gbuffer, seen = polished(runtime)
    vpls = choose_vpls(seen, 512, glossy=True, runtime=runtime)
    whole = mirrored_light(runtime, gbuffer, vpls, cutoff=0.0)
    cut = mirrored_light(runtime, gbuffer, vpls, cutoff=2.0)
    put_back = mirrored_light(runtime, gbuffer, vpls, cutoff=2.0, restore=True)
    assert cut.mean() < 0.9 * whole.mean()
    # The rest is computed with 32 lights in place of 512.
    assert put_back.mean() == pytest.approx(whole.mean(), rel=0.05)


# ---- from scenes


def polished_scene(specular: float = 0.6, gloss: float = 60.0) -> Scene:
    """A polished floor and a matt wall."""
    made = quads(((-1, 0, -1), (2, 0, 0), (0, 0, 2)), ((-1, 0, -1), (2, 0, 0), (0, 2, 0)))
    ids = np.repeat([0, 1], len(made.triangles) // 2)
    floor = Material(albedo=(0.2, 0.2, 0.2), specular=(specular,) * 3, gloss=gloss)
    return replace(made, materials=(floor, Material()), material_ids=ids)


SPOT = SpotLight((0.0, 1.0, 0.8), (0.0, -1.0, -0.8), 0.3, 5.0)


def polished(runtime: Runtime) -> tuple[GBuffer, ReflectiveShadowMap]:
    from ssgi_cl.rasterize import gbuffer

    made = polished_scene()
    view = camera(size=(45, 60), eye=(0.3, 1.0, 3.0), target=(0.0, 0.6, 0.0))
    return gbuffer(made, view, runtime=runtime), rsm(made, SPOT, size=64, runtime=runtime)


@pytest.mark.parametrize(
    "light",
    [SPOT, PointLight((0.1, 0.7, 0.3), 2.0), DirectionalLight((0.1, -1.0, -0.3), 3.0)],
    ids=lambda light: type(light).__name__,
)
def test_maps_hold_what_materials_mirror(variant_runtime: Runtime, light: Any) -> None:
    seen = rsm(polished_scene(0.6, 60.0), light, size=32, runtime=variant_runtime)
    flux, mirrored = np.asarray(seen.flux), np.asarray(seen.specular_flux)
    floor = (np.asarray(seen.normal)[..., 1] ** 2 > 0.5) & np.isfinite(seen.depth)
    assert floor.any()
    np.testing.assert_allclose(mirrored[floor], 3.0 * flux[floor], rtol=1e-5)
    np.testing.assert_array_equal(mirrored[~floor], 0.0)
    np.testing.assert_array_equal(np.asarray(seen.gloss)[floor], 60.0)
    assert rsm(polished_scene(0.0), light, size=8, runtime=variant_runtime).specular_flux is None


@pytest.mark.parametrize("light", [SPOT, PointLight((0.1, 0.7, 0.3), 2.0)], ids=["spot", "point"])
def test_drawn_lobes_are_those_of_the_host(variant_runtime: Runtime, light: Light) -> None:
    made = polished_scene()
    maps = LightMaps(variant_runtime, 32, flux=True, glossy=True)
    with variant_runtime.frame():
        _, drawn = maps.draw(made, [light])
    assert drawn is not None
    assert drawn.lobes is not None
    host = rsm(made, light, size=32, runtime=variant_runtime)  # type: ignore[arg-type]
    given = on_device_rsm(host, variant_runtime)
    assert given.lobes is not None
    there = np.isfinite(np.asarray(host.depth))
    # The host has its normals, and the device its directions, in float32.
    np.testing.assert_allclose(
        np.moveaxis(drawn.lobes.axis.download(), 0, -1)[there], mirrored_axes(host)[there], atol=1e-5
    )
    for name in ("flux", "gloss"):
        np.testing.assert_allclose(
            getattr(drawn.lobes, name).download(), getattr(given.lobes, name).download(), rtol=1e-5
        )


def test_lights_with_lobes_are_chosen_as_in_the_reference(variant_runtime: Runtime) -> None:
    _, seen = polished(variant_runtime)
    other = rsm(polished_scene(0.2, 900.0), SPOT, size=32, runtime=variant_runtime)
    vpls = choose_vpls([seen, other], 200, glossy=True, runtime=variant_runtime)
    wanted = choose_vpls_reference([seen, other], 200, glossy=True)
    for name in ("position", "normal", "axis", "flux", "area", "gloss"):
        found, exact = getattr(vpls, name), getattr(wanted, name)
        off = np.abs(found - exact).reshape(200, -1).max(axis=1) > 1e-4 * np.abs(exact).max()
        # A middle may be on the edge of two texels.
        assert off.mean() < 0.02
    total = sum(np.asarray(m.specular_flux).sum(axis=(0, 1), dtype=np.float64) for m in (seen, other))
    np.testing.assert_allclose(vpls.flux.sum(axis=0), total, rtol=1e-5)
    # Three times the reflectance: by flux alone the sharper floor would get a quarter.
    sharp = np.mean(vpls.gloss == 900.0)  # type: ignore[arg-type]
    share = 0.2 * math.sqrt(901.0) / (0.2 * math.sqrt(901.0) + 0.6 * math.sqrt(61.0))
    assert sharp == pytest.approx(share, abs=0.02)


def test_a_polished_floor_throws_light_where_the_mirror_says(runtime: Runtime) -> None:
    gbuffer, _ = polished(runtime)
    narrow = SpotLight(SPOT.position, SPOT.direction, 0.03, 500.0)
    seen = rsm(polished_scene(gloss=500.0), narrow, size=64, runtime=runtime)
    matt = vpl_splat(gbuffer, seen, 256, 0.0, runtime=runtime)
    bright = vpl_splat(gbuffer, seen, 256, 0.0, glossy_vpls=1024, runtime=runtime) - matt
    # The beam goes down at a slope of 0.8 : 1 and hits the floor at z = 0: the mirrored one hits
    # the wall z = -1 at a height of 1 / 0.8.
    at = gbuffer.camera.unproject(np.asarray(gbuffer.depth))
    wall = np.abs(at[..., 2] + 1.0) < 1e-3  # nothing is at no place
    assert wall.any()
    assert np.average(at[wall, 1], weights=bright[wall, 0]) == pytest.approx(1.25, abs=0.05)


@pytest.mark.parametrize("interleave", [False, True])
def test_second_call_allocates_and_builds_nothing_and_gives_bit_identical_results(
    runtime: Runtime, interleave: bool
) -> None:
    gbuffer, seen = polished(runtime)
    device, maps = uploaded(runtime, gbuffer), [on_device_rsm(seen, runtime)]
    params = VplSplatParams(vpls=64, glossy_vpls=128, cutoff=0.5, interleave=interleave)
    technique = VplSplat(runtime, gbuffer.size, params)
    assert_second_run_allocates_nothing(runtime, lambda: technique.run(device, rsms=maps))


def test_a_scene_without_gloss_skips_lobes(runtime: Runtime) -> None:
    gbuffer, _ = polished(runtime)
    seen = rsm(polished_scene(0.0), SPOT, size=32, runtime=runtime)
    device, maps = uploaded(runtime, gbuffer), [on_device_rsm(seen, runtime)]
    assert maps[0].lobes is None
    technique = VplSplat(runtime, gbuffer.size, VplSplatParams(vpls=64, glossy_vpls=64))
    with runtime.frame():
        technique.run(device, rsms=maps)
        skipped = [entry for entry in runtime.times() if entry.skipped]
    assert any("nothing mirrors light" in str(entry.skipped) for entry in skipped)
    np.testing.assert_array_equal(
        vpl_splat(gbuffer, seen, 64, glossy_vpls=64, runtime=runtime), vpl_splat(gbuffer, seen, 64, runtime=runtime)
    )
    assert len(choose_vpls(seen, 8, glossy=True, runtime=runtime)) == 0


# ---- bad input


def test_lobes_where_none_are_expected_are_refused(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(size=(9, 9)), rng)
    device, vpls = uploaded(runtime, gbuffer), lobes(rng, 5)
    with pytest.raises(ValueError, match=r"vpls has lights with lobes: expected diffuse light"):
        VplSplat(runtime, (9, 9), VplSplatParams(vpls=5)).run(device, vpls)
    with pytest.raises(ValueError, match=r"vpls has lights with lobes: expected diffuse light"):
        MultiresSplat(runtime, (9, 9), MultiresSplatParams(vpls=5)).run(device, vpls)
    technique = VplSplat(runtime, (9, 9), VplSplatParams(vpls=5, glossy_vpls=5))
    with pytest.raises(ValueError, match=r"vpls has lights without lobes: expected lobes"):
        technique.run(device, NO_LIGHTS, glossy=replace(vpls, axis=None, gloss=None))
    _, seen = polished(runtime)
    with pytest.raises(ValueError, match=r"parts is True: expected False with glossy=True"):
        choose_vpls(seen, 5, glossy=True, parts=True, runtime=runtime)
    with pytest.raises(ValueError, match=r"glossy_vpls is -1: expected an integer >= 0"):
        vpl_splat(gbuffer, seen, glossy_vpls=-1, runtime=runtime)


def test_flux_without_gloss_and_wrong_shapes_are_refused(runtime: Runtime) -> None:
    _, seen = polished(runtime)
    with pytest.raises(ValueError, match=r"both of specular_flux and gloss, or neither"):
        replace(seen, gloss=None)
    with pytest.raises(ValueError, match=r"gloss has shape \(63, 64\): expected \(64, 64\)"):
        replace(seen, gloss=np.asarray(seen.gloss)[1:])
    plain = DeviceRsm(runtime, (64, 64))
    with pytest.raises(ValueError, match=r"no room for lobes: expected glossy=True"):
        plain.write_lobes(plain.area, plain.normal, plain.flux, plain.area)
