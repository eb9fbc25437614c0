"""Files that nobody vouches for: refused with a reason, in little time and memory, or loaded."""

from __future__ import annotations

import base64
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.rasterize.files.load import load_scene

from .reading import Reader
from .seeds import Files, chunk, document, exrs, glb, obj, picture, plys, png_of, seeds

CORPUS = Path(__file__).with_name("corpus")
OBJ = obj()
PLY = plys()[0]["a.ply"]
PNG = picture()


@pytest.fixture(scope="module")
def reader() -> Iterator[Reader]:
    """A process of little memory that reads."""
    process = Reader()
    yield process
    process.close()


def verdict(reader: Reader, folder: Path, files: Files) -> tuple[str, str]:
    """Write files and read the first: return the outcome, and what the error said."""
    for name, data in files.items():
        (folder / name).write_bytes(data)
    found = reader.verdict(folder / next(iter(files)))
    return found["outcome"], found["detail"]


def changed(change: Callable[[dict[str, Any]], object], image: bytes = PNG) -> Files:
    """Return a .glb file whose JSON `change` has changed."""
    parts, binary = document(image)
    change(parts)
    return {"a.glb": glb(parts, binary)}


def with_uri(uri: str) -> Files:
    return changed(lambda j: j.update(images=[{"uri": uri}]))


def with_map(line: str) -> Files:
    library = b"newmtl m\n" + line.encode() + b"\n"
    return {**OBJ, "a.mtl": library}


def exr_with(name: bytes, value: bytes) -> Files:
    """Return an OpenEXR file with another value of an attribute of its header."""
    data = exrs()[1 if name == b"tiles" else 0]["a.exr"]
    at = data.index(name + b"\0") + len(name) + 1
    at = data.index(b"\0", at) + 5
    return {"a.exr": data[:at] + value + data[at + len(value) :]}


def with_nodes(nodes: list[dict[str, Any]]) -> Files:
    return changed(lambda j: j.update(nodes=nodes, scenes=[{"nodes": [0]}]))


def overlapping(parts: dict[str, Any]) -> None:
    """Give every one of very many primitives a view of its own of all the bytes."""
    length = parts["buffers"][0]["byteLength"]
    parts["bufferViews"] += [{"buffer": 0, "byteLength": length, "byteStride": 12 + i} for i in range(2000)]
    parts["accessors"] += [
        {"bufferView": 6 + i, "componentType": 5126, "type": "VEC3", "count": 3} for i in range(2000)
    ]
    parts["meshes"][0]["primitives"] += [{"attributes": {"POSITION": 5 + i}} for i in range(2000)]


REFUSED: dict[str, tuple[Files, str]] = {
    # glTF
    "JSON nested very deeply": ({"a.gltf": b"[" * 10**6}, "not glTF"),
    "no JSON": ({"a.gltf": b"\xff\xfe"}, "not glTF"),
    "a number of many digits": ({"a.gltf": b'{"asset": ' + b"9" * 10**5 + b"}"}, "not glTF"),
    "nodes in a ring": (with_nodes([{"children": [1]}, {"children": [0]}]), "several places"),
    "a node that is its own child": (with_nodes([{"children": [0], "mesh": 0}]), "several places"),
    "a child that isn't there": (with_nodes([{"children": [7]}]), "a child of a node is 7"),
    "a negative child": (with_nodes([{"children": [-1]}]), "nodes[0].children[0] is -1"),
    "a matrix that overflows": (
        with_nodes([{"mesh": 0, "scale": [1e200, 1, 1], "children": [1]}, {"mesh": 0, "scale": [1e200, 1, 1]}]),
        "beyond 1e+30",
    ),
    "very many items": (changed(lambda j: j["accessors"][0].update(count=2**62)), "reads 46116860"),
    "a negative count": (changed(lambda j: j["accessors"][0].update(count=-3)), "count is -3"),
    "a view beyond the buffer": (changed(lambda j: j["bufferViews"][0].update(byteOffset=2**40)), "covers bytes"),
    "instances without end": (
        changed(
            lambda j: (
                j["meshes"][0].update(primitives=j["meshes"][0]["primitives"] * 1000),
                j.update(nodes=[{"mesh": 0}] * 30000, scenes=[{"nodes": list(range(30000))}]),
            )
        ),
        "60000000 triangles",
    ),
    "a buffer outside": (changed(lambda j: j["buffers"][0].update(uri="../../etc/passwd")), "leaves the folder"),
    "no base64": (with_uri("data:;base64,=A"), "image 0"),
    # images
    "a huge image": (changed(lambda j: None, png_of(60000, 60000)), "60000 x 60000|exceeds limit"),
    "an image with nothing in it": (changed(lambda j: None, png_of(8000, 8000)), "as an image"),
    "a text that unpacks to much": (
        changed(lambda j: None, png_of(4, 4, more=chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(1 << 26))))),
        "as an image",
    ),
    "many large images": (
        changed(
            lambda j: j.update(images=[{"uri": "data:;base64," + base64.b64encode(png_of(8000, 8000)).decode()}] * 9)
        ),
        "as an image",
    ),
    # OBJ and MTL
    "an index beyond the vertices": ({"a.obj": b"v 0 0 0\nf 1 2 3\n"}, "refers to v 2"),
    "an index of many digits": ({"a.obj": b"v 0 0 0\nf 1 1 " + b"9" * 4000 + b"\n"}, "corner"),
    "vertices that are no numbers": ({"a.obj": b"v nan 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n"}, "expected finite numbers"),
    "a texture that is the scene": (with_map("map_Kd a.obj"), "not an image"),
    # PLY
    "very many vertices": ({"a.ply": PLY.replace(b"vertex 4", b"vertex 9999999")}, "cut off"),
    "a negative number of faces": ({"a.ply": PLY.replace(b"face 2", b"face -2")}, "face -2"),
    "a type that isn't one": ({"a.ply": PLY.replace(b"uchar int", b"uchar blob")}, "blob"),
    "a list of negative length": ({"a.ply": PLY.replace(b"\n3 0", b"\n-1 0")}, "fit its header|no triangle"),
    "vertices without heights": ({"a.ply": PLY.replace(b"float z", b"float w")}, "x, y and z"),
    # OpenEXR
    "a window as wide as numbers go": (exr_with(b"dataWindow", struct.pack("<4i", 0, 0, 2**31 - 1, 10)), "window"),
    "a window of negative size": (exr_with(b"dataWindow", struct.pack("<4i", 10, 10, 0, 0)), "window"),
    "more rows than fit": (exr_with(b"dataWindow", struct.pack("<4i", 0, 0, 100, 10**6)), "can't lie in"),
    "a huge tile": (exr_with(b"tiles", struct.pack("<2I", 2**31, 2**31)), "tiles"),
    "an attribute of negative size": (
        {
            "a.exr": exrs()[0]["a.exr"].replace(
                b"compression\0" + struct.pack("<i", 1), b"compression\0" + struct.pack("<i", -1)
            )
        },
        "has -1 bytes",
    ),
    "no end of the header": ({"a.exr": exrs()[0]["a.exr"][:100]}, "cut short"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_malicious_file_is_refused_with_the_reason(reader: Reader, tmp_path: Path, name: str) -> None:
    files, reason = REFUSED[name]
    outcome, detail = verdict(reader, tmp_path, files)
    assert outcome == "refused", detail
    assert any(part in detail for part in reason.split("|")), detail


def test_many_views_of_the_same_bytes_cost_no_more_than_they_say(reader: Reader, tmp_path: Path) -> None:
    outcome, detail = verdict(reader, tmp_path, changed(overlapping))
    assert outcome in ("refused", "loaded"), detail


def test_a_chain_of_very_many_nodes_is_loaded(reader: Reader, tmp_path: Path) -> None:
    chain: list[dict[str, Any]] = [{"children": [i + 1]} for i in range(20000)]
    outcome, detail = verdict(reader, tmp_path, with_nodes([*chain, {"mesh": 0}]))
    assert outcome == "loaded", detail


def test_a_polygon_of_very_many_corners_is_refused_or_cut(reader: Reader, tmp_path: Path) -> None:
    """A comb: no fan fits it."""
    rows = [f"v {i} {i % 2} 0" for i in range(990)] + ["v 990 -1 0", "v 0 -1 0"]
    face = "f " + " ".join(str(i + 1) for i in range(len(rows)))
    text = "\n".join([*rows, face, ""]).encode()
    assert verdict(reader, tmp_path, {"a.obj": text})[0] == "loaded"


def test_what_the_faults_are_made_from_is_sound(reader: Reader, tmp_path: Path) -> None:
    for number, files in enumerate(seeds()):
        folder = tmp_path / str(number)
        folder.mkdir()
        outcome, detail = verdict(reader, folder, files)
        assert outcome == "loaded", (sorted(files), detail)


def test_files_that_the_fuzzer_found_are_refused_or_loaded(reader: Reader) -> None:
    cases = sorted(CORPUS.iterdir())
    assert len(cases) > 50
    for case in cases:
        (path,) = (file for file in case.iterdir() if file.name == f"a.{case.name.split('-')[0]}")
        found = reader.verdict(path)
        assert found["outcome"] in ("refused", "loaded"), (case.name, found)


def test_a_link_out_of_the_folder_is_not_followed(reader: Reader, tmp_path: Path) -> None:
    outside = tmp_path / "outside.png"
    outside.write_bytes(PNG)
    inside = tmp_path / "scene"
    inside.mkdir()
    (inside / "link.png").symlink_to(outside)
    assert verdict(reader, inside, with_uri("link.png"))[0] == "loaded"
    scene = load_scene(inside / "a.glb")
    assert not scene.textures
    assert any("'link.png', which is not found" in note for note in scene.notes)


OUTSIDE = (
    "../../../../../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "/etc/passwd", "file:///etc/passwd", "a\0b.png",
    "a" * 5000, ".", "..", "../outside.png", "C:\\a\\outside.png",
)  # fmt: skip
"""Names of textures outside of the folder, or of none."""


@pytest.mark.parametrize("name", OUTSIDE, ids=lambda name: repr(name[:40]))
def test_nothing_outside_of_the_folder_is_read(reader: Reader, tmp_path: Path, name: str) -> None:
    inside = tmp_path / "scene"
    inside.mkdir()
    (tmp_path / "outside.png").write_bytes(PNG)
    for files in (with_uri(name), with_map(f"map_Kd {name}"), {"a.obj": f"mtllib {name}\n".encode() + OBJ["a.obj"]}):
        outcome, detail = verdict(reader, inside, files)
        assert outcome == "loaded", detail
        scene = load_scene(inside / next(iter(files)))
        assert not scene.textures
        assert any("not found" in note for note in scene.notes)


@pytest.mark.slow
def test_the_fuzzer_finds_nothing_new(tmp_path: Path) -> None:
    script = Path(__file__).with_name("fuzz.py")
    command = [sys.executable, str(script), "--seconds", "60", "--out", str(tmp_path)]
    done = subprocess.run([*command, "--seed", str(int(time.time()))], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
