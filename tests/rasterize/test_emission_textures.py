"""Textures of emission: what pixels show, what surfels and paths take of them, and what files say."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Material, Scene, mean_emission
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.raster import opengl
from ssgi_cl.techniques.radiosity.surfels import scene_surfels

from . import meshes
from .loading import Gltf, png, written
from .test_texture_wraps import CAMERA, TEXELS, expected

GLOW = (2.0, 3.0, 4.0)
LINEAR = srgb_to_linear(TEXELS[..., :3] / 255.0)


def square(**material: Any) -> Scene:
    """Make the square of the tests of wraps, which glows."""
    uvs = [(-1.3, -1.7), (2.1, -1.7), (2.1, 1.9), (-1.3, 1.9)]
    glowing = Material(albedo=(0, 0, 0), emission=GLOW, emission_texture=0, **material)
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    return meshes.quad(corners, uvs=uvs, materials=(glowing,), textures=(TEXELS,))


@pytest.mark.parametrize("texture", [-1, 0])
def test_pixels_emit_by_texel(variant_runtime: Runtime, texture: int) -> None:
    found = gi.rasterize.gbuffer(square(texture=texture), CAMERA, runtime=variant_runtime).emission
    np.testing.assert_allclose(found, expected(("repeat", "repeat"), LINEAR) * GLOW, atol=4e-4)


def test_materials_without_a_texture_emit_their_factor_beside(runtime: Runtime) -> None:
    scene = square()
    plain = replace(scene.materials[0], emission_texture=-1)
    both = replace(scene, materials=(scene.materials[0], plain), material_ids=np.array([0, 1], np.int32))
    found = gi.rasterize.gbuffer(both, CAMERA, runtime=runtime).emission
    assert found is not None
    np.testing.assert_array_equal(found[5, 5], GLOW)  # the upper left triangle
    assert (np.asarray(found[50, 55]) < GLOW).all()


@pytest.mark.usefixtures("opengl_runs")
def test_the_opengl_backend_takes_the_mean() -> None:
    scene = square()
    found = opengl.gbuffer_arrays(scene, CAMERA)["emission"][0]
    np.testing.assert_allclose(found[30, 30], mean_emission(scene, scene.materials[0]), rtol=1e-6)
    np.testing.assert_allclose(mean_emission(scene, scene.materials[0]), LINEAR.mean(axis=(0, 1)) * GLOW)


def test_surfels_take_the_flux_of_the_texels() -> None:
    surfels = scene_surfels(square(), 8192)
    flux = (surfels.part_area[:, None] * surfels.part_emission).sum(axis=0)
    # Both sides of 4 square units, by the nearest texel of each point.
    shown = expected(("repeat", "repeat"), LINEAR).mean(axis=(0, 1)) * GLOW
    np.testing.assert_allclose(flux, 8.0 * shown, rtol=0.06)


def test_paths_see_and_are_lit_by_the_texels() -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    found = gi.truth.radiance(square(), CAMERA, [], paths=4, bounces=0).mean
    np.testing.assert_allclose(found, expected(("repeat", "repeat"), LINEAR) * GLOW, atol=0.02)
    # A wall close before the square, seen from between: half of the texture glows, half is black.
    halves = np.zeros((2, 2, 4), np.uint8)
    halves[:, 1] = 255
    glowing = Material(albedo=(0, 0, 0), emission=(1, 1, 1), emission_texture=0)
    corners = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0), (-9, -9, 1), (-9, 9, 1), (9, 9, 1), (9, -9, 1)]
    scene = meshes.scene_of(
        corners,
        [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)],
        normals=[(0, 0, 1)] * 4 + [(0, 0, -1)] * 4,
        uvs=[(0, 0), (1, 0), (1, 1), (0, 1)] * 2,
        material_ids=[0, 0, 1, 1],
        materials=(glowing, Material(albedo=(0.5, 0.5, 0.5))),
        textures=(halves,),
        wraps=(("clamp", "clamp"),),
    )
    camera = Camera.look_at((0, 0, 0.5), (0, 0, 1), width=16, height=16, yfov=0.02)
    lit = gi.truth.radiance(scene, camera, [], paths=512, bounces=0).mean.mean()
    # In the middle half of what is seen glows: 0.5 * 0.5, but for the far rim.
    assert lit == pytest.approx(0.25, rel=0.05)


def loaded(folder: Path, **material: Any) -> Scene:
    """Load a triangle with two sets of texture coordinates, of a file with two images."""
    made = Gltf()
    made.json["materials"] = [material]
    uvs = made.accessor(np.zeros((3, 2)), "f4")
    made.triangle(material=0, TEXCOORD_0=uvs, TEXCOORD_1=uvs)
    made.json["images"] = [{"bufferView": made.view(png(texels))} for texels in (TEXELS, TEXELS[::-1])]
    made.json["textures"] = [{"source": 0}, {"source": 1}]
    return made.load(folder)


def test_emission_of_gltf(tmp_path: Path) -> None:
    factor = {"emissiveFactor": [1.0, 0.5, 0.25]}
    scene = loaded(tmp_path, **factor, emissiveTexture={"index": 0})
    (material,) = scene.materials
    assert material.emission == (1.0, 0.5, 0.25)
    np.testing.assert_array_equal(scene.textures[material.emission_texture], TEXELS)
    assert not scene.notes
    base = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    (material,) = loaded(tmp_path, **factor, **base, emissiveTexture={"index": 0}).materials
    assert (material.texture, material.emission_texture) == (0, 1)
    scene = loaded(tmp_path, **factor, **base, emissiveTexture={"index": 0, "texCoord": 1})
    (material,) = scene.materials
    assert material.emission_texture == -1
    np.testing.assert_allclose(material.emission, LINEAR.mean(axis=(0, 1)) * (1.0, 0.5, 0.25))
    assert any("laid otherwise than its base colour" in note for note in scene.notes)


@pytest.mark.parametrize(("numbers", "emission"), [("", (1.0, 1.0, 1.0)), ("Ke 2 3 4\n", GLOW)])
def test_emission_of_mtl(tmp_path: Path, numbers: str, emission: tuple[float, ...]) -> None:
    written(tmp_path, "t.png", png(TEXELS))
    written(tmp_path, "t.mtl", f"newmtl a\nKd .5 .5 .5\n{numbers}map_Ke t.png\n")
    path = written(
        tmp_path, "t.obj", "mtllib t.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    scene = load_scene(path)
    (material,) = scene.used_materials
    assert material.emission == emission
    np.testing.assert_array_equal(scene.textures[material.emission_texture], TEXELS)
