"""Loading scenes from OBJ, PLY and trimesh: details that trimesh misreads, damage, exact values."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.rasterize.files.from_trimesh import _Reader
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.files.textures import TextureSet

from .loading import POSITION, ROUNDED, corners, written

SHARED = Path(__file__).parents[3] / "shared" / "scenes"

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def shared(name: str) -> Path:
    """Return a file of the shared scenes, or skip the test."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"needs the scene files in {SHARED}")
    return path


def obj_with(folder: Path, mtl: str, **images: Image.Image) -> Scene:
    """Load one triangle of material `m`, defined by `mtl`, with textures beside it."""
    for name, image in images.items():
        image.save(folder / f"{name}.png")
    written(folder, "m.mtl", f"newmtl m\n{mtl}\n")
    text = f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n{FACE}"
    return load_scene(written(folder, "a.obj", text))


FACE = "f 1/1 2/2 3/3\n"


# --- OBJ and MTL -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "lefts"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n", [0, 5]),
        ("v\t0 0 0\nv\t1\t0\t0\nv 0 1\t0\nf\t1 2\t3\n", [0]),
        ("v 0 0 0\r\nv 1 0 \\\r\n0\r\nv 0 1 0\r\nf 1 2 \\\r\n3\r\n", [0]),
        (TRIANGLE + "v nan inf 0\n", [0]),
        (TRIANGLE + "f 1 1 2\nf 1 2 2\n", [0]),
    ],
    ids=["relative indices", "tabs", "continued lines", "an unused vertex", "triangles without area"],
)
def test_triangles_are_those_of_the_file(tmp_path: Path, text: str, lefts: list[int]) -> None:
    scene = load_scene(written(tmp_path, "a.obj", text))
    np.testing.assert_allclose(corners(scene), [[[x, 0, 0], [x + 1, 0, 0], [x, 1, 0]] for x in lefts], **POSITION)
    assert len(scene.positions) == 3 * len(lefts)


def test_corners_of_a_box_keep_the_normals_of_their_faces(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    path = written(tmp_path, "a.obj", trimesh.exchange.obj.export_obj(box, include_normals=False))
    scene = load_scene(path)
    assert len(scene.positions) == 24
    # Each normal is one of the axes, to float32 rounding.
    np.testing.assert_allclose(np.abs(scene.normals).max(axis=1), 1.0, **ROUNDED)


def test_emission_and_colour_of_a_material_keep_all_their_bits(tmp_path: Path) -> None:
    scene = obj_with(tmp_path, "\tKd 0.065 0.0017 0.3333\n Ke\t17 12 4\nKs .1 .2 .3\nNs 96.5")
    material = scene.materials[0]
    assert material.albedo == (0.065, 0.0017, 0.3333)
    assert material.emission == (17.0, 12.0, 4.0)
    assert material.specular == (0.1, 0.2, 0.3)
    assert material.gloss == 96.5


def test_texture_of_a_material_keeps_its_rows_and_coordinates(tmp_path: Path) -> None:
    pixels = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    scene = obj_with(tmp_path, "map_Kd -clamp on t.png", t=Image.fromarray(pixels))
    np.testing.assert_array_equal(scene.textures[0][..., :3], pixels)
    assert scene.materials[0].texture == 0
    assert scene.materials[0].albedo == (1.0, 1.0, 1.0)
    np.testing.assert_array_equal(scene.uvs[scene.triangles[0]], [[0, 0], [1, 0], [0, 1]])


def test_map_options_scale_and_shift_coordinates(tmp_path: Path) -> None:
    image = Image.new("RGB", (2, 2))
    scene = obj_with(tmp_path, "map_Kd -s 2 3 1 -o 0.5 0.25 t.png", t=image)
    wanted = [[0.5, 0.25], [2.5, 0.25], [0.5, 3.25]]
    np.testing.assert_array_equal(scene.uvs[scene.triangles[0]], wanted)


def test_equal_textures_are_kept_once(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (9, 9, 9)).save(tmp_path / "t.png")
    written(tmp_path, "m.mtl", "newmtl a\nmap_Kd t.png\nnewmtl b\nmap_Kd t.png\nKd .5 .5 .5\n")
    text = f"mtllib m.mtl\nusemtl a\n{TRIANGLE}usemtl b\nf 3 2 1\n"
    scene = load_scene(written(tmp_path, "a.obj", text))
    assert len(scene.textures) == 1
    assert [m.texture for m in scene.materials] == [0, 0]


def test_opacity_makes_a_material_cut_out(tmp_path: Path) -> None:
    mask = Image.fromarray(np.array([[0, 255], [255, 0]], dtype=np.uint8))
    scene = obj_with(tmp_path, "map_Kd t.png\nmap_d d.png", t=Image.new("RGB", (2, 2)), d=mask)
    np.testing.assert_array_equal(scene.textures[0][..., 3], [[0, 255], [255, 0]])
    assert scene.materials[0].alpha_cutoff == 0.5
    glass = obj_with(tmp_path, "Tr 0.75").materials[0]
    assert (glass.alpha, glass.alpha_cutoff, glass.blends) == (0.25, 0.5, True)
    assert not scene.is_seen_through, "a mask alone cuts out"


def test_concave_polygon_is_cut_without_folds(tmp_path: Path) -> None:
    outline = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)]
    text = "".join(f"v {x} {y} 0\n" for x, y in outline) + "f 1 2 3 4 5\n"
    found = corners(load_scene(written(tmp_path, "a.obj", text)))
    areas = 0.5 * np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])[:, 2]
    assert (areas > 0).all()
    # The shoelace formula gives 10; float32 corners cost 1e-6.
    np.testing.assert_allclose(areas.sum(), 10.0, rtol=0, atol=1e-5)


def test_faces_may_leave_out_texture_coordinates_and_normals(tmp_path: Path) -> None:
    text = TRIANGLE + "vn 0 0 2\nvt .5 .25\nf 1//1 2//1 3//1\nf 1/1/1 2/1/1 3/1/1\nf 1/1 2/1 3/1\n"
    scene = load_scene(written(tmp_path, "a.obj", text))
    assert len(scene.triangles) == 4
    np.testing.assert_array_equal(scene.normals, np.tile([0, 0, 1], (len(scene.normals), 1)))
    np.testing.assert_array_equal(scene.uvs[scene.triangles[2]], np.tile([0.5, 0.25], (3, 1)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0\nf 1 1 1\n", "at least 3 numbers"),
        ("v 0 0 x\nf 1 1 1\n", "not a number"),
        (TRIANGLE + "f 1 2 9\n", "refers to v 9, but there are 3"),
        (TRIANGLE + "f 0 1 2\n", "refers to v 0"),
        (TRIANGLE + "f -4 1 2\n", "refers to v -4"),
        (TRIANGLE + "f 1/1 2/1 3/1\n", "refers to vt 1"),
        (TRIANGLE + "f a b c\n", "whole numbers"),
        (TRIANGLE + "f 1/1/1/1 2 3\n", "whole numbers"),
        ("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", r"vertex 1 is at \[nan"),
        ("v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", r"vertex 2 is at"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangle"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle"),
        ("", "no triangle"),
    ],
)
def test_bad_obj_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene(written(tmp_path, "a.obj", text))


def test_scene_far_from_the_origin_keeps_its_shape(tmp_path: Path) -> None:
    text = "v 1e7 0 0\nv 10000000.001 0 0\nv 1e7 0.001 0\nf 1 2 3\n"
    scene = load_scene(written(tmp_path, "a.obj", text))
    edge = scene.positions[1] - scene.positions[0]
    # float64 spacing at 1e7 is 2e-9, which is what the millimetre may be off.
    np.testing.assert_allclose(edge, [0.001, 0, 0], rtol=0, atol=4e-9)


# --- normals ---------------------------------------------------------------------------------


def test_crease_angle_decides_between_smooth_and_sharp(tmp_path: Path) -> None:
    # Two squares that meet at 30 degrees along the z axis.
    x, y = math.cos(math.radians(30)), math.sin(math.radians(30))
    text = f"v -1 0 0\nv -1 0 1\nv 0 0 1\nv 0 0 0\nv {x} {y} 1\nv {x} {y} 0\nf 1 2 3 4\nf 4 3 5 6\n"
    path = written(tmp_path, "a.obj", text)
    smooth, sharp = load_scene(path), load_scene(path, crease_angle=math.radians(29))
    assert len(smooth.positions) == 6
    assert len(sharp.positions) == 8
    middle = smooth.normals[np.argmin(np.abs(smooth.positions[:, 0] + smooth.origin[0]))]
    wanted = [-math.sin(math.radians(15)), math.cos(math.radians(15)), 0]
    np.testing.assert_allclose(middle, wanted, **ROUNDED)


def test_sphere_is_smooth_across_seams_of_indices() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=3)
    loose = trimesh.Trimesh(
        sphere.triangles.reshape(-1, 3), np.arange(len(sphere.faces) * 3).reshape(-1, 3),
        process=False,
    )  # fmt: skip
    scene = load_scene(loose)
    outward = scene.positions + scene.origin
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    # Edges span 0.15 rad: flat faces would be 0.09 off, weighted means are off by less than
    # the second order, 0.15 * 0.15 / 2.
    np.testing.assert_allclose(scene.normals, outward, rtol=0, atol=0.011)


def test_pole_with_very_many_triangles_is_smooth() -> None:
    cone = trimesh.creation.cone(radius=1.0, height=0.1, sections=5000)
    scene = load_scene(cone)
    tip = scene.normals[np.argmax(scene.positions[:, 2])]
    np.testing.assert_allclose(tip, [0, 0, 1], **ROUNDED)


# --- PLY -------------------------------------------------------------------------------------


COLORS = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


def ply(properties: str, vertices: list[str], faces: list[str], face_properties: str = "") -> str:
    return (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\n{properties}element face {len(faces)}\n"
        f"property list uchar int vertex_indices\n{face_properties}end_header\n"
        + "".join(f"{line}\n" for line in (*vertices, *faces))
    )


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.obj", "v 0 0 0 0.5 1 0\nv 1 0 0 0.5 1 0\nv 0 1 0 0.5 1 0\nf 1 2 3\n", 0.21404114),
        ("a.ply", ply(COLORS, ["0 0 0 188 255 0", "1 0 0 188 255 0", "0 1 0 188 255 0"], ["3 0 1 2"]), 0.50288653),
    ],
)
def test_colours_of_vertices_are_decoded_from_srgb(tmp_path: Path, name: str, text: str, expected: float) -> None:
    scene = load_scene(written(tmp_path, name, text))
    # By the formula of sRGB: 0.5 gives 0.2140, 188 of 255 gives 0.5029.
    np.testing.assert_allclose(scene.colors[0], [expected, 1, 0], **ROUNDED)


def test_colours_of_ply_faces_stay_apart(tmp_path: Path) -> None:
    vertices = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    faces = ["3 0 1 2 255 0 0", "3 0 2 3 0 0 255"]
    scene = load_scene(written(tmp_path, "a.ply", ply("", vertices, faces, COLORS)))
    np.testing.assert_array_equal(scene.colors[scene.triangles], [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3])
    assert scene.materials[0].albedo == (1.0, 1.0, 1.0)


def test_ply_keeps_its_normals(tmp_path: Path) -> None:
    more = "property float nx\nproperty float ny\nproperty float nz\n"
    vertices = ["0 0 0 0 1 1", "1 0 0 0 1 1", "0 1 0 0 1 1"]
    scene = load_scene(written(tmp_path, "a.ply", ply(more, vertices, ["3 0 1 2"])))
    np.testing.assert_allclose(scene.normals[0], [0, *2 * [math.sqrt(0.5)]], **ROUNDED)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_that_trimesh_writes_comes_back(tmp_path: Path, encoding: str) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=2)
    data = trimesh.exchange.ply.export_ply(sphere, encoding=encoding)
    scene = load_scene(written(tmp_path, "a.ply", data))
    # The text form rounds to 8 decimals, the binary one to float32.
    np.testing.assert_allclose(corners(scene), sphere.triangles, rtol=0, atol=1e-6)


def test_ply_quadrilaterals_are_cut(tmp_path: Path) -> None:
    vertices = ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "2 0 0"]
    path = written(tmp_path, "a.ply", ply("", vertices, ["4 0 1 2 3", "3 1 4 2"]))
    assert len(load_scene(path).triangles) == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ply("", ["0 0 0", "1 0 0", "0 1 0"], ["4 0 1 2 3"]), "refers to vertex 3, but there are 3"),
        (ply("", ["0 0 0"] * 3, ["3 0 1 2"]).replace("face 1", "face 9999999999"), "cut off"),
        (ply("", ["0 0 0", "1 0 0", "0 1 0"], []), "no triangle|can't be read"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n", "no header"),
        ("hello", "no header"),
    ],
)
def test_bad_ply_is_refused_with_the_reason(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene(written(tmp_path, "a.ply", text))


# --- any file --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [("nothing.obj", None, r"nothing\.obj"), ("a.fbx", "x", r"\.glb, \.gltf, \.obj, \.ply")],
)
def test_what_is_missing_or_unknown_is_named(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    path = tmp_path / name if text is None else written(tmp_path, name, text)
    with pytest.raises(SceneError, match=message):
        load_scene(path)


def test_crease_angle_out_of_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="crease_angle is 40"):
        load_scene(written(tmp_path, "a.obj", TRIANGLE), crease_angle=40.0)


# --- trimesh objects -------------------------------------------------------------------------


def test_trimesh_scene_is_loaded_instance_by_instance() -> None:
    source = trimesh.Scene()
    box = trimesh.creation.box()
    source.add_geometry(box, geom_name="box", node_name="a")
    for name, x in (("b", 3.0), ("c", 6.0)):
        matrix = trimesh.transformations.translation_matrix([x, 0, 0])
        source.graph.update(frame_to=name, matrix=matrix, geometry="box")
    scene = load_scene(source)
    assert len(scene.triangles) == 36
    np.testing.assert_allclose(scene.bounds, [[-0.5, -0.5, -0.5], [6.5, 0.5, 0.5]], **POSITION)


def test_face_colours_of_trimesh_stay_apart() -> None:
    box = trimesh.creation.box()
    box.visual.face_colors = [[255, 0, 0, 255]] * 6 + [[0, 0, 255, 255]] * 6
    scene = load_scene(box)
    found = scene.colors[scene.triangles]
    np.testing.assert_array_equal(found[:6], np.tile([1, 0, 0], (6, 3, 1)))
    np.testing.assert_array_equal(found[6:], np.tile([0, 0, 1], (6, 3, 1)))


def test_normals_that_came_with_a_trimesh_are_kept() -> None:
    box = trimesh.creation.box()
    given = np.tile([0.0, 0.0, 1.0], (len(box.vertices), 1))
    mesh = trimesh.Trimesh(box.vertices, box.faces, vertex_normals=given, process=False)
    np.testing.assert_allclose(load_scene(mesh).normals, np.tile([0, 0, 1], (8, 1)), **ROUNDED)


def test_normals_that_trimesh_computed_are_not_taken_for_given() -> None:
    box = trimesh.creation.box()
    assert box.vertex_normals is not None
    assert len(load_scene(box).positions) == 24


def test_materials_that_are_made_on_the_way_stay_apart() -> None:
    reader = _Reader(TextureSet())
    # Where one is freed, the next one may have its id.
    assert [reader._add(object(), Material(name=str(i))) for i in range(9)] == list(range(9))


def test_trimesh_of_a_file_with_emission_keeps_it(tmp_path: Path) -> None:
    written(tmp_path, "m.mtl", "newmtl m\nKd 0.065 0.1 0.2\nKe 17 12 4\n")
    path = written(tmp_path, "a.obj", "mtllib m.mtl\nusemtl m\n" + TRIANGLE)
    material = load_scene(trimesh.load_scene(path, process=False)).materials[0]
    assert material.emission == (17.0, 12.0, 4.0)
    assert material.albedo == (0.065, 0.1, 0.2)


def test_trimesh_without_triangles_is_refused() -> None:
    with pytest.raises(SceneError, match="no mesh"):
        load_scene(trimesh.Scene())


# --- the shared scenes -----------------------------------------------------------------------


def test_cornell_box_is_the_same_with_relative_and_absolute_indices() -> None:
    absolute = load_scene(shared("cornell_box/CornellBox-Original.obj"))
    relative = load_scene(shared("cornell_box/CornellBox-Original.relative.obj"))
    assert len(absolute.triangles) == 36
    np.testing.assert_array_equal(corners(absolute), corners(relative))
    np.testing.assert_array_equal(absolute.material_ids, relative.material_ids)
    punctual_light = next(m for m in absolute.materials if m.name == "light")
    assert punctual_light.emission == (17.0, 12.0, 4.0)


def test_spot_keeps_its_texture() -> None:
    scene = load_scene(shared("spot/spot_triangulated.obj"))
    assert len(scene.triangles) == 5856
    assert scene.textures[0].shape == (1024, 1024, 4)
    assert scene.uvs.std() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "triangles", "materials", "textures"),
    [
        # Less the 62, 1 and 5 triangles of the files whose area is exactly zero.
        ("veach_ajar/veach-ajar.glb", 4546 - 62, 10, 4),
        ("sponza/sponza.glb", 262_267 - 1, 25, 24),
        ("country_kitchen/kitchen.glb", 613_214 - 5, 83, 11),
        ("japanese_garden/japanese_garden.glb", 21_883, 13, 0),
        ("bunny/stanford-bunny.obj", 69_451, 1, 0),
        ("teapot/teapot.obj", 6320, 1, 0),
    ],
)
def test_shared_scene_is_complete(name: str, triangles: int, materials: int, textures: int) -> None:
    scene = load_scene(shared(name))
    assert len(scene.triangles) == triangles
    assert len(scene.materials) == materials
    assert len(scene.textures) == textures
    # Unit length to float32 rounding.
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1.0, rtol=0, atol=1e-6)


def test_sponza_has_cut_out_materials_and_repeats_its_textures() -> None:
    scene = load_scene(shared("sponza/sponza.glb"))
    assert any(m.alpha_cutoff == 0.5 for m in scene.materials)
    assert scene.uvs.max() > 1.0
