"""Opacities of vertices in glTF: holes, blended surfaces and their shadows."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.runtime import Runtime

from .loading import Gltf, png

CORNERS = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, -1, 0), (1, 1, 0), (-1, 1, 0)], "<f4")
CAMERA = Camera.orthographic((0, 0, 1), (0, 0, 0), view_height=2.0, width=40, height=40)


def square(alphas: list[float], *, components: int = 4, **material: Any) -> Gltf:
    """Make a square before a wall; its six corners, those of two triangles, have these opacities."""
    colors = np.ones((6, components))
    if components == 4:
        colors[:, 3] = alphas
    made = Gltf()
    made.json["materials"] = [material, {"pbrMetallicRoughness": {"metallicFactor": 0}}]
    made.json["images"] = [{"bufferView": made.view(png(np.full((2, 2, 4), 255)))}]
    made.json["textures"] = [{"source": 0}]
    attributes = {
        "POSITION": made.accessor(CORNERS, "f4"),
        "COLOR_0": made.accessor(colors, "f4"),
        "TEXCOORD_0": made.accessor((CORNERS[:, :2] + 1.0) / 2.0, "f4"),
    }
    wall = {"POSITION": made.accessor(3.0 * CORNERS - [0.0, 0.0, 1.0], "f4")}
    made.json["meshes"][0]["primitives"] = [
        {"attributes": attributes, "material": 0},
        {"attributes": wall, "material": 1},
    ]
    return made


def share_there(scene: Scene, runtime: Runtime) -> float:
    """Return the share of pixels that show the square and not the wall behind it."""
    depth = gi.rasterize.gbuffer(scene, CAMERA, runtime=runtime).depth
    return float((np.asarray(depth) < 1.5).mean())


@pytest.mark.parametrize(
    ("alphas", "mode", "share"),
    [
        ([0.3] * 6, "MASK", 0.0),
        ([0.7] * 6, "MASK", 1.0),
        ([0.3] * 6, "OPAQUE", 1.0),
        # From 0 at the left to 1 at the right.
        ([0, 1, 1, 0, 1, 0], "MASK", 0.5),
        # The second triangle alone.
        ([0, 0, 0, 1, 1, 1], "MASK", 0.5),
    ],
)
def test_holes_of_vertices(tmp_path: Path, runtime: Runtime, alphas: list[float], mode: str, share: float) -> None:
    scene = square(alphas, alphaMode=mode).load(tmp_path)
    assert share_there(scene, runtime) == pytest.approx(share, abs=0.03)  # a column of 40


def test_a_ramp_cuts_where_alpha_is_the_cutoff(tmp_path: Path, runtime: Runtime) -> None:
    scene = square([0, 1, 1, 0, 1, 0], alphaMode="MASK", alphaCutoff=0.8).load(tmp_path)
    depth = np.asarray(gi.rasterize.gbuffer(scene, CAMERA, runtime=runtime).depth)
    np.testing.assert_array_equal(depth[20] < 1.5, (np.arange(40) + 0.5) / 40 >= 0.8)


def test_beside_a_texture_triangles_have_their_means(tmp_path: Path, runtime: Runtime) -> None:
    textured = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "alphaMode": "MASK"}
    scene = square([0.2, 0.3, 0.4, 1, 1, 0.9], **textured).load(tmp_path)
    assert share_there(scene, runtime) == pytest.approx(0.5, abs=0.03)
    assert any("vertex alpha beside a texture" in note for note in scene.notes)
    scene = square([0.3] * 6, **textured).load(tmp_path)
    assert share_there(scene, runtime) == 0.0
    assert not any("vertex alpha" in note for note in scene.notes)


def test_blended_vertices_show_so_much_of_what_is_behind(tmp_path: Path, runtime: Runtime) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    black = {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}, "alphaMode": "BLEND"}
    light = DirectionalLight((0, 0, -1), 3.0)
    for alphas in ([0.25] * 6, [0.1, 0.3, 0.3, 0.1, 0.3, 0.1]):
        scene = square(alphas, **black).load(tmp_path)
        assert scene.is_seen_through
        frame = gi.render(scene, CAMERA, [light], bounces=0, ao=False, outputs=("radiance",), runtime=runtime)
        traced = gi.truth.radiance(scene, CAMERA, [light], paths=256, bounces=0).mean
        across = np.interp((np.arange(40) + 0.5) / 40, [0.0, 1.0], [alphas[0], alphas[1]])
        # Specular of dielectrics aside, a white wall of albedo 1 sends 3 / pi.
        lit = 3.0 / np.pi * scene.materials[scene.material_ids[-1]].albedo[0]
        np.testing.assert_allclose(frame.radiance[20, :, 0], lit * (1.0 - across), rtol=0.06)
        # Light passes the square on its way to the wall in paths alone: frames let it all pass below .5.
        np.testing.assert_allclose(traced[5:35].mean(axis=0)[:, 0], lit * (1.0 - across) ** 2, rtol=0.1)


def test_what_is_cut_out_reflects_no_light(tmp_path: Path) -> None:
    scene = square([0.3] * 6, alphaMode="MASK").load(tmp_path)
    assert len(scene.triangles) == 4
    assert len(scene_parts(scene).casting.triangles) == 2


def test_three_components_are_opaque(tmp_path: Path, runtime: Runtime) -> None:
    assert share_there(square([], components=3, alphaMode="MASK").load(tmp_path), runtime) == 1.0
