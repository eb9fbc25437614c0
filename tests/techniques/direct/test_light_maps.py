"""Maps of lights: drawn when something changed, kept when nothing did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.direct.light_data import PunctualLights
from ssgi_cl.techniques.direct.light_maps import LightMaps

SPOT = SpotLight((0.28, 0.5, 0.28), (0.0, -1.0, 0.0), 0.8, 0.2)
LAMP = PointLight((0.15, 0.3, 0.25), 0.1)
SUN = DirectionalLight((0.1, -0.2, 1.0), 2.0)
LIGHTS = (SPOT, Environment(0.5), LAMP, SUN)
KEPT = "neither it nor the scene changed"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return BUILTIN_SCENES["cornell_box"]().scene


def drawn(maps: LightMaps, scene: Scene, lights: Sequence[Light]) -> tuple[list[str], list[str]]:
    """Draw; return the lights whose maps were kept, and the names of the passes that ran."""
    with maps.runtime.frame():
        maps.draw(scene, lights)
        passes = maps.runtime.times()
    kept = [p.name for p in passes if p.skipped == KEPT]
    return kept, [p.name for p in passes if not p.skipped]


def planes(maps: LightMaps, scene: Scene, lights: Sequence[Light]) -> list[NDArray[np.float32]]:
    shadows, rsm = maps.draw(scene, lights)
    found = [shadow.depth.download() for shadow in shadows if shadow is not None]
    if rsm is not None:
        found += [p.download() for p in (rsm.position, rsm.normal, rsm.flux, rsm.area)]
    return found


@pytest.mark.parametrize("flux", [False, True])
def test_maps_are_kept_while_nothing_changes(runtime: Runtime, scene: Scene, flux: bool) -> None:
    maps = LightMaps(runtime, 32, flux=flux)
    assert drawn(maps, scene, LIGHTS)[0] == []
    # Equal lights are the same lights.
    again = (replace(SPOT), *LIGHTS[1:])
    names = ["map spot", "map point", "map directional"]
    assert drawn(maps, scene, again) == (names, ["shadow_blocks"] * 3)
    assert drawn(maps, scene, again) == (names, [])


@pytest.mark.parametrize("flux", [False, True])
@pytest.mark.parametrize("changed", range(4))
def test_what_changed_is_drawn_as_if_all_were(runtime: Runtime, scene: Scene, flux: bool, changed: int) -> None:
    others: list[Light] = [
        replace(SPOT, direction=(0.3, -1.0, 0.0)),
        Environment(0.1),
        replace(LAMP, intensity=0.3),
        replace(SUN, direction=(0.0, 0.0, 1.0)),
    ]
    lights: list[Light] = list(LIGHTS)
    lights[changed] = others[changed]
    maps = LightMaps(runtime, 32, flux=flux)
    maps.draw(scene, LIGHTS)
    for one, other in zip(
        planes(maps, scene, lights), planes(LightMaps(runtime, 32, flux=flux), scene, lights), strict=True
    ):
        np.testing.assert_array_equal(one, other)


def test_a_light_that_moves_leaves_the_others_maps(runtime: Runtime, scene: Scene) -> None:
    maps = LightMaps(runtime, 32, flux=True)
    maps.draw(scene, LIGHTS)
    moved = (SPOT, LIGHTS[1], replace(LAMP, position=(0.2, 0.3, 0.25)), SUN)
    assert drawn(maps, scene, moved)[0] == ["map spot", "map directional"]
    # Positions count from the first light: with it all of them change.
    assert drawn(maps, scene, (replace(SPOT, cone_angle=0.7), *moved[1:]))[0] == []


def test_blocks_lie_between_their_planes(variant_runtime: Runtime, scene: Scene) -> None:
    # Neither whole blocks nor whole lanes; beyond the front of the box is nothing.
    size = 75
    maps = LightMaps(variant_runtime, size, flux=False)
    punctual_lights = (SPOT, PointLight((0.278, 0.3, -0.5), 1.0), SUN)
    for number in range(2):
        shadows, _ = maps.draw(scene, punctual_lights)
        assert [s is not None and s.blocks is not None for s in shadows] == [number > 0] * 3
    for punctual_light, shadow in zip(punctual_lights, shadows, strict=True):
        assert shadow is not None
        assert shadow.blocks is not None
        depth = shadow.depth.download().astype(np.float64)
        measure = -depth if isinstance(punctual_light, DirectionalLight) else 1.0 / depth
        blocks = shadow.blocks.download().reshape(len(depth), 4, *shadow.blocks.size)
        for face, row, column in np.ndindex(len(depth), *shadow.blocks.size):
            # The 4 taps of a row that begin in the last of 8 texels end at the 11th.
            span = measure[face, 8 * row : 8 * row + 11, 8 * column : 8 * column + 11]
            highest, lowest, b, c = blocks[face, :, row, column].astype(np.float64)
            dy, dx = np.indices(span.shape)
            off = span - b * dx - c * dy
            # A few roundings of float32, of the terms that are summed.
            most = np.abs(span[np.isfinite(span)]).max(initial=0.0)
            room = 1e-6 * (most + 11.0 * (abs(b) + abs(c)))
            for found, expected in ((highest, off.max()), (lowest, off.min())):
                assert found == expected or abs(found - expected) <= room


@pytest.mark.slow  # frames with and without skips are compared in test_skips.py
def test_blocks_give_the_light_that_all_taps_give(variant_runtime: Runtime, scene: Scene) -> None:
    camera = BUILTIN_SCENES["cornell_box"]().camera(96, 70)
    device = Rasterizer(variant_runtime, camera.size).render(device_scene(scene, variant_runtime), camera)
    device.derive()
    shading = PunctualLights(variant_runtime, camera.size)
    maps = LightMaps(variant_runtime, 100, flux=False)
    # Flat, steep, nearly along walls, and from outside.
    punctual_lights = (
        SPOT,
        LAMP,
        SUN,
        DirectionalLight((1.0, -0.02, 0.3), 2.0),
        PointLight((0.278, 0.01, 0.28), 0.1),
        SpotLight((0.27, 0.3, -0.9), (0.1, -0.2, 1.0), 0.4, 1.0),
    )
    maps.draw(scene, punctual_lights)
    shadows, _ = maps.draw(scene, punctual_lights)
    for punctual_light, shadow in zip(punctual_lights, shadows, strict=True):
        assert shadow is not None
        lit = []
        for blocks in (None, shadow.blocks):
            plane = shading.run(device, [punctual_light], shadows=[replace(shadow, blocks=blocks)])
            assert plane is not None
            lit.append(plane.download())
        assert lit[0].any()
        np.testing.assert_array_equal(lit[1], lit[0])


def test_another_scene_or_number_of_lights_is_drawn_anew(runtime: Runtime, scene: Scene) -> None:
    maps = LightMaps(runtime, 32, flux=True)
    maps.draw(scene, LIGHTS)
    assert drawn(maps, replace(scene), LIGHTS)[0] == []
    assert drawn(maps, scene, LIGHTS[:3])[0] == []


def test_a_light_that_lights_nothing_says_so_in_every_frame(runtime: Runtime, scene: Scene) -> None:
    away = SpotLight((5.0, 5.0, 5.0), (0.0, 1.0, 0.0), 0.3, 1.0)
    maps = LightMaps(runtime, 32, flux=True)
    for _ in range(2):
        with runtime.frame():
            shadows, rsm = maps.draw(scene, (SPOT, away))
            reasons = {p.name: p.skipped for p in runtime.times()}
        assert shadows[1] is not None
        assert rsm is not None
        np.testing.assert_array_equal(rsm.lit(), [True, False])
        assert reasons["bounce spot"] == "it lights nothing that reflects"
    assert maps.draw(scene, (away,))[1] is None
    assert maps.draw(scene, (away,))[1] is None
    assert maps.draw(scene, (SPOT,))[1] is not None


def test_faces_that_reflect_are_told_in_every_kernel_variant(variant_runtime: Runtime, scene: Scene) -> None:
    # Beyond the front of the box is nothing.
    maps = LightMaps(variant_runtime, 19, flux=True)
    rsm = maps.draw(scene, (PointLight((0.278, 0.3, -0.5), 1.0),))[1]
    assert rsm is not None
    flux = rsm.flux.download().reshape(3, 6, -1)
    np.testing.assert_array_equal(rsm.lit(), flux.any(axis=(0, 2)))
    assert not rsm.lit().all()


def test_every_light_but_an_environment_has_a_map(runtime: Runtime, scene: Scene) -> None:
    maps = gi.shadow_maps(scene, LIGHTS, size=16, runtime=runtime)
    assert [None if each is None else each.light for each in maps] == [SPOT, None, LAMP, SUN]
    for light, own in zip(LIGHTS, maps, strict=True):
        if own is not None:
            alone = gi.rasterize.rsm(scene, light, size=16, runtime=runtime)
            np.testing.assert_array_equal(own.depth, alone.depth)
    with pytest.raises(ValueError, match=r"size is 0: expected an integer >= 1 and <= 8192"):
        gi.shadow_maps(scene, LIGHTS, size=0, runtime=runtime)
