"""Small sound files of every kind that is read, which faults are made from."""

from __future__ import annotations

import io
import json
import struct
import tempfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import trimesh
from PIL import Image

Files = dict[str, bytes]
"""Contents by name; the first is the one to read, the others lie beside it."""

_PLY_FACES = b"3 0 1 2\n3 0 2 3\n"
_SQUARE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))


def picture(kind: str = "PNG", size: tuple[int, int] = (8, 4), mode: str = "RGB") -> bytes:
    """Return an image file of a few colours."""
    columns, rows = size
    pixels = np.arange(columns * rows * len(mode), dtype=np.uint8).reshape(rows, columns, -1)
    file = io.BytesIO()
    Image.fromarray(pixels.squeeze()).save(file, format=kind)
    return file.getvalue()


def chunk(kind: bytes, body: bytes) -> bytes:
    """Return a chunk of a PNG file."""
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png_of(columns: int, rows: int, body: bytes = b"", more: bytes = b"") -> bytes:
    """Return a PNG file that claims a size, whatever it holds."""
    head = chunk(b"IHDR", struct.pack(">2I5B", columns, rows, 8, 2, 0, 0, 0))
    end = chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + head + more + end


def glb(document: dict[str, Any], binary: bytes) -> bytes:
    """Return a .glb file with the right lengths."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    head = struct.pack("<4s3I4s", b"glTF", 2, 28 + len(text) + len(binary), len(text), b"JSON")
    return b"".join([head, text, struct.pack("<I4s", len(binary), b"BIN\0"), binary])


def document(image: bytes | None = None) -> tuple[dict[str, Any], bytes]:
    """Return a textured, indexed square, placed twice below a node, as JSON and bytes."""
    image = picture() if image is None else image
    pieces = [
        np.array(_SQUARE, "<f4").tobytes(),
        np.tile(np.array([0, 0, 1], "<f4"), 4).tobytes(),
        np.array([0, 0, 255, 0, 255, 255, 0, 255], np.uint8).tobytes(),
        np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes(),
        np.tile(np.array([255, 128, 0, 255], np.uint8), 4).tobytes(),
        image,
    ]
    views, binary = [], b""
    for piece in pieces:
        binary += bytes(-len(binary) % 4)
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(piece)})
        binary += piece
    kinds = [(5126, "VEC3", 4), (5126, "VEC3", 4), (5121, "VEC2", 4), (5123, "SCALAR", 6), (5121, "VEC4", 4)]
    accessors: list[dict[str, Any]] = [
        {"bufferView": i, "byteOffset": 0, "componentType": c, "type": t, "count": n}
        for i, (c, t, n) in enumerate(kinds)
    ]
    accessors[2]["normalized"] = accessors[4]["normalized"] = True
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 4}
    primitive = {"attributes": attributes, "indices": 3, "material": 0, "mode": 4}
    transform = {"KHR_texture_transform": {"scale": [2, 2], "rotation": 0.5, "offset": [0, 1]}}
    texture = {"index": 0, "texCoord": 0, "extensions": transform}
    made: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1, 2], "translation": [0, 1, 0]},
            {"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, 2, 1]},
            {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1]},
        ],
        "meshes": [{"primitives": [primitive]}],
        "materials": [
            {
                "name": "m",
                "alphaMode": "MASK",
                "alphaCutoff": 0.25,
                "emissiveFactor": [1, 1, 0],
                "emissiveTexture": {"index": 0},
                "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1], "baseColorTexture": texture},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}},
            }
        ],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 5, "mimeType": "image/png", "name": "i"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
        "extensionsUsed": ["KHR_texture_transform", "KHR_materials_emissive_strength"],
    }
    return made, binary


def with_views(made: dict[str, Any], binary: bytes) -> tuple[dict[str, Any], bytes]:
    """Return a document with cameras and lights too."""
    lights = "KHR_lights_punctual"
    made["nodes"][0] |= {"camera": 0, "name": "a", "extensions": {lights: {"light": 0}}}
    made["nodes"][1] |= {"camera": 1, "extensions": {lights: {"light": 1}}}
    made["cameras"] = [
        {"type": "perspective", "name": "b", "perspective": {"yfov": 1, "znear": 0.1, "zfar": 9, "aspectRatio": 1.5}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 9}},
    ]
    cone = {"innerConeAngle": 0.1, "outerConeAngle": 0.4}
    spot = {"type": "spot", "name": "c", "color": [1, 0.5, 0], "intensity": 9, "range": 5, "spot": cone}
    made["extensions"] = {lights: {"lights": [spot, {"type": "directional", "intensity": 3}]}}
    made["extensionsUsed"].append(lights)
    return made, binary


def obj() -> Files:
    """Return an OBJ file with a concave polygon, a library and two textures."""
    text = (
        b"mtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.2 0 1 0 0\n"
        b"vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1\n"
        b"usemtl other\ns off\nf -5 -4 -3 -1\nf 1/1 2/2 3/3 4/1 5/2\n"
    )
    library = (
        b"newmtl m\nKd 0.5 0.25 1\nKe 1 2 3\nKs 0.1 0.1 0.1\nNs 20\nd 0.5\n"
        b"map_Kd -s 2 2 1 -o 0.5 0 0 color.png\nmap_d -clamp on alpha.png\nnewmtl other\nTr 0.5\n"
    )
    return {"a.obj": text, "a.mtl": library, "color.png": picture(), "alpha.png": picture(size=(4, 4), mode="L")}


def plys() -> list[Files]:
    """Return PLY files: text with colours, with a texture, binary both ways round."""
    head = (
        b"ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\n"
        b"property float y\nproperty float z\n"
    )
    faces = b"element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, row)).encode() for row in _SQUARE]
    colors = b"property uchar red\nproperty uchar green\nproperty uchar blue\n"
    uvs = b"property float s\nproperty float t\n"
    square = trimesh.Trimesh(_SQUARE, [[0, 1, 2], [0, 2, 3]], process=False)
    square.visual.vertex_colors = np.full((4, 4), 100, np.uint8)
    little = square.export(file_type="ply")
    big = struct.pack(">9f", *np.ravel(_SQUARE[:3])) + struct.pack(">B3i", 3, 0, 1, 2)
    big_head = head.replace(b"ascii", b"binary_big_endian").replace(b"vertex 4", b"vertex 3")
    return [
        {"a.ply": head + colors + faces + b"".join(r + b" 10 20 30\n" for r in rows) + _PLY_FACES},
        {"a.ply": head + uvs + faces + b"".join(r + b" 0 1\n" for r in rows) + _PLY_FACES, "t.png": picture()},
        {"a.ply": little},
        {"a.ply": big_head + faces.replace(b"face 2", b"face 1") + big},
    ]


def exrs() -> list[Files]:
    """Return OpenEXR files of every compression, in lines and in tiles, with and without depth."""
    kinds = ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"]
    ramp = np.linspace(0.5, 9.0, 20 * 12, dtype=np.float32).reshape(12, 20)
    made = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        for index, kind in enumerate(kinds):
            header: dict[str, Any] = {"compression": getattr(OpenEXR, f"{kind}_COMPRESSION")}
            header["type"] = OpenEXR.scanlineimage
            if index % 3 == 1:
                header["type"] = OpenEXR.tiledimage
                header["tiles"] = OpenEXR.TileDescription()
            planes = {"Z": ramp, "N.X": ramp, "N.Y": ramp.astype(np.float16), "N.Z": ramp}
            OpenEXR.File(header, planes).write(str(path))
            made.append({"a.exr": path.read_bytes()})
    return made


def gltfs() -> list[Files]:
    """Return glTF files: binary, with other kinds of images, and with files beside them."""
    made = [{"a.glb": glb(*document(picture(kind)))} for kind in ("PNG", "JPEG", "WEBP", "TIFF")]
    made.append({"a.glb": glb(*with_views(*document()))})
    parts, binary = document()
    parts["buffers"][0]["uri"] = "a.bin"
    parts["images"][0] = {"uri": "color.png"}
    made.append({"a.gltf": json.dumps(parts).encode(), "a.bin": binary, "color.png": picture()})
    sphere = trimesh.creation.icosphere(subdivisions=1)
    made.append({"a.glb": trimesh.Scene([sphere, sphere.copy()]).export(file_type="glb")})
    return [*made, draco()]


def draco() -> Files:
    """Return a .glb whose mesh is compressed; without DracoPy, it is refused for that."""
    try:
        import DracoPy
    except ImportError:
        return {"a.glb": glb(*document())}
    sphere = trimesh.creation.icosphere(subdivisions=1)
    packed = DracoPy.encode(np.asarray(sphere.vertices), np.asarray(sphere.faces, np.uint32))
    name = "KHR_draco_mesh_compression"
    accessors = [
        {"componentType": 5126, "type": "VEC3", "count": len(sphere.vertices)},
        {"componentType": 5125, "type": "SCALAR", "count": sphere.faces.size},
    ]
    extensions = {name: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": extensions}
    parts = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteLength": len(packed)}],
        "buffers": [{"byteLength": len(packed)}],
        "extensionsUsed": [name],
        "extensionsRequired": [name],
    }
    return {"a.glb": glb(parts, packed)}


def seeds() -> list[Files]:
    """Return sound files of every kind."""
    return [*gltfs(), obj(), *plys(), *exrs()]
