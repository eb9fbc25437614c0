"""Textures beyond their edges: repeated, held and mirrored, along each axis, in pictures and in references."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.lights import Environment
from ssgi_cl.core.scene import WRAPS, Material, Scene
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster import opengl
from ssgi_cl.techniques.radiosity.surfels import scene_surfels

from . import meshes
from .loading import Gltf, png

SIZE = 60
KINDS = list(itertools.product(WRAPS, WRAPS))
CAMERA = Camera.orthographic((0, 0, 1), (0, 0, 0), view_height=2.0, width=SIZE, height=SIZE)
TEXELS = np.random.default_rng(4).integers(0, 256, (5, 7, 4), dtype=np.uint8)
TEXELS[..., 3] = 255


def scene_of(wrap: tuple[str, str], texels: NDArray[np.uint8] = TEXELS, **material: float) -> Scene:
    """Make a square that shows a texture from -1.3 to 2.1 across and from -1.7 to 1.9 upwards."""
    uvs = [(-1.3, -1.7), (2.1, -1.7), (2.1, 1.9), (-1.3, 1.9)]
    white = Material(albedo=(1, 1, 1), texture=0, **material)  # type: ignore[arg-type]
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    return meshes.quad(corners, uvs=uvs, materials=(white,), textures=(texels,), wraps=(wrap,))


def index(number: NDArray[np.int64], count: int, kind: str) -> NDArray[np.int64]:
    """Return which texel stands at a place, by OpenGL's definitions (4.6, table 8.20)."""
    if kind == "clamp":
        return np.clip(number, 0, count - 1)
    if kind == "repeat":
        return number % count
    there = number % (2 * count)
    return np.where(there < count, there, 2 * count - 1 - there)


def expected(wrap: tuple[str, str], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what pixels show of values [rows, columns, ...], bilinear."""
    rows, columns = values.shape[:2]
    place = (np.arange(SIZE) + 0.5) / SIZE
    x = (-1.3 + 3.4 * place) * columns - 0.5
    y = (1.0 - (1.9 - 3.6 * place)) * rows - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - left)[None, :, None], (y - top)[:, None, None]

    def at(down: int, across: int) -> NDArray[np.float64]:
        found: NDArray[np.float64] = values[
            index(top + down, rows, wrap[1])[:, None], index(left + across, columns, wrap[0])[None]
        ]
        return found

    upper = at(0, 0) * (1 - fx) + at(0, 1) * fx
    lower = at(1, 0) * (1 - fx) + at(1, 1) * fx
    result: NDArray[np.float64] = upper * (1 - fy) + lower * fy
    return result


@pytest.mark.parametrize("wrap", KINDS, ids="-".join)
def test_pixels_show_what_opengl_defines(variant_runtime: Runtime, wrap: tuple[str, str]) -> None:
    right = expected(wrap, srgb_to_linear(TEXELS[..., :3] / 255.0))
    found = gi.rasterize.gbuffer(scene_of(wrap), CAMERA, runtime=variant_runtime).albedo
    # Coordinates are rounded to 1e-7; a texel is a seventh.
    np.testing.assert_allclose(found, right, atol=1e-4)


@pytest.mark.usefixtures("opengl_runs")
@pytest.mark.parametrize("wrap", KINDS, ids="-".join)
def test_the_opengl_backend_shows_the_same(wrap: tuple[str, str]) -> None:
    right = expected(wrap, srgb_to_linear(TEXELS[..., :3] / 255.0))
    found = opengl.gbuffer_arrays(scene_of(wrap), CAMERA)["albedo"][0]
    np.testing.assert_allclose(found, right, atol=1e-2)  # its filter has 8 bits of a texel's width


@pytest.mark.parametrize("wrap", KINDS, ids="-".join)
def test_holes_are_wrapped_alike(runtime: Runtime, wrap: tuple[str, str]) -> None:
    texels = TEXELS.copy()
    texels[..., 3] = np.random.default_rng(5).integers(0, 2, (5, 7)) * 255
    scene = scene_of(wrap, texels, alpha_cutoff=0.5)
    alpha = expected(wrap, texels[..., 3:] / 255.0)[..., 0]
    found = np.isfinite(gi.rasterize.gbuffer(scene, CAMERA, runtime=runtime).depth)
    sure = np.abs(alpha - 0.5) > 1e-3
    np.testing.assert_array_equal(found[sure], (alpha >= 0.5)[sure])
    solid = replace(scene, materials=(replace(scene.materials[0], alpha_cutoff=0.0),))
    share = scene_surfels(scene, 4096).area.sum() / scene_surfels(solid, 4096).area.sum()
    nearest = np.mean([alpha >= 0.5])
    assert share == pytest.approx(nearest, abs=0.12)  # the nearest texel in place of four


@pytest.mark.parametrize("wrap", [("clamp", "clamp"), ("mirror", "mirror"), ("mirror", "clamp"), ("repeat", "mirror")])
def test_paths_see_the_same_texture(wrap: tuple[str, str]) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    right = expected(wrap, srgb_to_linear(TEXELS[..., :3] / 255.0))
    found = gi.truth.radiance(scene_of(wrap), CAMERA, [Environment(1.0)], paths=4, bounces=0).mean
    # An open square under an even sky of 1 shows its albedo.
    off = np.abs(found - right).max(axis=-1)
    assert np.quantile(off, 0.8) < 0.01
    if len(set(wrap)) == 1:  # else a texel is held for half its width at seams
        assert off.max() < 0.01


def test_samplers_of_gltf(tmp_path: Path) -> None:
    made = Gltf()
    uvs = made.accessor(np.zeros((3, 2)), "f4")
    for index in range(4):
        material = made.material(rough={"baseColorTexture": {"index": index}})
        made.triangle(2.0 * index, material, TEXCOORD_0=uvs)
    made.json["images"] = [{"bufferView": made.view(png(TEXELS))}]
    made.json["samplers"] = samplers = [{"wrapS": 33071, "wrapT": 33648}, {"wrapS": 33071}, {}]
    made.json["textures"] = [{"source": 0, "sampler": index} for index in range(3)] + [{"source": 0}]
    scene = made.load(tmp_path)
    wraps = [scene.wraps[material.texture] for material in scene.materials]
    assert wraps == [("clamp", "mirror"), ("clamp", "repeat"), ("repeat", "repeat"), ("repeat", "repeat")]
    samplers[0]["wrapS"] = 9729
    with pytest.raises(SceneError, match="sampler 0 wraps by 9729: expected one of 10497, 33071, 33648"):
        made.load(tmp_path)


def test_wrong_wraps_are_refused() -> None:
    with pytest.raises(ValueError, match=r"wraps\[0\] is 'mirrored': expected .* did you mean 'mirror'"):
        scene_of(("mirrored", "clamp"))
    with pytest.raises(ValueError, match="wraps has 2 entries: expected 1"):
        replace(scene_of(("clamp", "clamp")), wraps=(("clamp", "clamp"),) * 2)
