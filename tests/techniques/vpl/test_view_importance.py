"""Lights chosen by what they send to the image: against the reference, where they go, their sum."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight
from ssgi_cl.core.vpls import cut_evenly
from ssgi_cl.device.rsm import on_device_rsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.vpl.view_importance import GROUP, run_weights, view_importance_reference
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.vpl.flux_curve import RUN, FluxCurve, curve_key, hilbert_order
from ssgi_cl.techniques.vpl.vpl_choice import ChosenVpls, choose_vpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams

from ...closed_forms import quads
from .given import cornell_box, uploaded, walls_between


@pytest.mark.parametrize("overscan", [0.0, 0.1])
def test_importance_agrees_with_the_reference(variant_runtime: Runtime, overscan: float) -> None:
    gbuffer, seen = cornell_box(variant_runtime, 72, 54, 100, layers=2, overscan=overscan)
    technique = MultiresSplat(variant_runtime, gbuffer.size, MultiresSplatParams(vpls=500, visibility=True, grid=32))
    device, map_ = uploaded(variant_runtime, gbuffer), on_device_rsm(seen, variant_runtime)
    technique.run(device, rsms=[map_])
    array = technique._importance._importance
    assert array is not None
    found = array.download().astype(np.float64)
    runs = len(found) // 2 - 1
    sums = found[: 2 * runs].reshape(2, runs)
    np.testing.assert_allclose(found[2 * runs :], sums.sum(axis=1), rtol=1e-5)

    walls = walls_between(gbuffer, seen, choose_vpls(seen, 500, runtime=variant_runtime), 32)
    wanted = view_importance_reference(seen, gbuffer, walls)
    np.testing.assert_array_equal(sums[1], wanted[1])
    assert sums[1].sum() > 1000
    # The device counts in other lengths; the grid's box is round the same points.
    sums[0] /= technique._lights.unit**2
    # A ray along the side of a cell may be blocked in one of the two alone.
    assert np.mean(np.abs(sums[0] - wanted[0]) > 1e-3 * wanted[0].mean()) < 0.02
    np.testing.assert_allclose(run_weights(sums), run_weights(wanted), rtol=0.2)
    assert np.ptp(run_weights(wanted)) > 1.0


def two_rooms(runtime: Runtime) -> tuple[Any, Any, Any]:
    """A floor in the sun, half of it behind a wall; the camera sees the other half and its end."""
    scene = quads(
        ((-2, 0, -1), (4, 0, 0), (0, 0, 2)), ((0, 0, -1), (0, 3, 0), (0, 0, 2)), ((2, 0, -1), (0, 2, 0), (0, 0, 2))
    )
    camera = Camera.look_at((0.3, 1.0, 0), (2.0, 0.6, 0), yfov=1.2, width=64, height=48)
    gbuffer = drawn(scene, camera, runtime=runtime)
    return scene, gbuffer, rsm(scene, DirectionalLight((0, -1, 0), 1.0), size=128, runtime=runtime)


@pytest.mark.parametrize("kind", ["multires", "vpl"])
def test_lights_go_where_they_reach_the_image_and_keep_the_flux_of_the_map(variant_runtime: Runtime, kind: str) -> None:
    scene, gbuffer, seen = two_rooms(variant_runtime)
    device, map_ = uploaded(variant_runtime, gbuffer), on_device_rsm(seen, variant_runtime)
    solid, view, shares = device_scene(scene, variant_runtime), gbuffer.camera.view, []
    for importance in (False, True):
        given: dict[str, Any] = {"vpls": 512, "cutoff": 0.0, "visibility": True, "importance": importance}
        technique: Any
        if kind == "multires":
            technique = MultiresSplat(variant_runtime, gbuffer.size, MultiresSplatParams(**given))
        else:
            technique = VplSplat(variant_runtime, gbuffer.size, VplSplatParams(**given, interleave=True))
        technique.run(device, rsms=[map_], scene=solid)
        lights = technique._lights
        values = lights.lights.download().reshape(lights.segments, lights.span, -1)
        values = values[:, : lights.stride].reshape(-1, values.shape[-1]).astype(np.float64)
        x = ((values[:, :3] * lights.unit - view[:3, 3]) @ view[:3, :3])[:, 0]
        flux = values[:, 8]
        there = flux > 0.0
        # A piece of the curve may lie on both sides: one in some 50, of a fiftieth of the flux.
        assert flux[x > 0.0].sum() / flux.sum() == pytest.approx(0.5, abs=0.02)
        shares.append((np.mean(x[there] > 0.0), flux.sum()))
    (by_flux, sum_by_flux), (by_importance, sum_by_importance) = shares
    assert by_flux == pytest.approx(0.5, abs=0.02)
    # What reaches nothing counts a tenth, the square root of VPL_LEAST, or less of what does.
    assert by_importance > 0.85
    assert sum_by_importance == pytest.approx(sum_by_flux, rel=1e-5)


@pytest.mark.slow  # the means of 33 images; the choice and the rays are held to the reference above
def test_shared_shadow_rays_and_importance_change_no_mean(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["parlour"]()
    gbuffer = uploaded(runtime, drawn(made.scene, made.camera(120, 90), runtime=runtime))
    punctual_lights = [light for light in made.lights if type(light).__name__ != "Environment"]
    maps = [
        on_device_rsm(rsm(made.scene, punctual_light, size=256, runtime=runtime))
        for punctual_light in punctual_lights[:1]
    ]  # type: ignore[arg-type]
    solid = device_scene(made.scene, runtime)
    means = {}
    for share, importance in ((1, True), (16, True), (16, False)):
        params = [
            VplSplatParams(
                vpls=count,
                cutoff=0.0,
                interleave=True,
                visibility=True,
                share=share,
                importance=importance,
                blur_radius=0,
            )
            for count in range(1000, 2001, 100)
        ]
        means[share, importance] = [
            float(
                VplSplat(runtime, gbuffer.size, own)
                .run(gbuffer, rsms=maps, scene=solid)
                .download()
                .mean(dtype=np.float64)
            )
            for own in params
        ]
    one = np.mean(means[1, True])
    # Measured: -0.05 and -0.1 %, of which noise is 0.3 %. A ray to any light of a group, whatever
    # its flux, is 1.8 % off with importance.
    assert np.mean(means[16, True]) == pytest.approx(one, rel=0.006)
    assert np.mean(means[16, False]) == pytest.approx(one, rel=0.01)


def test_given_lights_are_not_chosen_anew(runtime: Runtime) -> None:
    scene, gbuffer, seen = two_rooms(runtime)
    device, vpls = uploaded(runtime, gbuffer), choose_vpls(seen, 256, runtime=runtime)
    made = [
        MultiresSplat(runtime, gbuffer.size, MultiresSplatParams(vpls=256, visibility=True, importance=importance))
        .run(device, vpls, rsms=[on_device_rsm(seen, runtime)], scene=device_scene(scene, runtime))
        .download()
        for importance in (False, True)
    ]
    np.testing.assert_array_equal(*made)


def test_importance_makes_the_sums_anew(runtime: Runtime) -> None:
    _, _, seen = two_rooms(runtime)
    device = on_device_rsm(seen, runtime)
    curve = FluxCurve(runtime, curve_key([device]))
    curve.update([device])
    plain = curve.blocks.download().copy()
    ones = np.zeros(2 * curve.run_count + 2, np.float32)
    ones[: curve.run_count] = ones[curve.run_count : -2] = 1.0
    ones[-2:] = curve.run_count
    curve.update([device], runtime.array(ones))
    weighted = curve.blocks.download()
    # All as important as the mean: sqrt(1 + VPL_LEAST) times the luminance, and nothing else.
    sums = [values.reshape(2, 6, -1)[0, :, -1] for values in (plain, weighted)]
    factor = np.array([1.0, np.sqrt(1.01), 1.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(sums[1], sums[0] * factor, rtol=1e-5)


def test_pieces_are_cut_by_importance_and_lights_lie_amid_their_flux(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    seen = rsm(
        quads(((-1, 0, -1), (2, 0, 0), (0, 0, 2))), DirectionalLight((0, -1, 0), 1.0), size=64, runtime=variant_runtime
    )
    flux = 10.0 ** rng.uniform(-2, 0, (64, 64, 1)) * np.ones(3)
    seen = replace(seen, flux=np.where(np.asarray(seen.flux) > 0.0, flux, 0.0).astype(np.float32))
    device = on_device_rsm(seen, variant_runtime)
    curve = FluxCurve(variant_runtime, curve_key([device]))
    chosen = ChosenVpls(curve, 50)
    # Groups of runs that differ by a factor of ten in their weight.
    groups = np.where(rng.random(curve.run_count // GROUP) < 0.5, 0.0, 4.0).repeat(GROUP)
    importance = np.stack([groups, np.ones_like(groups)])
    sums = np.append(importance.ravel(), importance.sum(axis=1)).astype(np.float32)
    curve.update([device], variant_runtime.array(sums))
    chosen.update()
    found = chosen.download()

    order = hilbert_order(64, 64)
    row = np.asarray(seen.flux, np.float64).reshape(-1, 3)[order]
    weights = run_weights(importance)[np.arange(len(order)) // RUN]
    lit = row[:, 0] > 0.0
    amounts = np.vstack([row[lit].T, np.ones(lit.sum())])
    _, wanted, _ = cut_evenly(amounts, 50, weights[lit])
    # Float32 sums of 10^4 texels; an edge of a piece is that of the next.
    np.testing.assert_allclose(found.flux, wanted, rtol=1e-3, atol=1e-3 * wanted.mean())
    half = np.cumsum(wanted[:, 0]) - 0.5 * wanted[:, 0]
    texel = np.searchsorted(np.cumsum(row[lit][:, 0]), half)
    position = np.asarray(seen.position, np.float64).reshape(-1, 3)[order][lit]
    there = position[texel] + seen.cameras[0].position * 0.0
    # Rounding may take the texel beside it.
    near = np.abs(found.position - there).max(axis=1) < 1e-5
    assert near.mean() > 0.95
    assert np.ptp(found.flux[:, 0]) > 4.0 * found.flux[:, 0].min()
