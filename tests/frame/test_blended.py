"""Surfaces that are seen through: the pass against the numpy reference, frames against closed forms and paths."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.reference.blended import blended_reference

from ..squares import squares
from .scenes import CORNERS, MAPS, QUADS, halves, scene_of


@pytest.mark.parametrize("count", [1, 2, 5])
def test_layers_are_blended_as_from_the_back_to_the_front(variant_runtime: Runtime, count: int) -> None:
    rng, size = np.random.default_rng(count), (23, 37)

    def blend(step: int, **images: NDArray[np.float64]) -> None:
        planes = {name: variant_runtime.plane(len(image), size) for name, image in images.items()}
        for name, plane in planes.items():
            plane.upload(images[name].astype(np.float32))
        kernel = variant_runtime.kernel("blended/blended.cl", {"BLENDED_STEP": step})
        kernel.run(size, over=over, through=through, **planes)

    over, through = (variant_runtime.plane(3, size, 7.0) for _ in range(2))
    layers = [[rng.random((planes, *size)) for planes in (3, 1, 3)] for _ in range(count)]
    for number, (light, opacity, transmitted) in enumerate(layers):
        light *= 10.0 ** rng.integers(-3, 4)
        blend(min(number, 1), radiance=light, opacity=opacity, transmitted=transmitted)
    behind = rng.random((3, *size)) * 5.0
    blend(2, radiance=behind)
    given = [(np.moveaxis(a, 0, -1), b[0], np.moveaxis(c, 0, -1)) for a, b, c in layers]
    expected = np.moveaxis(blended_reference(given, np.moveaxis(behind, 0, -1)), -1, 0)
    # Products of up to `count` numbers, summed: some roundings each, and those of the images.
    np.testing.assert_allclose(over.download(), expected, rtol=4e-7 * (count + 1))


# ---- frames

GLOW, SKY = (0.5, 2.0, 4.0), (3.0, 0.25, 1.0)
WALL = Material(albedo=(0.0,) * 3, emission=GLOW)
GLASS = Material(albedo=(0.0,) * 3, transmission=(0.9, 0.5, 0.2))
SMOKE = Material(albedo=(0.0,) * 3, emission=(8.0, 0.0, 1.0), alpha=0.25, blends=True, alpha_cutoff=0.5)
LIGHTS = (gi.PointLight((0.2, 0.5, 1.6), 3.0), gi.Environment((0.3, 0.3, 0.4)))
VIEW = gi.Camera.look_at((0.3, 0.1, 3.5), (0, 0, 0), yfov=0.6, width=80, height=60)
LOW: dict[str, Any] = {"preset": "low", **MAPS}
MODES: dict[str, dict[str, Any]] = {
    "whole": {"ao": False, **LOW},
    "direct": {"bounces": 0, "ao": False},
    "ssdo": {"indirect": "ssdo", "overscan": 0.1, "layers": 2},
    "multires": {"indirect": "multires", **MAPS},
}


def ahead(width: int = 61, height: int = 47) -> gi.Camera:
    return gi.Camera.look_at((0, 0, 6), (0, 0, 0), yfov=0.6, width=width, height=height)


def covers(camera: gi.Camera, part: tuple[float, float, float, Material]) -> NDArray[np.bool_]:
    middle, z, half, _ = part
    points = camera.unproject(np.full(camera.size, 6.0 - z))
    return (np.abs(points[..., 0] - middle) < half) & (np.abs(points[..., 1]) < half)


def over(seen: NDArray[np.float64], material: Material) -> NDArray[np.float64]:
    opacity = material.alpha if material.blends else 1.0
    through = 1.0 - opacity + opacity * np.array(material.transmitted)
    return opacity * np.array(material.emission) + through * seen


def radiance(runtime: Runtime, scene: Scene, camera: gi.Camera, lights: Any = (), **given: Any) -> NDArray[np.float32]:
    return gi.render(scene, camera, lights, runtime=runtime, outputs=["radiance"], **given).radiance


@pytest.mark.parametrize("mode", MODES)
def test_surfaces_without_albedo_show_what_is_behind_them(runtime: Runtime, mode: str) -> None:
    camera = ahead()
    parts = [(0.2, -1.0, 1.0, WALL), (-0.6, 0.0, 0.6, GLASS), (0.0, 1.0, 0.5, SMOKE),
             (0.1, 2.0, 0.3, GLASS)]  # fmt: skip
    lights = [gi.Environment(SKY), gi.SpotLight((0, 0, 5), (0, 0, -1), 0.5, 1.0)]
    found = radiance(runtime, squares(*parts), camera, lights, edges=0, **MODES[mode])
    expected = np.tile(np.array(SKY), (*camera.size, 1))
    for number, part in enumerate(parts):
        where = covers(camera, part)
        expected[where] = GLOW if number == 0 else over(expected[where], part[3])
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("mode", ["whole", "direct"])
def test_without_anything_solid_the_sky_is_behind_and_lights_layers(runtime: Runtime, mode: str) -> None:
    camera = ahead()
    pane = (-1.0, 1.0, 0.5, GLASS)
    matt = (0.8, 1.0, 0.5, Material(albedo=(0.5, 0.4, 0.2), alpha=0.999, blends=True))
    found = radiance(runtime, squares(pane, matt), camera, [gi.Environment(SKY)], **MODES[mode])
    expected = np.tile(np.array(SKY), (*camera.size, 1))
    expected[covers(camera, pane)] *= GLASS.transmission
    # What nothing hides gets pi L of it; directions of the preset "low" sum to .94 pi.
    np.testing.assert_allclose(found[covers(camera, matt)].mean(axis=0), np.array(SKY) * (0.5, 0.4, 0.2), rtol=0.08)
    elsewhere = ~covers(camera, matt)
    np.testing.assert_allclose(found[elsewhere], expected[elsewhere], rtol=1e-6)


def test_what_is_behind_a_wall_changes_nothing(runtime: Runtime) -> None:
    camera, lights = ahead(), [gi.Environment(SKY), gi.PointLight((1.0, 1.0, 4.0), 20.0)]
    wall = (0.0, 0.0, 1.5, Material())
    alone, behind = (
        radiance(runtime, squares(wall, *more), camera, lights, ao=False, **LOW)
        for more in ((), [(0.0, -0.5, 1.0, GLASS)])
    )
    np.testing.assert_array_equal(behind, alone)


def room(*panes: Material) -> Scene:
    """Return a box open towards the viewer with panes across it."""
    corners, quads = [*CORNERS], [*QUADS[:5]]
    for number in range(len(panes)):
        z, first = 0.2 + 0.4 * number, len(corners)
        corners += [[-0.9, -0.4, z], [0.3, -0.4, z], [0.3, 0.6, z], [-0.9, 0.6, z]]
        quads.append((first, first + 1, first + 2, first + 3))
    ids = np.repeat([0] * 5 + [1 + number for number in range(len(panes))], 2)
    return scene_of(corners, halves(quads), Material(albedo=(0.7, 0.6, 0.4)), *panes, ids=ids)


PAINTED = Material(albedo=(0.9, 0.5, 0.2), alpha=0.6, blends=True, alpha_cutoff=0.5)
TINTED = Material(albedo=(0.05,) * 3, transmission=(0.6, 0.85, 0.85), specular=(0.1,) * 3, gloss=30)
# One stops nearly all light and one hardly any, as frames take it on its way from lights.
PANES = room(replace(TINTED, transmission=(0.8, 0.85, 0.85)), replace(PAINTED, alpha=0.95))


def means(found: NDArray[np.float32]) -> list[float]:
    """Return the means of the picture's rows and columns within both of `PANES`, and of those beside them."""
    return [*found[20:38, 20:40].mean(axis=(0, 1)), found[5:55, 60:78].mean()]


PATHS = [0.7671, 0.4188, 0.1805, 0.2342]
"""The same means by 2048 paths per pixel."""


def test_layers_are_lit_as_paths_find(runtime: Runtime) -> None:
    # .8 % off as measured; without the light of the sky 15 %.
    found = means(radiance(runtime, PANES, VIEW, LIGHTS, ao=False, **MAPS))
    np.testing.assert_allclose(found[:3], PATHS[:3], rtol=0.03)
    np.testing.assert_allclose(found[3], PATHS[3], rtol=0.02)


@pytest.mark.slow
def test_the_means_by_paths_are_those_in_use() -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    np.testing.assert_allclose(means(gi.truth.radiance(PANES, VIEW, LIGHTS, 256).mean), PATHS, rtol=0.005)


def test_an_opaque_layer_looks_as_if_it_were_solid(runtime: Runtime) -> None:
    solid = replace(PAINTED, alpha=1.0, blends=False, alpha_cutoff=0.0)
    # Edges of layers are those of pixels.
    found = radiance(runtime, room(replace(solid, blends=True)), VIEW, LIGHTS, ao=False, edges=0, **LOW)
    expected = radiance(runtime, room(solid), VIEW, LIGHTS, ao=False, edges=0, **LOW)
    # The gather's own error is 15 % of the mean; both choose where to compute.
    assert np.abs(found - expected).mean() < 0.02 * expected.mean()


def test_lobes_of_layers_reflect_lights(runtime: Runtime) -> None:
    camera = ahead()
    light = [gi.DirectionalLight((0.0, 0.0, -1.0), 2.0)]
    dull, shiny = (
        radiance(runtime, squares((0.0, -1.0, 2.0, Material()), (0, 1, 0.5, pane)), camera, light, ao=False, **LOW)
        for pane in (GLASS, replace(GLASS, specular=(0.1,) * 3, gloss=50.0))
    )
    bright = 0.1 * (50.0 + 1.0) / (2.0 * np.pi) * 2.0  # straight back to the eye
    np.testing.assert_allclose((shiny - dull)[23, 30], bright, rtol=0.05)
    np.testing.assert_array_equal((shiny - dull)[0], 0.0)


def test_other_outputs_and_later_frames_are_those_without_layers(runtime: Runtime) -> None:
    thin = replace(PAINTED, alpha=0.4)  # casts no shadow
    scene = room(thin, TINTED)
    renderer, other = (Renderer(runtime, VIEW.size, FrameParams(ao=False, **LOW)) for _ in range(2))
    outputs = ["radiance", "indirect"]
    first = renderer(scene, VIEW, LIGHTS, outputs=outputs)
    assert first.indirect is not None
    solid = other(scene_parts(scene).solid, VIEW, LIGHTS, outputs=outputs)
    np.testing.assert_array_equal(first.indirect, solid.indirect)
    brighter = [gi.PointLight((0.2, 0.5, 1.6), 6.0), LIGHTS[1]]
    renderer(scene, VIEW, brighter, outputs=outputs)
    again = renderer(scene, VIEW, LIGHTS, outputs=outputs)
    np.testing.assert_allclose(again.radiance, first.radiance, rtol=1e-5, atol=1e-6)
    # Only what sums up light runs again: it finds all irradiance as it was before the layers.
    shown = renderer(scene, VIEW, LIGHTS, outputs=outputs, multi_bounce=True)
    np.testing.assert_array_equal(shown.indirect, again.indirect)
    np.testing.assert_array_equal(shown.radiance, again.radiance)


def test_layers_are_drawn_nearest_first_and_hidden_by_what_is_solid(runtime: Runtime) -> None:
    camera = ahead()
    near, far, hidden = (0.0, 1.0, 0.5, SMOKE), (0.2, 0.0, 0.9, GLASS), (0.0, -2.0, 0.3, GLASS)
    scene = squares((0.2, -1.0, 1.0, WALL), hidden, far, near)
    layers = gi.blended_layers(scene, camera, runtime=runtime)
    assert len(layers) == 2
    first, second = covers(camera, near), covers(camera, far)
    np.testing.assert_array_equal(layers[0].opacity > 0.0, first | second)
    np.testing.assert_array_equal(layers[0].opacity[first], 0.25)
    np.testing.assert_allclose(
        layers[0].transmitted[second & ~first], np.tile((0.9, 0.5, 0.2), ((second & ~first).sum(), 1))
    )
    np.testing.assert_array_equal(np.isfinite(np.asarray(layers[1].gbuffer.depth)), first & second)
    np.testing.assert_allclose(np.asarray(layers[1].gbuffer.depth)[first & second], 6.0, rtol=1e-5)
    assert gi.blended_layers(squares((0.0, 0.0, 1.0, WALL)), camera, runtime=runtime) == ()
    with pytest.raises(TypeError, match="scene is int: expected a Scene"):
        gi.blended_layers(3, camera, runtime=runtime)


def test_layers_are_lit_by_the_depth_maps_of_the_surfaces_behind_them(runtime: Runtime) -> None:
    panes = room(replace(TINTED, transmission=(0.8, 0.85, 0.85)), replace(PAINTED, alpha=0.95))
    frame = gi.render(panes, ahead(), [gi.Environment(SKY)], runtime=runtime, skips=(), **LOW)
    drawn = [entry for entry in frame.passes if entry.name == "sampled_triangles"]
    assert len(drawn) == 1
    assert [entry.name for entry in frame.passes].count("sampled_lights") == 3
