"""Textures and libraries are found as they are written, in any case, or by their base name; else they are noted."""

from __future__ import annotations

from pathlib import Path

import pytest

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.files.load import load_scene

from .loading import Gltf, png, written

TEXTURED = "mtllib scene.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
IMAGE = png([[[255, 0, 0]]])


def textured(folder: Path, line: str, *files: str, library: str = "scene.mtl", image: bytes = IMAGE) -> Scene:
    """Load a triangle in the folder "model", whose material has a map, with images in some places."""
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(image)
    model = folder / "model"
    model.mkdir(exist_ok=True)
    written(model, library, f"newmtl m\nKd .2 .4 .6\nmap_Kd {line}\n")
    return load_scene(written(model, "scene.obj", TEXTURED))


@pytest.mark.parametrize(
    ("line", "file", "library"),
    [
        ("textures/b.png", "model/textures/b.png", "scene.mtl"),
        ("textures\\b.png", "model/textures/b.png", "Scene.MTL"),
        ("Textures/Brick.PNG", "model/textures/brick.png", "scene.mtl"),
        ("C:\\Users\\me\\b.png", "model/b.png", "scene.mtl"),
        ("/home/me/b.png", "model/b.png", "scene.mtl"),
        ("../texture/b.png", "model/b.png", "scene.mtl"),
        ("textures/../b.png", "model/b.png", "scene.mtl"),
    ],
)
def test_a_texture_is_found(tmp_path: Path, line: str, file: str, library: str) -> None:
    (tmp_path / "model" / "textures").mkdir(parents=True)
    scene = textured(tmp_path, line, file, library=library)
    assert len(scene.textures) == 1
    assert scene.notes == ()


def test_a_name_that_is_written_alike_is_preferred(tmp_path: Path) -> None:
    written(tmp_path, "B.png", png([[[0, 0, 255]]]))
    scene = textured(tmp_path, "b.png", "model/b.png", "model/B.PNG")
    assert scene.textures[0][0, 0, 0] == 255


def test_a_texture_that_is_not_found_leaves_the_factor(tmp_path: Path) -> None:
    scene = textured(tmp_path, "../texture/b.png", "texture/b.png")  # outside of the model's folder
    assert not scene.textures
    assert scene.materials[0].albedo == (0.2, 0.4, 0.6)
    (note,) = scene.notes
    assert "map_kd texture of material 'm' is '../texture/b.png', which is not found" in note


def test_libraries_and_materials_that_are_not_found_are_noted(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, "scene.obj", TEXTURED))
    assert scene.notes == (
        "the mtllib is 'scene.mtl', which is not found: its materials are drawn grey",
        "material 'm' is in no library: it is drawn grey",
    )


def test_what_cannot_be_read_can_be_left_out(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"is not an image of the kinds .*textures=False"):
        textured(tmp_path, "b.dds", "model/b.dds", image=b"DDS ")
    scene = load_scene(tmp_path / "model" / "scene.obj", textures=False)
    assert not scene.textures
    assert scene.materials[0].albedo == (0.2, 0.4, 0.6)


def test_gltf_images_follow_the_same_rules(tmp_path: Path) -> None:
    made = Gltf()
    made.triangle(material=0)
    made.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    made.json["textures"], made.json["images"] = [{"source": 0}], [{"uri": "Wood%20A.png"}]
    assert "'Wood A.png', which is not found" in made.load(tmp_path).notes[0]
    written(tmp_path, "wood a.png", IMAGE)
    assert len(made.load(tmp_path).textures) == 1


@pytest.mark.parametrize("required", [False, True])
@pytest.mark.parametrize("fallback", [False, True])
def test_ktx2_has_a_fallback_or_a_remedy(tmp_path: Path, fallback: bool, required: bool) -> None:
    made = Gltf()
    made.triangle(material=0)
    made.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    made.json["images"] = [{"bufferView": made.view(IMAGE)}, {"bufferView": made.view(b"KTX 20")}]
    texture = {"extensions": {"KHR_texture_basisu": {"source": 1}}, **({"source": 0} if fallback else {})}
    made.json["textures"], made.json["extensionsUsed"] = [texture], ["KHR_texture_basisu"]
    if required:
        made.json["extensionsRequired"] = ["KHR_texture_basisu"]
    if fallback:
        scene = made.load(tmp_path)
        assert len(scene.textures) == 1
        assert scene.notes == (
            "KTX2 images (KHR_texture_basisu) are not read: those that the file has beside them are drawn",
        )
    else:
        with pytest.raises(SceneError, match=r"texture 0 is a KTX2 image .* export it with PNG, .*textures=False"):
            made.load(tmp_path)
