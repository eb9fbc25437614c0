"""Lights and cameras of glTF files, and notes on what is not drawn."""

from __future__ import annotations

import base64
import json
import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.io import exr
from ssgi_cl.truth.digests import scene_digest

from .loading import Gltf

LIGHTS = "KHR_lights_punctual"
EXACT = {"rtol": 1e-12, "atol": 1e-12}  # float64 roundings
TURN_Y = [0.0, math.sin(math.pi / 4), 0.0, math.cos(math.pi / 4)]  # +z to +x


def document(**more: Any) -> dict[str, Any]:
    """Return a document of one triangle, with more nodes behind its own."""
    made = Gltf()
    made.triangle()
    del made.json["scene"], made.json["scenes"]
    made.json["nodes"] += more.pop("nodes", [])
    data = base64.b64encode(made.binary).decode()
    return made.json | {"buffers": [{"byteLength": 36, "uri": f"data:;base64,{data}"}], **more}


def saved(folder: Path, made: dict[str, Any]) -> Path:
    path = folder / "a.gltf"
    path.write_text(json.dumps(made))
    return path


def loaded(folder: Path, **more: Any) -> Scene:
    return gi.rasterize.load_scene(saved(folder, document(**more)))


def lit(folder: Path, light: dict[str, Any], **node: Any) -> Scene:
    """A scene with one light, on a node of its own."""
    nodes = [{"extensions": {LIGHTS: {"light": 0}}, **node}]
    return loaded(folder, nodes=nodes, extensions={LIGHTS: {"lights": [light]}}, extensionsUsed=[LIGHTS])


def seen(folder: Path, camera: dict[str, Any], **node: Any) -> Scene:
    return loaded(folder, nodes=[{"camera": 0, **node}], cameras=[camera])


PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}
ORTHOGRAPHIC = {"type": "orthographic", "orthographic": {"xmag": 4.0, "ymag": 2.0, "znear": 0.0, "zfar": 50.0}}


def test_a_point_light_is_where_its_node_is_in_watts(tmp_path: Path) -> None:
    light = {"type": "point", "color": [1.0, 0.5, 0.25], "intensity": 1366.0}
    (found,) = lit(tmp_path, light, translation=[1, 2, 3], scale=[5, 5, 5]).lights
    assert isinstance(found, gi.PointLight)
    np.testing.assert_allclose(found.position, [1, 2, 3], **EXACT)
    np.testing.assert_allclose(found.intensity, [2.0, 1.0, 0.5], **EXACT)  # cd / 683


def test_a_directional_light_shines_along_its_nodes_minus_z(tmp_path: Path) -> None:
    light = {"type": "directional", "intensity": 683.0}
    (found,) = lit(tmp_path, light, rotation=TURN_Y, scale=[3, 3, 3]).lights
    assert isinstance(found, gi.DirectionalLight)
    np.testing.assert_allclose(found.direction, [-1, 0, 0], **EXACT)
    np.testing.assert_allclose(found.irradiance, [1, 1, 1], **EXACT)


def test_lights_are_placed_by_the_nodes_above_them(tmp_path: Path) -> None:
    nodes: list[dict[str, Any]] = [
        {"translation": [0, 0, 2], "rotation": TURN_Y, "children": [2]},
        {"extensions": {LIGHTS: {"light": 0}}, "translation": [0, 0, 1]},
    ]
    (found,) = loaded(tmp_path, nodes=nodes, extensions={LIGHTS: {"lights": [{"type": "point"}]}}).lights
    np.testing.assert_allclose(found.position, [1, 0, 2], **EXACT)
    np.testing.assert_allclose(found.intensity, 1.0 / 683.0, **EXACT)  # 1 cd by default


@pytest.mark.parametrize(("inner", "outer"), [(0.0, math.pi / 4), (0.3, 0.6), (0.0, math.pi / 2), (0.5, 0.5001)])
def test_a_spot_light_sends_the_flux_of_its_soft_cone(tmp_path: Path, inner: float, outer: float) -> None:
    light = {"type": "spot", "intensity": 683.0, "spot": {"innerConeAngle": inner, "outerConeAngle": outer}}
    (found,) = lit(tmp_path, light).lights
    assert isinstance(found, gi.SpotLight)
    np.testing.assert_allclose(found.direction, [0, 0, -1], **EXACT)
    np.testing.assert_allclose(found.intensity, 1.0, **EXACT)
    # The extension's falloff, integrated by the midpoint rule over the cosine to the axis.
    cosine = (np.arange(200_000) + 0.5) / 200_000
    share = (cosine - math.cos(outer)) / (math.cos(inner) - math.cos(outer))
    flux = 2.0 * math.pi * (np.clip(share, 0.0, 1.0) ** 2).mean()
    sharp = 2.0 * math.pi * (1.0 - math.cos(found.cone_angle))
    # The step of the rule is 5e-6 of the hemisphere.
    assert sharp == pytest.approx(flux, rel=1e-3)


def test_spot_angles_have_the_defaults_of_the_extension(tmp_path: Path) -> None:
    scene = lit(tmp_path, {"type": "spot", "name": "bulb"})
    expected = math.acos((2.0 + math.cos(math.pi / 4)) / 3.0)
    assert scene.lights[0].cone_angle == pytest.approx(expected)
    assert [note for note in scene.notes if "'bulb'" in note and "soft edge from 0.0" in note]


def test_the_range_of_a_light_is_said_to_be_unused(tmp_path: Path) -> None:
    scene = lit(tmp_path, {"type": "point", "range": 5.0}, name="bulb")
    assert len(scene.lights) == 1
    assert scene.notes == ("light 'bulb': its range is not used, light falls off with distance only",)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": [{"extensions": {LIGHTS: {"light": 7}}}]}, "the light of node 1 is 7"),
        ({"nodes": [{"extensions": {LIGHTS: {}}}]}, "has no 'light'"),
        ({"nodes": [{"extensions": {LIGHTS: 3}}]}, "expected an object"),
        ({"nodes": [{"camera": 3}]}, "the camera of node 1 is 3"),
        ({"cameras": [{"type": "perspective", "perspective": {"yfov": 1.0}}]}, "znear"),
        ({"extensions": {LIGHTS: {"lights": [{"type": "spot", "color": [1, 2]}]}}}, "3 numbers"),
    ],
)
def test_damaged_views_are_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(gi.SceneError, match=message):
        loaded(tmp_path, **change)


def test_emission_beyond_what_a_material_holds_is_refused_by_its_name(tmp_path: Path) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 1e31}}
    made = document(materials=[{"emissiveFactor": [1, 1, 0], "extensions": strong}])
    made["meshes"][0]["primitives"][0]["material"] = 0
    with pytest.raises(gi.SceneError, match=r"material 0 emits .*up to 1e\+30"):
        gi.rasterize.load_scene(saved(tmp_path, made))


def test_a_perspective_camera_looks_along_its_nodes_minus_z(tmp_path: Path) -> None:
    node = {"name": "Eye", "translation": [1, 2, 3], "rotation": TURN_Y, "scale": [2, 3, 4]}
    camera = seen(tmp_path, PERSPECTIVE, **node).cameras["Eye"].sized(80, 60)
    expected = Camera.look_at((1, 2, 3), (0, 2, 3), yfov=0.8, width=80, height=60, near=0.1)
    np.testing.assert_allclose(camera.view, expected.view, **EXACT)
    np.testing.assert_allclose(camera.projection, expected.projection, **EXACT)
    assert camera.far == math.inf


def test_a_far_plane_is_kept(tmp_path: Path) -> None:
    values = {"yfov": 0.8, "znear": 0.5, "zfar": 20.0}
    scene = seen(tmp_path, {"type": "perspective", "perspective": values})
    camera = scene.cameras["camera 1"].sized(8, 6)
    assert (camera.near, camera.far) == pytest.approx((0.5, 20.0))


def test_an_orthographic_camera_shows_its_box(tmp_path: Path) -> None:
    scene = seen(tmp_path, {**ORTHOGRAPHIC, "name": "Plan"}, translation=[0, 0, 9])
    camera = scene.cameras["Plan"].sized(80, 40)
    expected = Camera.orthographic((0, 0, 9), (0, 0, 0), view_height=4.0, width=80, height=40, far=50.0)
    np.testing.assert_allclose(camera.view, expected.view, **EXACT)
    np.testing.assert_allclose(camera.projection, expected.projection, **EXACT)


@pytest.mark.parametrize(
    "camera", [ORTHOGRAPHIC, {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "aspectRatio": 2.0}}]
)
@pytest.mark.parametrize("size", [(200, 100), (300, 100), (100, 100), (50, 100)])
def test_the_files_picture_is_always_within_the_picture(
    tmp_path: Path, camera: dict[str, Any], size: tuple[int, int]
) -> None:
    found = seen(tmp_path, camera).cameras["camera 1"]
    own, sized = (found.sized(*each).projection for each in ((200, 100), size))
    wide, tall = np.diag(sized)[:2] / np.diag(own)[:2]
    assert max(wide, tall) == pytest.approx(1.0)  # one side is the file's, the other no narrower
    assert sized[1, 1] / sized[0, 0] == pytest.approx(size[0] / size[1])  # square pixels


def test_a_mirrored_node_does_not_mirror_its_camera(tmp_path: Path) -> None:
    camera = seen(tmp_path, PERSPECTIVE, scale=[-1, 1, 1]).cameras["camera 1"]
    np.testing.assert_allclose(camera.view, np.eye(4), **EXACT)


def test_names_of_cameras_stay_apart(tmp_path: Path) -> None:
    nodes = [{"camera": 0, "name": "A"}, {"camera": 0, "name": "A"}, {"camera": 0}]
    scene = loaded(tmp_path, nodes=nodes, cameras=[{**PERSPECTIVE, "name": "B"}])
    assert list(scene.cameras) == ["A", "A (2)", "B"]


@pytest.mark.parametrize(
    ("what", "node", "message"),
    [
        ({"type": "area"}, {}, "type is 'area'"),
        ({"type": "point", "intensity": -1.0}, {}, "intensity"),
        ({"type": "point", "color": [1e200, 0, 0], "intensity": 1e200}, {}, "intensity"),
        ({"type": "spot", "spot": {"outerConeAngle": 2.0}}, {}, "cone angles are 0 and 2"),
        ({"type": "spot", "spot": {"innerConeAngle": 1.0}}, {}, "cone angles are 1 and"),
        ({"type": "directional"}, {"scale": [1, 1, 0]}, "no usable length"),
        ({"type": "point"}, {"translation": [1e200, 0, 0]}, "position"),
        ({"type": "directional"}, {"matrix": [1e200] * 16}, "no usable length"),
        ({"type": "fisheye"}, {}, "type is 'fisheye'"),
        ({"type": "perspective"}, {}, "type is 'perspective'"),
        ({"type": "perspective", "perspective": {"yfov": 0, "znear": 1}}, {}, "height is 0"),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 0}}, {}, "near is 0"),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 2, "zfar": 1}}, {}, "far is"),
        ({"type": "perspective", "perspective": {"yfov": 1, "znear": 1, "aspectRatio": 0}}, {}, "aspect is 0"),
        ({"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 0, "znear": 0, "zfar": 1}}, {}, "xmag and ymag"),
        (PERSPECTIVE, {"scale": [1, 0, 1]}, "no usable length"),
        (PERSPECTIVE, {"matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1]}, "parallel"),
        (PERSPECTIVE, {"translation": [1e200, 0, 0]}, "view"),
    ],
)
def test_a_light_or_camera_that_cannot_be_is_left_out_and_named(
    tmp_path: Path, what: dict[str, Any], node: dict[str, Any], message: str
) -> None:
    of_light = what["type"] in ("area", "point", "spot", "directional")
    scene = (lit if of_light else seen)(tmp_path, {**what, "name": "odd"}, **node)
    assert (scene.lights, scene.cameras) == ((), {})
    (note,) = scene.notes
    assert note.startswith(f"{'light' if of_light else 'camera'} 'odd' is left out: ")
    assert message in note


def test_views_do_not_change_what_truths_are_stored_under(tmp_path: Path) -> None:
    plain = loaded(tmp_path)
    assert (plain.lights, plain.cameras, plain.notes) == ((), {}, ())
    assert scene_digest(lit(tmp_path, {"type": "point"})) == scene_digest(plain)
    assert scene_digest(seen(tmp_path, PERSPECTIVE)) == scene_digest(plain)


def test_a_scene_with_views_can_be_pickled(tmp_path: Path) -> None:
    lights = lit(tmp_path, {"type": "point"}).lights
    copy = pickle.loads(pickle.dumps(replace(seen(tmp_path, PERSPECTIVE), lights=lights)))
    assert isinstance(copy.cameras["camera 1"], SceneCamera)
    assert not copy.cameras["camera 1"].view.flags.writeable
    assert not copy.lights[0].position.flags.writeable


def test_what_is_not_drawn_has_a_line_each(tmp_path: Path) -> None:
    glass = {
        "name": "glass",
        "alphaMode": "BLEND",
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}},
    }
    many = [{"name": f"m{index}", "extensions": {"KHR_materials_sheen": {}}} for index in range(6)]
    unused = {"name": "unused", "alphaMode": "BLEND"}
    made = document(
        materials=[glass, *many, unused],
        extensionsUsed=["KHR_materials_transmission", "KHR_materials_sheen", "ACME_fog", LIGHTS],
        animations=[{}],
        scenes=[{"nodes": [0]}, {"nodes": []}],
    )
    primitives = made["meshes"][0]["primitives"]
    primitives[0]["material"] = 0
    primitives += [{"attributes": {"POSITION": 0}, "material": 1 + index} for index in range(6)]
    primitives.append({"attributes": {"POSITION": 0}, "mode": 1})
    assert gi.rasterize.load_scene(saved(tmp_path, made)).notes == (
        "material 'glass': G-buffers and shadows have blended surfaces where their opacity is 0.5 or more",
        "material 'glass': light passes straight through it, neither bent nor scattered; G-buffers show it",
        "materials 'm0', 'm1', 'm2', 'm3' and 2 more: sheen is not drawn",
        "1 primitive(s) of points and lines are not drawn",
        "animations are not played: nodes stand as the file places them",
        "1 more scene(s) of the file are not drawn",
        "extension 'ACME_fog' is not known: what it adds is not drawn",
    )


def render(folder: Path, scene: Path, *options: str) -> Result:
    size = ["--width", "32", "--height", "24", "--shadow-size", "32", "--bounces", "0", "--ao", "none"]
    return CliRunner().invoke(main, ["render", str(scene), "-o", str(folder / "out.exr"), *size, *options])


def picture(folder: Path, scene: Path, *options: str) -> tuple[np.ndarray, Result]:
    done = render(folder, scene, *options)
    assert done.exit_code == 0, done.output
    return exr.read(folder / "out.exr")["R"], done


def test_the_command_uses_the_files_lights_and_cameras(tmp_path: Path) -> None:
    made = document(
        nodes=[
            {"camera": 0, "name": "far", "translation": [0.3, 0.3, 4]},
            {"camera": 0, "name": "near", "translation": [0.3, 0.3, 0.5]},
            {"extensions": {LIGHTS: {"light": 0}}, "translation": [0.3, 0.3, 1]},
        ],
        cameras=[PERSPECTIVE],
        extensions={LIGHTS: {"lights": [{"type": "point", "color": [1, 0, 0], "intensity": 683.0, "range": 1.0}]}},
    )
    path = saved(tmp_path, made)
    scene = gi.rasterize.load_scene(path)
    assert list(scene.cameras) == ["far", "near"], "they are in the file's order"
    (far, _), (near, done) = (picture(tmp_path, path, "--camera", name) for name in ("far", "near"))
    assert (near > 0.0).sum() > 4 * (far > 0.0).sum() > 0
    # 1 W/sr from 1 away: radiance albedo / pi (glTF's default albedo here is Material's 0.8).
    assert near.max() == pytest.approx(scene.materials[0].albedo[0] / math.pi, rel=0.02)
    assert "note: light 'light 3': its range is not used" in done.output
    first, done = picture(tmp_path, path, "--json")
    np.testing.assert_array_equal(first, far)
    assert json.loads(done.stdout)["notes"] == list(scene.notes)


def test_the_command_lists_the_cameras_there_are(tmp_path: Path) -> None:
    made = document(nodes=[{"camera": 0, "name": "far"}], cameras=[PERSPECTIVE])
    done = render(tmp_path, saved(tmp_path, made), "--camera", "nera")
    assert done.exit_code != 0
    assert "--camera is 'nera'" in done.output
    assert "it has 'far'" in " ".join(done.output.split())
