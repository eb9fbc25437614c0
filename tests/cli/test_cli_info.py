"""The command `ssgi info`: numbers of a file, and what `ssgi render` would use."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import CONTACT, cell_size
from ssgi_cl.frame.render import default_ao_radius
from ssgi_cl.io import exr
from ssgi_cl.rasterize.raster.default_camera import default_camera, default_lights
from ssgi_cl.rasterize.scenes import make_scene

from .commands import answer, fails, succeeds

LIGHTS = "KHR_lights_punctual"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A triangle with a material, two cameras, a spot light and a blended material's note."""
    data = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], np.float32).tobytes()
    spot = {"type": "spot", "intensity": 1366, "spot": {"innerConeAngle": 0.4999, "outerConeAngle": 0.5}}
    colour = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1]}}
    document = {
        "asset": {"version": "2.0"},
        "nodes": [
            {"mesh": 0},
            {"camera": 0, "name": "Front", "translation": [0, 1, 5]},
            {"camera": 1, "name": "Plan", "translation": [0, 0, 9]},
            {"extensions": {LIGHTS: {"light": 0}}, "translation": [0, 4, 0]},
        ],
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1, "aspectRatio": 1.5}},
            {"type": "orthographic", "orthographic": {"xmag": 2, "ymag": 1, "znear": 0, "zfar": 10}},
        ],
        "extensions": {LIGHTS: {"lights": [spot]}},
        "materials": [{"name": "pane", "alphaMode": "BLEND", "emissiveFactor": [0, 0.5, 0], **colour}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"type": "VEC3", "componentType": 5126, "count": 3, "bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    path = tmp_path / "pane.gltf"
    path.write_text(json.dumps(document))
    return path


def test_a_file_is_told_with_all_that_it_brings(file: Path) -> None:
    facts = answer("info", file)
    assert facts["bounds"] == [[0, 0, 0], [2, 3, 0]]
    assert (facts["triangles"], facts["vertices"], facts["textures"]) == (1, 3, [])
    (material,) = facts["materials"]
    assert (material["name"], material["triangles"]) == ("pane", 1)
    assert (material["albedo"], material["emission"]) == ([0.5, 0.25, 1], [0, 0.5, 0])
    assert facts["notes"] == [
        "material 'pane': G-buffers and shadows have blended surfaces where their opacity is 0.5 or more"
    ]
    front, plan = facts["cameras"]["Front"], facts["cameras"]["Plan"]
    assert front["eye"] == [0, 1, 5]
    assert front["fov"] == pytest.approx(np.degrees(0.5))
    assert (front["aspect"], front["far"]) == (1.5, None)
    assert (plan["kind"], plan["view_height"], plan["aspect"]) == ("orthographic", 2, 2)
    (light,) = facts["lights"]
    assert (light["kind"], light["position"]) == ("SpotLight", [0, 4, 0])
    assert light["intensity"] == pytest.approx([2, 2, 2])
    # Between the soft edge's angles, 0.4999 and 0.5 radians.
    assert light["cone_angle"] == pytest.approx(np.degrees(0.5), rel=1e-3)
    assert facts["used_lights"] == facts["lights"]
    assert facts["camera"]["eye"] == [0, 1, 5]


def test_options_of_render_change_what_it_is_drawn_with(file: Path, tmp_path: Path) -> None:
    facts = answer("info", file, "--camera", "Plan", "--environment", "1,2,3")
    assert facts["camera"]["view_height"] == pytest.approx(3.0)  # 4 wide at 800 x 600
    assert [light["kind"] for light in facts["used_lights"]] == ["SpotLight", "Environment"]
    assert facts["used_lights"][1]["radiance"] == [1, 2, 3]
    image = np.zeros((2, 4, 3), np.float32)
    image[0] = 3.0  # the upper half of the sphere
    exr.write(tmp_path / "sky.exr", {"image": image})
    sky = answer("info", file, "--environment", tmp_path / "sky.exr")["used_lights"][1]
    assert (sky["image"], sky["radiance"]) == ([4, 2], pytest.approx([1.5] * 3))


def test_without_a_view_it_tells_the_default_one(tmp_path: Path, runtime: Runtime) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    facts = answer("info", path, "--width", "80", "--height", "60")
    scene = gi.rasterize.load_scene(path)
    camera = default_camera(scene, 80, 60, np.radians(50.0), runtime)
    np.testing.assert_allclose(facts["camera"]["eye"], camera.position, atol=1e-12)
    assert facts["camera"]["fov"] == pytest.approx(50.0)
    assert facts["direct_ao_radius"] == pytest.approx(default_ao_radius(scene, camera, runtime))
    assert facts["ao_radius"] == pytest.approx(CONTACT * cell_size(scene))
    kinds = [type(light).__name__ for light in default_lights(scene, camera, runtime)]
    assert [light["kind"] for light in facts["used_lights"]] == kinds
    assert (facts["cameras"], facts["lights"], facts["notes"]) == ({}, [], [])


def test_a_built_in_scene_has_its_own_radius() -> None:
    facts = answer("info", "hall")
    assert facts["direct_ao_radius"] == make_scene("hall").ao_radius
    assert facts["triangles"] == len(make_scene("hall").scene.triangles)


def test_text_names_everything(file: Path) -> None:
    text = succeeds("info", file).stdout
    for part in (
        "bounds     0 0 0 to 2 3 0",
        "triangles  1 of 3 vertices",
        "pane: 1 triangles",
        "camera     'Front': eye 0 1 5, forward 0 0 -1, fov 28.65, perspective",
        "light      SpotLight: position 0 4 0, direction 0 0 -1",
        "note       material",
        "AO radius",
    ):
        assert part in text, text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.glb"], "there is no such file"),
        (["cornell_box", "--width", "0"], "width is 0"),
        (["cornell_box", "--fov", "200"], "--fov is 200"),
    ],
)
def test_faults_are_one_line(tmp_path: Path, arguments: list[str], message: str) -> None:
    assert message in fails(tmp_path, "info", *arguments)


def test_corners_of_a_scene_in_the_metres_of_a_map_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "map.obj"
    path.write_text("v 500000.5 120 5000000\nv 500080 120 5000000\nv 500000.5 150 5000010\nf 1 2 3\n")
    (bounds,) = (line for line in succeeds("info", path).stdout.splitlines() if line.startswith("bounds"))
    numbers = bounds.removeprefix("bounds").replace("to", "").split()
    low, high = np.array([500000.5, 120, 5000000]), np.array([500080, 150, 5000010])
    # A ten-thousandth of the extent, 85: more than is lost to float32 about the scene's origin.
    np.testing.assert_allclose([float(number) for number in numbers], [*low, *high], rtol=0, atol=8.5e-3)
