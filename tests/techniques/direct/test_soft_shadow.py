"""Shadows of lights with a size: against the float64 reference, paths, and lights without one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.truth import store

from .test_shade import white
from .test_shade_shadows import boxes

Light = SpotLight | PointLight | DirectionalLight

SCENE = boxes(
    [
        ((0, -0.05, 0), (6, 0.05, 6)),
        ((0, 0.5, 0), (0.3, 0.5, 0.3)),
        ((1.2, 0.75, -0.5), (0.04, 0.75, 0.04)),
        ((-1.1, 0.8, 0.3), (0.5, 0.02, 0.3)),
        ((0.6, 0.15, 1.0), (0.15, 0.15, 0.15)),
    ]
)
"""A floor with a block, a rod, a board in the air and a cube."""
LIGHTS: dict[str, Light] = {
    "spot": SpotLight((1.5, 3.5, 1.5), (-1.2, -3.3, -1.5), 0.7, 40.0, radius=0.25),
    "point": PointLight((-1.5, 2.5, 1.2), 20.0, radius=0.2),
    "sun": DirectionalLight((-0.5, -1.0, -0.6), 3.0, angle=0.05),
    "wide sun": DirectionalLight((-0.5, -1.0, -0.6), 3.0, angle=0.2),
}


def eye(width: int, height: int) -> Camera:
    return Camera.look_at((0, 3.2, 4.2), (0, 0.2, 0), width=width, height=height)


def hard(light: Light) -> Light:
    """Return the light without a size."""
    if isinstance(light, DirectionalLight):
        return replace(light, angle=0.0)
    return replace(light, radius=0.0)


@pytest.fixture(autouse=True)
def _own_store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(store, "truth_folder", lambda: tmp_path)


@pytest.mark.parametrize("name", LIGHTS)
def test_kernel_agrees_with_reference(variant_runtime: Runtime, name: str) -> None:
    light = LIGHTS[name]
    gbuffer = white(gi.rasterize.gbuffer(SCENE, eye(61, 45), runtime=variant_runtime))
    gbuffer = replace(gbuffer, specular=None, gloss=None)
    maps = [gi.rasterize.rsm(SCENE, light, size=96, runtime=variant_runtime)]
    found = shade(gbuffer, [light], shadow_maps=maps, runtime=variant_runtime)
    expected = shade_reference(gbuffer, [light], shadow_maps=maps)
    off = np.abs(found - expected)[..., 0] / expected.max()
    # A tap of 48 that falls to the other side of a texel's border is 1/48 of the light.
    assert (off < 1e-4).mean() > 0.9
    assert np.quantile(off, 0.995) < 0.05
    assert (off < 0.25).all()
    penumbra = np.abs(expected - shade_reference(gbuffer, [hard(light)], shadow_maps=maps))[..., 0] > 0.01
    assert penumbra.sum() > 20
    assert (off[penumbra] < 2e-3).mean() > 0.8


@pytest.mark.slow  # the penumbra's width has a closed form below, the kernel its reference
@pytest.mark.parametrize("name", LIGHTS)
def test_penumbrae_are_those_that_paths_find(runtime: Runtime, name: str) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    light, camera = LIGHTS[name], eye(160, 120)
    truth = gi.truth.radiance(SCENE, camera, [light], 256, 0).mean

    def error(one: Light) -> tuple[float, float]:
        found = gi.render(SCENE, camera, [one], bounces=0, ao=False, outputs=("radiance",), runtime=runtime).radiance
        rmse = float(np.sqrt(np.mean((found - truth) ** 2)) / truth.mean())
        return rmse, abs(float(found.mean() / truth.mean()) - 1.0)

    (soft, bias), (sharp, _) = error(light), error(hard(light))
    # At 400 x 300: .008 to .022 of the mean, in place of .031 to .068.
    assert soft < 0.55 * sharp
    assert bias < 0.01


def test_the_penumbra_grows_with_the_way_from_the_blocker(runtime: Runtime) -> None:
    """A board's edge before a wide sun: the penumbra's width is 2 tan(angle) times its height."""
    made = Camera.orthographic((0, 9, 0), (0, 0, 0), (0, 0, 1), view_height=0.25, width=128,
                               height=32)  # fmt: skip
    widths = []
    for height in (0.4, 0.8):
        scene = boxes([((0, -0.05, 0), (6, 0.05, 6)), ((-5.0, height, 0), (5.0, 0.001, 6))])
        light = DirectionalLight((0, -1, 0), 1.0, angle=0.15)
        floor = boxes([((0, -0.05, 0), (6, 0.05, 6))])
        gbuffer = white(gi.rasterize.gbuffer(floor, made, runtime=runtime))
        maps = [gi.rasterize.rsm(scene, light, size=1024, runtime=runtime)]
        share = shade(gbuffer, [light], shadow_maps=maps, runtime=runtime)[16, :, 0] * np.pi
        assert share[0] < 0.01 or share[-1] < 0.01
        widths.append(float(((share > 0.03) & (share < 0.97)).sum()) / 128)
    # Chords that cut .03 to .97 of a disc's area off span .86 of its width.
    for width, height in zip(widths, (0.4, 0.8), strict=True):
        expected = 0.86 * 2.0 * np.tan(0.15) * height
        assert abs(width / expected - 1.0) < 0.25  # a texel is an eighth of the narrower one


def test_planes_do_not_shadow_themselves(runtime: Runtime) -> None:
    scene = boxes([((0, -0.05, 0), (6, 0.05, 6))])
    gbuffer = white(gi.rasterize.gbuffer(scene, eye(64, 48), runtime=runtime))
    for light in LIGHTS.values():
        maps = [gi.rasterize.rsm(scene, light, size=128, runtime=runtime)]
        dimmed: NDArray[np.float32] = shade(gbuffer, [light], shadow_maps=maps, runtime=runtime)
        np.testing.assert_array_equal(dimmed, shade(gbuffer, [light], runtime=runtime))


def test_empty_maps_and_huge_lights_leave_finite_light(runtime: Runtime) -> None:
    gbuffer = white(gi.rasterize.gbuffer(SCENE, eye(32, 24), runtime=runtime))
    for light in (
        PointLight((-1.5, 2.5, 1.2), 20.0, radius=1e30),
        PointLight((0, 0, 0), 1.0, radius=1e-30),
        DirectionalLight((0, -1, 0), 1.0, angle=0.5),
    ):
        maps = [gi.rasterize.rsm(SCENE, light, size=16, runtime=runtime)]
        found = shade(gbuffer, [light], shadow_maps=maps, runtime=runtime)
        assert np.isfinite(found).all()
        assert (found >= 0.0).all()
