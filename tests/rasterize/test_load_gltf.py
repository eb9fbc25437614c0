"""Loading glTF files: factors, materials, textures, instances, and what must be refused."""

from __future__ import annotations

import base64
import importlib.util
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from ssgi_cl.core.errors import MissingExtraError, SceneError
from ssgi_cl.core.scene import Material
from ssgi_cl.rasterize.files.gltf import _Geometry
from ssgi_cl.rasterize.files.gltf_document import read_document
from ssgi_cl.rasterize.files.load import load_scene

from .loading import ROUNDED, Gltf, corners, written


def only_material(folder: Path, made: Gltf, index: int) -> Material:
    """Return the material of a file of one triangle."""
    made.triangle(material=index)
    return made.load(folder).materials[0]


def test_gltf_factors_keep_all_their_bits(tmp_path: Path) -> None:
    made = Gltf()
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}}
    index = made.material([0.001, 0.0023, 0.5, 1.0], emissiveFactor=[1.0, 0.5, 0.25], extensions=strength)
    material = only_material(tmp_path, made, index)
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
    assert dict(zip(lefts.tolist(), reds, strict=True)) == {0.0: 0.1, 2.0: 0.2, 4.0: 0.3, 6.0: 0.8, 8.0: 0.4}


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
    material = only_material(tmp_path, made, made.material([0.6, 0.6, 0.6, 1.0], fields))
    assert material.specular == pytest.approx((specular,) * 3)
    assert material.gloss == pytest.approx(gloss)
    assert material.albedo == pytest.approx((albedo,) * 3)


def test_gltf_specular_and_glossiness_give_the_lobe(tmp_path: Path) -> None:
    made = Gltf()
    glossy = {"diffuseFactor": [0.5, 0.2, 0.1, 1.0], "specularFactor": [0.8, 0.4, 1.0], "glossinessFactor": 0.5}
    extension = {"KHR_materials_pbrSpecularGlossiness": glossy}
    material = only_material(tmp_path, made, made.material(extensions=extension))
    assert material.specular == pytest.approx((0.8, 0.4, 1.0))
    assert material.gloss == pytest.approx(30.0)
    assert material.albedo == (0.0, 0.0, 0.0)  # what the brightest channel of the lobe leaves


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
    material = only_material(tmp_path, made, made.material([1, 1, 1, 0.75], **fields))
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
        made.lay(index, texels)
    material = only_material(tmp_path, made, index)
    assert (material.blends, material.is_seen_through) == (blends, blends)


def test_gltf_transmission_takes_its_share_of_the_base_colour(tmp_path: Path) -> None:
    made = Gltf()
    thin = {"KHR_materials_transmission": {"transmissionFactor": 0.75}}
    rough = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    material = only_material(tmp_path, made, made.material([0.8, 0.4, 0.2, 1.0], rough, extensions=thin))
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
    material = only_material(tmp_path, made, made.material([0.5, 0.5, 0.5, 1.0], extensions=thin))
    assert material.transmission == pytest.approx((0.5 * (factor > 0),) * 3)


def test_gltf_texture_coordinates_run_upwards_and_beyond_one(tmp_path: Path) -> None:
    made = Gltf()
    uvs = made.accessor([[0, 0], [3, -1], [0.5, 2.25]], "f4")
    index = made.material()
    made.lay(index, np.zeros((2, 2, 3)))
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
    made.lay(index, np.zeros((2, 2, 3)), extensions=transform)
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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j.update(extensionsRequired=["EXT_other"]), "EXT_other"),
        (lambda j: j["bufferViews"][0].update(extensions={"EXT_meshopt_compression": {}}), "EXT_meshopt_compression"),
        (lambda j: j["accessors"][0].update(sparse={}), r"accessors\[0\].sparse has no 'count'"),
        (lambda j: j["nodes"][0].update(mesh=7), "the mesh of a node is 7"),
        (lambda j: j["nodes"][0].update(scale=[1, math.nan, 1]), "not finite"),
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
