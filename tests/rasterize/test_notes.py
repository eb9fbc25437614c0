"""Notes on what of OBJ, MTL and PLY files and of scenes of trimesh is not drawn, and what is read of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.scene import lighting
from trimesh.visual.material import PBRMaterial, SimpleMaterial
from trimesh.visual.texture import TextureVisuals

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.files.metal_rough import metal_rough_lobe

from .loading import png, written

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl paint\nf 1/1 2/1 3/1\n"


def obj_scene(folder: Path, mtl: str = "", more: str = "", **options: Any) -> Scene:
    written(folder, "a.mtl", f"newmtl paint\n{mtl}\n")
    return load_scene(written(folder, "a.obj", f"mtllib a.mtl\n{TRIANGLE}{more}\n"), **options)


def test_a_plain_obj_has_no_notes(tmp_path: Path) -> None:
    plain = "Ka 1 1 1\nKd .5 .5 .5\nKs .1 .1 .1\nNs 50\nNi 1.45\nTf 1 1 1\nd 1\nillum 2\nPs 0\naniso 0"
    assert obj_scene(tmp_path, plain, "s off\ng a b\no c").notes == ()


@pytest.mark.parametrize(
    ("statements", "notes"),
    [
        ("p 1 2 3\np 1 # the last", ("4 points are not drawn",)),
        ("l 1 2\nl 2 3", ("2 lines are not drawn",)),
        ("l 1 2 3", ("1 line is not drawn",)),
        ("cstype bezier\ncurv 0 1 1 2 3\ncurv2 1 2\nsurf 0 1 0 1 1 2 3\nend",
         ("2 curves are not drawn", "1 curved surface is not drawn")),
    ],
)  # fmt: skip
def test_statements_of_an_obj_that_are_not_drawn_are_counted(
    tmp_path: Path, statements: str, notes: tuple[str, ...]
) -> None:
    assert obj_scene(tmp_path, "Kd 1 1 1", statements).notes == notes


@pytest.mark.parametrize(
    ("mtl", "note"),
    [
        ("map_Bump -bm 1 b.png", "bumps (map_Bump) are not drawn"),
        ("bump b.png\nnorm n.png", "bumps (bump, norm) are not drawn"),
        ("map_Ks b.png", "a texture of reflectance (map_Ks) is not used"),
        ("disp b.png", "displacement (disp) is not drawn"),
        ("Tf .5 .5 .5", "a filter of what shines through (Tf) is not used"),
        ("Tf 1 1 1\nillum 2", ""),
        ("illum 0", "it is lit, though illum 0 says that it is not"),
        ("illum 1\nKs .5 .5 .5", "its highlight (Ks) is drawn, though illum 1 says that it has none"),
        ("illum 1\nKs 0 0 0", ""),
        ("illum 7", "light is not bent by it as glass (illum 7) does"),
        ("illum 5", "mirror images (illum 5) are as sharp as Ns says"),
        ("Ps .5", "sheen (Ps) is not drawn"),
        ("Pc 1", "a clear coat (Pc) is not drawn"),
    ],
)
def test_what_of_a_material_is_not_drawn_is_noted(tmp_path: Path, mtl: str, note: str) -> None:
    assert obj_scene(tmp_path, mtl).notes == ((f"material 'paint': {note}",) if note else ())


def test_materials_that_nothing_uses_are_not_noted_and_one_line_names_all_that_are(tmp_path: Path) -> None:
    mtl = "Ps 1\nnewmtl wax\nPs 1\nnewmtl unused\nPs 1\nPc 1"
    scene = obj_scene(tmp_path, mtl, "usemtl wax\nf 1/1 3/1 2/1")
    assert scene.notes == ("materials 'paint', 'wax': sheen (Ps) is not drawn",)


def test_metal_and_roughness_of_a_material_library_are_those_of_gltf(tmp_path: Path) -> None:
    (material,) = obj_scene(tmp_path, "Kd .8 .4 .2\nKs 1 1 1\nNs 10\nPm .5\nPr .3").materials
    lobe = metal_rough_lobe(np.array([0.8, 0.4, 0.2]), 0.5, 0.3)
    assert (material.specular, material.gloss) == (lobe.specular, lobe.gloss)
    np.testing.assert_allclose(material.albedo, lobe.matt * np.array([0.8, 0.4, 0.2]), rtol=1e-12)
    # Without Pr roughness is that of Ns: the same exponent again.
    (material,) = obj_scene(tmp_path, "Kd .8 .4 .2\nNs 10\nPm 1").materials
    assert material.gloss == pytest.approx(10.0, rel=1e-12)
    assert material.specular == (0.8, 0.4, 0.2)


def test_textures_of_metal_and_roughness_count_with_their_mean(tmp_path: Path) -> None:
    written(tmp_path, "grey.png", png([[[102, 102, 102], [0, 0, 0]]]))  # .4 and 0
    mtl = "Kd 1 1 1\nKe 2 2 2\nmap_Ke grey.png\nmap_Pm grey.png\nPr .5\nmap_Pr grey.png"
    scene = obj_scene(tmp_path, mtl)
    (material,) = scene.materials
    lobe = metal_rough_lobe(np.ones(3), 0.2, 0.5 * 0.2)
    assert material.gloss == pytest.approx(lobe.gloss)
    assert material.specular == pytest.approx(lobe.specular)
    assert material.emission == (2.0, 2.0, 2.0)
    assert material.emission_texture >= 0
    assert [note.split("(")[1].split(")")[0] for note in scene.notes] == ["map_Pm", "map_Pr"]
    # Without textures the factors are all there is.
    assert obj_scene(tmp_path, mtl, textures=False).materials[0].emission == (2.0, 2.0, 2.0)


# ---- PLY


def ply(folder: Path, points: int, more: str = "", rows: str = "", faces: int = 1) -> Path:
    text = f"ply\nformat ascii 1.0\nelement vertex {points}\nproperty float x\nproperty float y\nproperty float z\n"
    text += f"element face {faces}\nproperty list uchar int vertex_indices\n{more}end_header\n"
    text += "".join(f"{i} {i * i} 0\n" for i in range(points)) + "3 0 1 2\n" * faces
    return written(folder, "a.ply", text + rows)


def test_points_edges_and_cameras_of_a_ply_are_noted(tmp_path: Path) -> None:
    assert load_scene(ply(tmp_path, 3)).notes == ()
    more = "element edge 2\nproperty int vertex1\nproperty int vertex2\nelement camera 1\nproperty float view_px\n"
    assert load_scene(ply(tmp_path, 5, more, "0 1\n1 2\n7\n")).notes == (
        "2 points of no face are not drawn",
        "2 elements 'edge' are not drawn",
        "1 element 'camera' is not drawn",
    )


def test_a_ply_of_points_alone_says_so(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="holds no triangle: it is a cloud of 4 points, which are not drawn"):
        load_scene(ply(tmp_path, 4, faces=0))


# ---- trimesh


def placed(x: float, turn: float = 0.0) -> np.ndarray:
    """Return the matrix of a node at x that is turned about y."""
    matrix = trimesh.transformations.rotation_matrix(turn, (0, 1, 0))
    matrix[0, 3] = x
    return np.asarray(matrix)


def box_scene() -> trimesh.Scene:
    return trimesh.Scene(trimesh.creation.box())


def test_lights_that_trimesh_makes_itself_are_none_of_the_scene() -> None:
    made = box_scene()
    assert (load_scene(made).lights, load_scene(made).cameras, load_scene(made).notes) == ((), {}, ())
    assert len(made.lights) == 2  # made when asked for
    assert load_scene(made).lights == ()
    made.lights[0].intensity = 683.0  # now somebody wants them
    assert len(load_scene(made).lights) == 2


def test_lights_and_the_camera_that_are_set_are_those_of_the_scene() -> None:
    made = box_scene()
    color = (255, 51, 0, 255)
    lights = [
        lighting.PointLight(name="bulb", color=color, intensity=1366.0, radius=9.0),
        lighting.DirectionalLight(name="sun", color=color, intensity=683.0),
        lighting.SpotLight(name="torch", color=color, intensity=683.0, innerConeAngle=0.5, outerConeAngle=0.5),
        lighting.PointLight(name="lost"),
    ]
    for x, light in enumerate(lights[:3]):
        made.graph[light.name] = placed(float(x), math.pi / 2)
    made.lights = lights
    made.camera = trimesh.scene.Camera(name="eye", resolution=(400, 300), fov=(60.0, 40.0), z_near=0.1, z_far=50.0)
    made.camera_transform = placed(5.0)
    scene = load_scene(made)
    bulb, sun, torch = scene.lights
    assert isinstance(bulb, PointLight)
    assert isinstance(sun, DirectionalLight)
    assert isinstance(torch, SpotLight)
    np.testing.assert_allclose(bulb.position, (0, 0, 0))
    np.testing.assert_allclose(bulb.intensity, (2.0, 0.4, 0.0))
    np.testing.assert_allclose(sun.irradiance, (1.0, 0.2, 0.0))
    np.testing.assert_allclose(sun.direction, (-1, 0, 0), atol=1e-12)  # -z, turned by 90 degrees about y
    np.testing.assert_allclose(torch.position, (2, 0, 0))
    assert torch.cone_angle == pytest.approx(0.5)
    eye = scene.cameras["eye"]
    assert eye.height == pytest.approx(math.radians(40.0))
    assert eye.aspect == pytest.approx(math.tan(math.radians(30.0)) / math.tan(math.radians(20.0)))
    assert (eye.near, eye.far) == (0.1, 50.0)
    np.testing.assert_allclose(eye.sized(4, 3).position, (5, 0, 0))
    assert scene.notes == (
        "light 'bulb': its range is not used, light falls off with distance only",
        "light 'lost' is left out: no node of the scene places it",
    )


def test_point_clouds_and_paths_of_trimesh_are_counted() -> None:
    made = box_scene()
    for _ in range(2):
        made.add_geometry(trimesh.PointCloud(np.eye(3)))
    made.add_geometry(trimesh.load_path([[[0, 0, 0], [1, 0, 0]]]))
    assert load_scene(made).notes == ("2 point clouds are not drawn", "1 path is not drawn")
    with pytest.raises(SceneError, match="places no mesh; 1 point cloud is not drawn"):
        load_scene(trimesh.Scene(trimesh.PointCloud(np.eye(3))))


def test_what_of_a_material_of_trimesh_is_not_drawn_is_noted() -> None:
    from PIL import Image

    image = Image.new("RGB", (1, 1))
    mesh = trimesh.creation.box()
    mesh.visual = TextureVisuals(uv=np.zeros((8, 2)), material=PBRMaterial(name="pbr", normalTexture=image))
    assert load_scene(mesh).notes == ("material 'pbr': bumps of a normal texture are not drawn",)
    words = SimpleMaterial(name="mtl", map_bump=["b.png"], illum=["2"], pr=[0.5])
    mesh.visual = TextureVisuals(uv=np.zeros((8, 2)), material=words)
    assert load_scene(mesh).notes == (
        "material 'mtl': bumps (map_Bump) are not drawn",
        "material 'mtl': pr of an .mtl file: not read from trimesh, only from a file by its path",
    )
