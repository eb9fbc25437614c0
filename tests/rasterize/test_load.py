"""Loading scenes: what trimesh alone would misread, what must be refused, what must stay exact."""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from ssgi_cl.core.errors import MissingExtraError, SceneError, SsgiError
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.rasterize.files.from_trimesh import _Reader
from ssgi_cl.rasterize.files.gltf import _Geometry
from ssgi_cl.rasterize.files.gltf_document import read_document
from ssgi_cl.rasterize.files.load import load_scene
from ssgi_cl.rasterize.files.textures import TextureSet

SHARED = Path(__file__).parents[3] / "shared" / "scenes"

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
# float32 positions within a few units of the origin.
POSITION = {"rtol": 0, "atol": 1e-6}
# Normals and colours go through a few float32 roundings.
ROUNDED = {"rtol": 0, "atol": 1e-6}


def shared(name: str) -> Path:
    """Return a file of the shared scenes, or skip the test."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"needs the scene files in {SHARED}")
    return path


def written(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def obj_with(folder: Path, mtl: str, **images: Image.Image) -> Scene:
    """Load one triangle of material `m`, defined by `mtl`, with textures beside it."""
    for name, image in images.items():
        image.save(folder / f"{name}.png")
    written(folder, "m.mtl", f"newmtl m\n{mtl}\n")
    text = f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\n{FACE}"
    return load_scene(written(folder, "a.obj", text))


FACE = "f 1/1 2/2 3/3\n"


def corners(scene: Scene) -> np.ndarray:
    """Return [triangles, 3, 3] world-space corners."""
    return scene.positions[scene.triangles] + scene.origin


def png(pixels: Any) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(file, format="PNG")
    return file.getvalue()


class Gltf:
    """A .glb file in the making."""

    def __init__(self) -> None:
        self.binary = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data: bytes) -> int:
        start = len(self.binary)
        self.binary += data + bytes(-len(data) % 4)
        views = self.json["bufferViews"]
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
        return len(views) - 1

    def accessor(self, values: Any, dtype: str, **more: Any) -> int:
        array = np.asarray(values, dtype=dtype)
        kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
        components = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i1": 5120}
        self.json["accessors"].append(
            {
                "bufferView": self.view(array.tobytes()),
                "componentType": components[dtype],
                "count": len(array),
                "type": kinds[1 if array.ndim == 1 else array.shape[1]],
                **more,
            }
        )
        return len(self.json["accessors"]) - 1

    def triangle(self, x: float = 0.0, material: int | None = None, mesh: int = 0, **attributes: int) -> dict[str, Any]:
        positions = self.accessor([[x, 0, 0], [x + 1, 0, 0], [x, 1, 0]], "f4")
        primitive: dict[str, Any] = {"attributes": {"POSITION": positions, **attributes}}
        if material is not None:
            primitive["material"] = material
        self.json["meshes"][mesh]["primitives"].append(primitive)
        return primitive

    def material(self, factor: list[float] | None = None, **more: Any) -> int:
        inner = {} if factor is None else {"baseColorFactor": factor}
        self.json["materials"].append({"pbrMetallicRoughness": inner, **more})
        return len(self.json["materials"]) - 1

    def bytes(self) -> bytes:
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        size = 28 + len(text) + len(self.binary)
        return b"".join(
            [
                struct.pack("<4s3I4s", b"glTF", 2, size, len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(self.binary), b"BIN\0"),
                self.binary,
            ]
        )

    def load(self, folder: Path) -> Scene:
        return load_scene(written(folder, "a.glb", self.bytes()))


# --- OBJ and MTL -----------------------------------------------------------------------------


def test_relative_indices_count_back_from_their_own_line(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    found = corners(load_scene(written(tmp_path, "a.obj", text)))
    wanted = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[5, 0, 0], [6, 0, 0], [5, 1, 0]]]
    np.testing.assert_allclose(found, wanted, **POSITION)


def test_tabs_part_words_as_blanks_do(tmp_path: Path) -> None:
    text = "v\t0 0 0\nv\t1\t0\t0\nv 0 1\t0\nf\t1 2\t3\n"
    found = corners(load_scene(written(tmp_path, "a.obj", text)))
    np.testing.assert_allclose(found, [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], **POSITION)


def test_lines_may_be_continued_and_end_as_on_windows(tmp_path: Path) -> None:
    text = "v 0 0 0\r\nv 1 0 \\\r\n0\r\nv 0 1 0\r\nf 1 2 \\\r\n3\r\n"
    assert len(load_scene(written(tmp_path, "a.obj", text)).triangles) == 1


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


@pytest.mark.parametrize("name", ["../../etc/x", "/etc/hostname", "C:\\x.png", "a/../../x.png"])
def test_texture_outside_of_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(SceneError, match=r"leaves the folder|relative to the scene file"):
        obj_with(tmp_path, f"map_Kd {name}")


def test_link_to_a_texture_outside_of_the_folder_is_refused(tmp_path: Path) -> None:
    Image.new("RGB", (1, 1)).save(tmp_path / "secret.png")
    inside = tmp_path / "scene"
    inside.mkdir()
    (inside / "t.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(SceneError, match="leaves the folder"):
        obj_with(inside, "map_Kd t.png")


def test_missing_texture_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"brick wall\.png"):
        obj_with(tmp_path, "map_Kd brick wall.png")


def test_missing_library_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"gone\.mtl"):
        load_scene(written(tmp_path, "a.obj", "mtllib gone.mtl\n" + TRIANGLE))


def test_decompression_bomb_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"pixels|decompression bomb"):
        obj_with(tmp_path, "map_Kd t.png", t=Image.new("1", (20_000, 20_000)))


def test_damaged_texture_is_refused(tmp_path: Path) -> None:
    written(tmp_path, "t.png", png(np.zeros((64, 64, 3)))[:60])
    with pytest.raises(SceneError, match=r"t\.png"):
        obj_with(tmp_path, "map_Kd t.png")


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


def test_colours_of_obj_vertices_are_decoded_from_srgb(tmp_path: Path) -> None:
    text = "v 0 0 0 0.5 1 0\nv 1 0 0 0.5 1 0\nv 0 1 0 0.5 1 0\nf 1 2 3\n"
    scene = load_scene(written(tmp_path, "a.obj", text))
    # By the formula of sRGB: 0.5 gives 0.2140.
    np.testing.assert_allclose(scene.colors[0], [0.21404114, 1, 0], **ROUNDED)


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


def test_vertex_that_no_triangle_uses_may_be_anything(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, "a.obj", TRIANGLE + "v nan inf 0\n"))
    assert len(scene.positions) == 3


def test_triangles_without_area_are_dropped(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, "a.obj", TRIANGLE + "f 1 1 2\nf 1 2 2\n"))
    assert len(scene.triangles) == 1


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


# --- glTF ------------------------------------------------------------------------------------


def test_gltf_factors_keep_all_their_bits(tmp_path: Path) -> None:
    made = Gltf()
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}
    made.triangle(
        material=made.material([0.001, 0.0023, 0.5, 1.0], emissiveFactor=[1.0, 0.5, 0.25], extensions=strength)
    )
    material = made.load(tmp_path).materials[0]
    assert material.albedo == (0.001, 0.0023, 0.5)
    assert material.emission == (8.0, 4.0, 2.0)


def test_geometry_of_gltf_is_handed_on_in_a_well_formed_file(tmp_path: Path) -> None:
    file = Gltf()
    for number in range(12):  # so many lengths of the text
        file.triangle(float(number))
        document, views = read_document(written(tmp_path, "a.glb", file.bytes()))
        made = _Geometry(document, views).as_glb()
        magic, version, length, text, kind = struct.unpack_from("<4s3I4s", made)
        assert (magic, version, length, kind) == (b"glTF", 2, len(made), b"JSON")
        assert text % 4 == 0
        binary, kind = struct.unpack_from("<I4s", made, 20 + text)
        assert (28 + text + binary, kind) == (len(made), b"BIN\0")


def test_gltf_materials_find_their_meshes_though_names_are_missing_or_equal(tmp_path: Path) -> None:
    made = Gltf()
    for x, red in enumerate((0.1, 0.2, 0.3)):
        made.triangle(x=2.0 * x, material=made.material([red, 0, 0, 1], name="same"))
    made.triangle(x=6.0)
    made.json["meshes"].append({"primitives": [], "name": "GLTF"})
    made.triangle(x=8.0, material=made.material([0.4, 0, 0, 1]), mesh=1)
    made.json["nodes"] = [{"mesh": 1, "name": "world"}, {"mesh": 0, "name": "world"}]
    made.json["scenes"] = [{"nodes": [0, 1]}]
    scene = made.load(tmp_path)
    lefts = corners(scene)[:, :, 0].min(axis=1).round()
    reds = [scene.materials[i].albedo[0] for i in scene.material_ids]
    assert dict(zip(lefts.tolist(), reds, strict=True)) == {
        0.0: 0.1, 2.0: 0.2, 4.0: 0.3, 6.0: 0.8, 8.0: 0.4,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("fields", "albedo", "specular", "gloss"),
    [
        ({}, 0.6, 0.0, 1.0),
        ({"metallicFactor": 0.0, "roughnessFactor": 1.0}, 0.6, 0.0, 1.0),
        ({"metallicFactor": 0.0, "roughnessFactor": 0.5}, 0.6, 0.04, 30.0),
        # A metal's albedo is 0, unless it is so rough that its lobe counts as matt.
        ({"metallicFactor": 1.0, "roughnessFactor": 0.5}, 0.0, 0.6, 30.0),
        ({"metallicFactor": 1.0, "roughnessFactor": 0.77}, 0.6, 0.0, 1.0),
        ({"metallicFactor": 0.5, "roughnessFactor": 0.5}, 0.3, 0.32, 30.0),
        ({"metallicFactor": 0.0, "roughnessFactor": 0.0}, 0.6, 0.04, 1e6),
    ],
)
def test_gltf_roughness_and_metal_give_the_lobe(
    tmp_path: Path, fields: dict[str, float], albedo: float, specular: float, gloss: float
) -> None:
    made = Gltf()
    index = made.material([0.6, 0.6, 0.6, 1.0])
    made.json["materials"][index]["pbrMetallicRoughness"].update(fields)
    made.triangle(material=index)
    material = made.load(tmp_path).materials[0]
    assert material.specular == pytest.approx((specular,) * 3)
    assert material.gloss == pytest.approx(gloss)
    assert material.albedo == pytest.approx((albedo,) * 3)


def test_gltf_specular_and_glossiness_give_the_lobe(tmp_path: Path) -> None:
    made = Gltf()
    glossy = {"diffuseFactor": [0.5, 0.2, 0.1, 1.0], "specularFactor": [0.3, 0.4, 1.0], "glossinessFactor": 0.5}
    extension = {"KHR_materials_pbrSpecularGlossiness": glossy}
    made.triangle(material=made.material(extensions=extension))
    material = made.load(tmp_path).materials[0]
    assert material.specular == pytest.approx((0.3, 0.4, 0.9))
    assert material.gloss == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("fields", "cutoff"),
    [
        ({}, 0.0),
        ({"alphaMode": "OPAQUE", "alphaCutoff": 0.3}, 0.0),
        ({"alphaMode": "MASK"}, 0.5),
        ({"alphaMode": "MASK", "alphaCutoff": 0.3}, 0.3),
        ({"alphaMode": "BLEND"}, 0.5),
    ],
)
def test_gltf_alpha_mode_gives_the_cutoff(tmp_path: Path, fields: dict[str, Any], cutoff: float) -> None:
    made = Gltf()
    made.triangle(material=made.material([1, 1, 1, 0.75], **fields))
    material = made.load(tmp_path).materials[0]
    assert (material.alpha_cutoff, material.alpha) == (cutoff, 0.75)


@pytest.mark.parametrize(
    ("factor", "texel", "blends"),
    [(1.0, None, False), (0.75, None, True), (1.0, 255, False), (1.0, 254, True), (0.5, 255, True)],
)
def test_gltf_blends_where_anything_is_seen_through(
    tmp_path: Path, factor: float, texel: int | None, blends: bool
) -> None:
    made = Gltf()
    index = made.material([1, 1, 1, factor], alphaMode="BLEND")
    if texel is not None:
        texels = np.full((2, 2, 4), 255)
        texels[1, 0, 3] = texel
        made.json["images"] = [{"bufferView": made.view(png(texels))}]
        made.json["textures"] = [{"source": 0}]
        made.json["materials"][index]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    made.triangle(material=index)
    material = made.load(tmp_path).materials[0]
    assert (material.blends, material.is_seen_through) == (blends, blends)


def test_gltf_transmission_takes_its_share_of_the_base_colour(tmp_path: Path) -> None:
    made = Gltf()
    thin = {"KHR_materials_transmission": {"transmissionFactor": 0.75}}
    rough = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    made.triangle(material=made.material([0.8, 0.4, 0.2, 1.0], extensions=thin))
    made.json["materials"][0]["pbrMetallicRoughness"].update(rough)
    material = made.load(tmp_path).materials[0]
    assert material.transmission == pytest.approx((0.6, 0.3, 0.15))
    assert material.albedo == pytest.approx((0.2, 0.1, 0.05))
    assert not material.blends
    # A metal lets nothing through (KHR_materials_transmission: it takes from the diffuse part).
    made.json["materials"][0]["pbrMetallicRoughness"].update(metallicFactor=1, roughnessFactor=0.2)
    assert made.load(tmp_path).materials[0].transmission == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("factor", [-1.0, 7.0])
def test_gltf_transmission_beyond_its_range_is_the_nearest_within(tmp_path: Path, factor: float) -> None:
    made = Gltf()
    thin = {"KHR_materials_transmission": {"transmissionFactor": factor}}
    made.triangle(material=made.material([0.5, 0.5, 0.5, 1.0], extensions=thin))
    material = made.load(tmp_path).materials[0]
    assert material.transmission == pytest.approx((0.5 * (factor > 0),) * 3)


def test_gltf_texture_coordinates_run_upwards_and_beyond_one(tmp_path: Path) -> None:
    made = Gltf()
    uvs = made.accessor([[0, 0], [3, -1], [0.5, 2.25]], "f4")
    made.json["images"] = [{"bufferView": made.view(png(np.zeros((2, 2, 3))))}]
    made.json["textures"] = [{"source": 0}]
    index = made.material()
    made.json["materials"][index]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    made.triangle(material=index, TEXCOORD_0=uvs)
    scene = made.load(tmp_path)
    np.testing.assert_array_equal(scene.uvs[scene.triangles[0]], [[0, 1], [3, 2], [0.5, -1.25]])
    assert scene.materials[0].texture == 0


def test_gltf_normalised_coordinates_and_colours_are_scaled(tmp_path: Path) -> None:
    made = Gltf()
    uvs = made.accessor([[0, 0], [65535, 0], [0, 65535]], "u2", normalized=True)
    shades = made.accessor([[255, 51, 0, 255]] * 3, "u1", normalized=True)
    index = made.material([1, 1, 1, 1])
    transform = {"KHR_texture_transform": {"scale": [2, 2], "offset": [0.5, 0]}}
    made.json["images"] = [{"bufferView": made.view(png(np.zeros((2, 2, 3))))}]
    made.json["textures"] = [{"source": 0}]
    laid = {"index": 0, "extensions": transform}
    made.json["materials"][index]["pbrMetallicRoughness"]["baseColorTexture"] = laid
    made.triangle(material=index, TEXCOORD_0=uvs, COLOR_0=shades)
    scene = made.load(tmp_path)
    wanted = [[0.5, 1], [2.5, 1], [0.5, -1]]
    np.testing.assert_allclose(scene.uvs[scene.triangles[0]], wanted, **ROUNDED)
    # glTF's vertex colours are linear: 51 / 255 stays 0.2.
    np.testing.assert_allclose(scene.colors[0], [1, 0.2, 0], **ROUNDED)


def test_gltf_instances_are_placed_each_by_its_own_transform(tmp_path: Path) -> None:
    made = Gltf()
    made.triangle(NORMAL=made.accessor([[0, 0, 1]] * 3, "f4"))
    made.json["nodes"] = [
        {"mesh": 0, "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [-1, 1, 1]},
        {"children": [3], "rotation": [math.sqrt(0.5), 0, 0, math.sqrt(0.5)]},
        {"mesh": 0, "scale": [1, 1, 4]},
    ]
    made.json["scenes"] = [{"nodes": [0, 1, 2]}]
    scene = made.load(tmp_path)
    found = corners(scene)
    assert sorted(found[:, :, 0].min(axis=1).round().tolist()) == [-1.0, 0.0, 10.0]
    faces = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    given = scene.normals[scene.triangles[:, 0]]
    # Winding and normal agree, also in the mirror.
    assert (np.einsum("ij,ij->i", faces, given) > 0.99).all()
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=1), 1.0, **ROUNDED)
    # About x by 90 degrees, +z goes to -y.
    assert (np.abs(given - [0, -1, 0]).max(axis=1) < 1e-6).sum() == 1


def test_normals_follow_the_inverse_transpose(tmp_path: Path) -> None:
    made = Gltf()
    slope = math.sqrt(0.5)
    made.triangle(NORMAL=made.accessor([[slope, slope, 0]] * 3, "f4"))
    made.json["nodes"] = [{"mesh": 0, "scale": [2, 1, 1]}]
    found = made.load(tmp_path).normals[0]
    np.testing.assert_allclose(found, np.array([0.5, 1, 0]) / math.sqrt(1.25), **ROUNDED)


def test_gltf_with_files_beside_it_reads_them(tmp_path: Path) -> None:
    made = Gltf()
    made.triangle()
    made.json["buffers"] = [{"byteLength": len(made.binary), "uri": "my%20data.bin"}]
    written(tmp_path, "my data.bin", made.binary)
    path = written(tmp_path, "a.gltf", json.dumps(made.json))
    assert len(load_scene(path).triangles) == 1
    packed = base64.b64encode(made.binary).decode()
    made.json["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{packed}"
    assert len(load_scene(written(tmp_path, "b.gltf", json.dumps(made.json))).triangles) == 1


@pytest.mark.parametrize("uri", ["../x.bin", "/etc/hostname", "https://example.org/x.bin"])
def test_gltf_buffer_outside_of_the_folder_is_refused(tmp_path: Path, uri: str) -> None:
    made = Gltf()
    made.triangle()
    made.json["buffers"] = [{"byteLength": len(made.binary), "uri": uri}]
    with pytest.raises(SceneError, match=r"leaves the folder|relative to the scene file"):
        load_scene(written(tmp_path, "a.gltf", json.dumps(made.json)))


@pytest.mark.skipif(importlib.util.find_spec("DracoPy") is not None, reason="needs DracoPy to be absent")
def test_draco_without_its_package_names_the_extra(tmp_path: Path) -> None:
    made = Gltf()
    primitive = made.triangle()
    packed = {"bufferView": made.view(b"DRACO"), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    with pytest.raises(MissingExtraError, match=r"ssgi-cl\[draco\]"):
        made.load(tmp_path)


def test_draco_is_decoded_where_its_package_is_installed(tmp_path: Path) -> None:
    pytest.importorskip("DracoPy", reason="needs the package DracoPy (extra draco)")
    sphere = trimesh.creation.icosphere(subdivisions=2)
    data = trimesh.exchange.gltf.export_glb(trimesh.Scene(sphere), extension_draco=True)
    scene = load_scene(written(tmp_path, "a.glb", data))
    assert len(scene.triangles) == len(sphere.faces)
    radii = np.linalg.norm(scene.positions + scene.origin, axis=1)
    # Positions are rounded to 14 bits of a width of 2, in each of three directions.
    np.testing.assert_allclose(radii, 1.0, rtol=0, atol=3**0.5 * 2.0 / 2**14)


def test_meshopt_is_refused(tmp_path: Path) -> None:
    made = Gltf()
    made.triangle()
    made.json["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {}}
    with pytest.raises(SceneError, match="EXT_meshopt_compression"):
        made.load(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j.update(extensionsRequired=["EXT_other"]), "EXT_other"),
        (lambda j: j["accessors"][0].update(count=2**40), "reads 1099511627776 items"),
        (lambda j: j["accessors"][0].update(sparse={}), "sparse"),
        (lambda j: j["accessors"][0].pop("bufferView"), "no buffer view"),
        (lambda j: j["bufferViews"][0].update(byteLength=2**40), "covers bytes"),
        (lambda j: j["nodes"][0].update(children=[0]), "several places"),
        (lambda j: j["nodes"][0].update(mesh=7), "the mesh of a node is 7"),
        (lambda j: j["nodes"][0].update(scale=[1, math.nan, 1]), "not finite"),
        (lambda j: j["meshes"][0]["primitives"][0].update(mode=6), "fans"),
        (lambda j: j["meshes"][0]["primitives"][0].update(material=3), "a material is 3"),
        (lambda j: j["meshes"][0]["primitives"][0].update(mode=1), "no triangle"),
        (lambda j: j.update(scene=4), "the scene is 4"),
        (lambda j: j["asset"].update(version="1.0"), "1.0"),
        (lambda j: j.update(meshes=3), "meshes is 3: expected a list"),
    ],
)
def test_bad_gltf_is_refused_with_the_reason(tmp_path: Path, change: Any, message: str) -> None:
    made = Gltf()
    made.triangle()
    change(made.json)
    with pytest.raises(SceneError, match=message):
        made.load(tmp_path)


def test_gltf_index_beyond_the_vertices_is_refused(tmp_path: Path) -> None:
    made = Gltf()
    made.triangle()["indices"] = made.accessor([0, 1, 3], "u2")
    with pytest.raises(SceneError, match="refers to vertex 3, but there are 3"):
        made.load(tmp_path)


# --- PLY -------------------------------------------------------------------------------------


def ply(properties: str, vertices: list[str], faces: list[str], face_properties: str = "") -> str:
    return (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
        f"property float y\nproperty float z\n{properties}element face {len(faces)}\n"
        f"property list uchar int vertex_indices\n{face_properties}end_header\n"
        + "".join(f"{line}\n" for line in (*vertices, *faces))
    )


def test_colours_of_ply_vertices_are_decoded_from_srgb(tmp_path: Path) -> None:
    colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    vertices = ["0 0 0 188 255 0", "1 0 0 188 255 0", "0 1 0 188 255 0"]
    scene = load_scene(written(tmp_path, "a.ply", ply(colors, vertices, ["3 0 1 2"])))
    # By the formula of sRGB: 188 of 255 gives 0.5029.
    np.testing.assert_allclose(scene.colors[0], [0.50288653, 1, 0], **ROUNDED)
    assert scene.materials[0].albedo == (1.0, 1.0, 1.0)


def test_colours_of_ply_faces_stay_apart(tmp_path: Path) -> None:
    colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    vertices = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    faces = ["3 0 1 2 255 0 0", "3 0 2 3 0 0 255"]
    scene = load_scene(written(tmp_path, "a.ply", ply("", vertices, faces, colors)))
    np.testing.assert_array_equal(scene.colors[scene.triangles], [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3])


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
        (ply("", ["0 0 0"] * 5, ["5 0 1 2 3 4"]), "5 corners"),
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


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"nothing\.obj"):
        load_scene(tmp_path / "nothing.obj")


def test_unknown_kind_lists_those_that_are_known(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"\.glb, \.gltf, \.obj, \.ply"):
        load_scene(written(tmp_path, "a.fbx", "x"))


def test_crease_angle_out_of_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="crease_angle is 40"):
        load_scene(written(tmp_path, "a.obj", TRIANGLE), crease_angle=40.0)


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb"])
def test_damaged_file_loads_or_is_refused_but_never_fails_otherwise(tmp_path: Path, suffix: str) -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    sphere.visual.vertex_colors = np.tile([10, 200, 30, 255], (len(sphere.vertices), 1))
    whole = sphere.export(file_type=suffix)
    whole = whole.encode() if isinstance(whole, str) else whole
    rng = np.random.default_rng(7)
    for trial in range(150):
        data = bytearray(whole)
        if trial % 3 == 0:
            data = data[: rng.integers(0, len(data))]
        else:
            # Mostly in the head, where the counts are.
            reach = len(data) if trial % 3 == 1 else min(600, len(data))
            for place in rng.integers(0, reach, size=1 + trial % 4):
                data[place] = rng.integers(0, 256)
        path = written(tmp_path, f"a.{suffix}", bytes(data))
        try:  # refused or loaded: both are fine, anything else fails the test
            assert len(load_scene(path).triangles) > 0
        except SsgiError:
            continue


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
