"""Layers of surfaces that are seen through, as the rasteriser draws them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.blended_layers import MOST_LAYERS, BlendedLayers
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene

from ..squares import squares

SIZE = (35, 53)
Floats = NDArray[np.float32]


def camera_of(kind: str) -> Camera:
    rows, columns = SIZE
    if kind == "orthographic":
        seen = Camera.look_at((0, 0, 6), (0, 0, 0), width=columns, height=rows, near=0.5, far=20)
        projection = np.diag([0.4, 0.6, -2 / 19.5, 1.0])
        projection[2, 3] = -20.5 / 19.5
        return Camera(view=seen.view, projection=projection, width=columns, height=rows)
    return Camera.look_at(
        (0, 0, 6), (0, 0, 0), yfov=0.6, width=columns, height=rows, near=0.5, far=20, reversed_z=kind == "reversed"
    )


WALL = Material(albedo=(0.5,) * 3)


def glass(red: float, **rest: Any) -> Material:
    return Material(albedo=(0.05,) * 3, transmission=(red, 0.5, 0.25), **rest)


def layers_of(
    runtime: Runtime, scene: Scene, camera: Camera, margin: tuple[int, int] = (0, 0)
) -> list[dict[str, Floats]]:
    """Return depth, opacity, what is let through, normal and albedo of each layer."""
    parts = scene_parts(scene)
    assert parts.blended is not None
    rasterizer = Rasterizer(runtime, camera.size, margin=margin, world="until derived")
    found = []
    with runtime.frame():
        front = rasterizer.render(device_scene(parts.solid, runtime), camera)
        layers = BlendedLayers(runtime, camera.size, matt=False)
        for layer in layers.drawn(device_scene(parts.blended, runtime), camera, front):
            found.append(downloaded(layer))
    return found


def downloaded(layer: DeviceGBuffer) -> dict[str, Floats]:
    return {
        "depth": layer.depth.download()[0],
        "opacity": layer.opacity.download()[0],
        "through": np.moveaxis(layer.transmitted.download(), 0, -1),
        "albedo": np.moveaxis(layer.albedo.download(), 0, -1),
        "normal": np.moveaxis(layer.normal.download(), 0, -1),
    }


def covered(camera: Camera, z: float, half: float, middle: float = 0.0) -> NDArray[np.bool_]:
    """Return which pixels' centres see a square, by projecting them on its plane."""
    depth = np.full(camera.size, 6.0 - z)
    points = camera.unproject(depth)
    return (np.abs(points[..., 0] - middle) < half) & (np.abs(points[..., 1]) < half)


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "reversed"])
@pytest.mark.parametrize("margin", [(0, 0), (3, 5)])
def test_layers_come_nearest_first_and_end_before_the_wall(
    runtime: Runtime, kind: str, margin: tuple[int, int]
) -> None:
    camera = camera_of(kind)
    scene = squares(
        (0.4, 1.0, 0.7, glass(0.5)), (0.0, 0.0, 1.2, WALL), (0.0, -1.0, 2.0, glass(0.7)), (0.0, 2.0, 0.5, glass(0.9))
    )
    found = layers_of(runtime, scene, camera, margin)
    nearest, middle = covered(camera, 2.0, 0.5), covered(camera, 1.0, 0.7, 0.4)
    wall, last = covered(camera, 0.0, 1.2), covered(camera, -1.0, 2.0)
    expected = np.full((3, *camera.size), np.inf)
    for z, where in ((2.0, nearest), (1.0, middle), (-1.0, last & ~wall)):
        free = np.isinf(expected).argmax(axis=0)
        for layer in range(3):
            chosen = where & (free == layer)
            expected[layer][chosen] = 6.0 - z
    assert len(found) == int(np.isfinite(expected).any(axis=(1, 2)).sum())
    red = {4.0: 0.9, 5.0: 0.5, 7.0: 0.7}
    for layer, depth in zip(found, expected, strict=False):
        np.testing.assert_allclose(layer["depth"], depth, rtol=1e-5)
        there = np.isfinite(depth)
        np.testing.assert_array_equal(layer["opacity"], there)
        share = np.vectorize(lambda d: red.get(round(float(d), 3), 1.0))(np.where(there, depth, 0))
        np.testing.assert_allclose(layer["through"][..., 0], share, rtol=1e-6)
        np.testing.assert_allclose(layer["through"][..., 1], np.where(there, 0.5, 1.0), rtol=1e-6)
        np.testing.assert_allclose(layer["albedo"][there], 0.05, rtol=1e-6)
        np.testing.assert_allclose(layer["normal"][there], [[0, 0, 1]] * there.sum(), atol=1e-6)


def test_the_opacity_of_a_texture_is_that_of_its_texels(runtime: Runtime) -> None:
    texture = np.full((1, 4, 4), 255, np.uint8)
    texture[0, :, 3] = (0, 64, 128, 255)
    blended = Material(albedo=(0.5,) * 3, texture=0, alpha=0.5, blends=True, alpha_cutoff=0.5)
    camera = camera_of("orthographic")
    (layer,) = layers_of(runtime, squares((0, 1, 1, blended), textures=(texture,)), camera)
    # Bilinear between the texels' middles, repeated; a texel is half a unit wide.
    x = camera.unproject(np.full(SIZE, 5.0))[..., 0]
    place = (x + 1.0) * 2.0 - 0.5
    left = np.floor(place).astype(int)
    alpha = texture[0, :, 3] / 255.0
    mixed = alpha[left % 4] + (alpha[(left + 1) % 4] - alpha[left % 4]) * (place - left)
    there = covered(camera, 1.0, 1.0) & (mixed * 0.5 > 1e-2)
    assert there.sum() > 300
    np.testing.assert_allclose(layer["opacity"][there], mixed[there] * 0.5, atol=2e-5)
    through = 1.0 - layer["opacity"]
    np.testing.assert_allclose(layer["through"], through[..., None].repeat(3, -1), atol=1e-6)


def test_what_blends_may_be_of_glass_too(runtime: Runtime) -> None:
    camera = camera_of("perspective")
    half = glass(0.6, alpha=0.25, blends=True, alpha_cutoff=0.5)
    (layer,) = layers_of(runtime, squares((0, 1, 1, half)), camera)
    there = np.isfinite(layer["depth"])
    np.testing.assert_allclose(layer["opacity"][there], 0.25, rtol=1e-6)
    expected = [[0.75 + 0.25 * share for share in (0.6, 0.5, 0.25)]] * there.sum()
    np.testing.assert_allclose(layer["through"][there], expected, rtol=1e-6)


def test_texels_that_show_nothing_make_no_layer(runtime: Runtime) -> None:
    texture = np.full((1, 1, 4), 255, np.uint8)
    texture[..., 3] = 0
    clear = Material(texture=0, blends=True, alpha_cutoff=0.5)
    assert layers_of(runtime, squares((0, 1, 1, clear), textures=(texture,)), camera_of("")) == []


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_surface_on_a_wall_is_in_front_of_it(runtime: Runtime, kind: str) -> None:
    scene = squares((0, 0.0, 1.2, WALL), (0, 0.0, 0.8, glass(0.5)))
    camera = camera_of(kind)
    (layer,) = layers_of(runtime, scene, camera)
    np.testing.assert_array_equal(np.isfinite(layer["depth"]), covered(camera, 0.0, 0.8))


def test_more_layers_than_are_drawn_leave_out_the_last(runtime: Runtime) -> None:
    panes = [(0.0, -0.25 * i, 1.0, glass(0.5)) for i in range(MOST_LAYERS + 2)]
    found = layers_of(runtime, squares(*panes), camera_of("perspective"))
    assert [round(float(layer["depth"][17, 26]), 4) for layer in found] == [6.0 + 0.25 * i for i in range(MOST_LAYERS)]


def test_vertices_of_one_material_may_differ_in_what_they_let_through(runtime: Runtime) -> None:
    # Neighbouring pixels, and so lanes, of several materials: each has its own.
    parts = [(-1.3 + 0.2 * i, 1.0, 0.1, glass(0.05 * (i + 1))) for i in range(14)]
    camera = camera_of("orthographic")
    (layer,) = layers_of(runtime, squares(*parts), camera)
    x = camera.unproject(np.full(SIZE, 5.0))[..., 0]
    there = np.isfinite(layer["depth"]) & (np.abs((x + 1.4) / 0.2 % 1.0 - 0.5) < 0.45)
    number = np.floor((x + 1.4) / 0.2)
    np.testing.assert_allclose(layer["through"][there][:, 0], 0.05 * (number[there] + 1.0), rtol=1e-5)
