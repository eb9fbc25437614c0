"""glTF 2.0 (.glb, .gltf): trimesh decodes the meshes and walks the nodes, the rest is read here.

trimesh keeps 8 bits of a material's factors, fills what it can't decode with zeros, ignores that
an attribute is normalised and names meshes as it likes. So it gets a document that holds nothing
but checked geometry, where each primitive carries its own number as the name of its material and
its attributes under names that trimesh passes on untouched. Materials are read in gltf_material.
"""

from __future__ import annotations

import importlib.util
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ssgi_cl.errors import MissingExtraError, SceneError

from .gltf_material import GltfMaterials, Json, read_uri
from .parts import Part
from .scene import Material
from .textures import TextureSet

_DRACO = "KHR_draco_mesh_compression"
_UNDERSTOOD = (
    _DRACO, "KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual",
    "EXT_texture_webp",
)  # fmt: skip
"""Besides KHR_materials_*, whose base colour and emission are usable whatever else they add."""
_REFUSED = ("EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_mesh_gpu_instancing")

_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0, 5125: 4294967295.0}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_gltf(path: Path, textures: TextureSet) -> tuple[list[Part], list[Material]]:
    """Read a glTF file: every instance of every triangle mesh of its default scene.

    The albedo is the base colour, also of a metal (its reflection is as coloured, but not
    diffuse). Emission is emissiveFactor times KHR_materials_emissive_strength in W m^-2 sr^-1.
    Blended materials are cut out at one half. COLOR_0 is linear; its alpha is not used. Points,
    lines, cameras, lights, morph targets and skins are left out. Textures repeat.

    Raises:
        SceneError: damaged, or it needs something that would be lost: meshopt, GPU instancing,
            sparse accessors, triangle fans, an extension that is required and unknown.
        MissingExtraError: it is compressed with Draco and DracoPy is not installed.
    """
    document, binary = _read_document(path)
    _check_extensions(document)
    buffers = _read_buffers(document, binary, path.parent)
    views = _read_views(document, buffers)
    materials = GltfMaterials(document, views, path.parent, textures)
    geometry = _Geometry(document, views)
    scene = trimesh.load_scene(
        io.BytesIO(geometry.as_glb()), file_type="glb", process=False, validate=False
    )
    made = {
        name: geometry.part(mesh, materials, f"{path.name}: {name}")
        for name, mesh in scene.geometry.items()
        if isinstance(mesh, trimesh.Trimesh)
    }
    parts = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        if name in made:
            parts.append(made[name].transformed(np.asarray(matrix, dtype=np.float64)))
    return parts, materials.in_order


def _read_document(path: Path) -> tuple[Json, bytes | None]:
    """Return the JSON document and, for .glb, the binary chunk."""
    data = path.read_bytes()
    binary = None
    if data[:4] == b"glTF":
        if len(data) < 20:
            raise SceneError(f"{path} ends within the header of a .glb file")
        version, length, json_length, kind = struct.unpack_from("<4I", data, 4)
        if version != 2 or kind != 0x4E4F534A:
            raise SceneError(f"{path} is not glTF 2.0 (version {version})")
        if length > len(data) or 20 + json_length > len(data):
            raise SceneError(f"{path} is cut off: {len(data)} bytes of {length}")
        text = data[20 : 20 + json_length]
        start = 20 + json_length
        while binary is None and start + 8 <= len(data):
            size, kind = struct.unpack_from("<2I", data, start)
            if start + 8 + size > len(data):
                raise SceneError(f"{path} is cut off within its binary chunk")
            if kind == 0x004E4942:
                binary = data[start + 8 : start + 8 + size]
            start += 8 + size
    else:
        text = data
    try:
        document = json.loads(text)
    except ValueError as error:
        raise SceneError(f"{path} is not glTF: {error}") from None
    if not isinstance(document, dict) or "asset" not in document:
        raise SceneError(f"{path} is not glTF: there is no 'asset'")
    if not str(document["asset"].get("version", "")).startswith("2"):
        raise SceneError(f"{path} is glTF {document['asset'].get('version')}: expected 2.0")
    return document, binary


def _check_extensions(document: Json) -> None:
    used = {*document.get("extensionsUsed", []), *document.get("extensionsRequired", [])}
    for holder in (*document.get("bufferViews", []), *document.get("nodes", [])):
        used |= set(holder.get("extensions", {}))
    for name in _REFUSED:
        if name in used:
            raise SceneError(f"the file uses {name}, which is not supported: export it without")
    for name in document.get("extensionsRequired", []):
        if name not in _UNDERSTOOD and not name.startswith("KHR_materials_"):
            raise SceneError(f"the file requires {name}, which is not supported")


def _read_buffers(document: Json, binary: bytes | None, folder: Path) -> list[bytes]:
    buffers = []
    for index, buffer in enumerate(document.get("buffers", [])):
        uri = buffer.get("uri")
        if uri is None:
            data = binary if index == 0 else None
            if data is None:
                raise SceneError(f"buffer {index} has neither a uri nor a binary chunk")
        else:
            data = read_uri(uri, folder, f"the uri of buffer {index}")
        if len(data) < buffer["byteLength"]:
            raise SceneError(
                f"buffer {index} has {len(data)} bytes: expected {buffer['byteLength']}"
            )
        buffers.append(data)
    return buffers


def _read_views(document: Json, buffers: list[bytes]) -> list[bytes]:
    views = []
    for index, view in enumerate(document.get("bufferViews", [])):
        start, length = view.get("byteOffset", 0), view["byteLength"]
        buffer = _item(buffers, view["buffer"], f"the buffer of view {index}")
        if not 0 <= start <= start + length <= len(buffer):
            raise SceneError(
                f"buffer view {index} covers bytes {start} to {start + length} of {len(buffer)}"
            )
        views.append(buffer[start : start + length])
    return views


def _item(items: list[Any], index: Any, what: str) -> Any:
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
        raise SceneError(f"{what} is {index!r}: expected a number from 0 to {len(items) - 1}")
    return items[index]


class _Geometry:
    """The geometry of a document, checked, as a document of its own.

    Each attribute but POSITION goes under a name of ours (`_NORMAL`, `_UV0`, `_COLOR`), which
    trimesh hands on as it lies in the file.
    """

    def __init__(self, document: Json, views: list[bytes]) -> None:
        self._document = document
        self._views = views
        self._primitives: list[Json] = []
        self._accessors: list[Json] = []
        self._buffer_views: list[Json] = []
        self._binary = bytearray()
        self._view_of: dict[tuple[int, int], int] = {}
        meshes = [self._mesh(mesh) for mesh in document.get("meshes", [])]
        self._meshes = meshes
        self._nodes, self._roots = self._node_tree([bool(m["primitives"]) for m in meshes])

    def as_glb(self) -> bytes:
        """Return the document as a .glb file."""
        document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": self._roots}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "accessors": self._accessors,
            "bufferViews": self._buffer_views,
            "buffers": [{"byteLength": len(self._binary)}],
            "materials": [{"name": str(i)} for i in range(len(self._primitives))],
        }
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + 8 + len(self._binary)
        head = struct.pack("<4s3I4s", b"glTF", 2, length, len(text), b"JSON")
        middle = struct.pack("<I4s", len(self._binary), b"BIN\0")
        return b"".join([head, text, middle, self._binary])

    def part(self, mesh: trimesh.Trimesh, materials: GltfMaterials, name: str) -> Part:
        """Return what trimesh made of a primitive, with the material that the file gives it."""
        visual: Any = mesh.visual
        primitive = self._primitives[int(visual.material.name)]
        index, material = materials.of(primitive.get("material"))
        attributes: Json = primitive["attributes"]
        data: dict[str, Any] = dict(mesh.vertex_attributes)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
        normals = self._optional(attributes, "NORMAL", data.get("_NORMAL"))
        colors = self._optional(attributes, "COLOR_0", data.get("_COLOR"))
        key = f"TEXCOORD_{material.uv_set}"
        uvs = self._optional(attributes, key, data.get(f"_UV{material.uv_set}"))
        return Part(
            name=name,
            positions=self._floats(attributes, "POSITION", np.asarray(mesh.vertices)),
            triangles=triangles,
            material_ids=np.full(len(triangles), index),
            normals=normals,
            uvs=None if uvs is None else material.laid_out(uvs),
            colors=None if colors is None else np.clip(colors[:, :3], 0.0, None),
        )

    def _optional(
        self, attributes: Json, key: str, values: NDArray[Any] | None
    ) -> NDArray[np.float64] | None:
        return None if values is None else self._floats(attributes, key, values)

    def _floats(self, attributes: Json, key: str, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return `values` of an attribute as numbers; normalised integers come to [-1, 1]."""
        accessor = self._document["accessors"][attributes[key]]
        numbers = np.asarray(values, dtype=np.float64)
        if accessor.get("normalized"):
            numbers = np.maximum(numbers / _LARGEST[accessor["componentType"]], -1.0)
        return numbers

    def _mesh(self, mesh: Json) -> Json:
        primitives = []
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode == _FAN:
                raise SceneError("the file holds triangle fans: export it as triangles")
            if mode not in (_TRIANGLES, _STRIP) or "POSITION" not in primitive["attributes"]:
                continue
            primitives.append(self._primitive(primitive, mode))
        return {"primitives": primitives}

    def _primitive(self, primitive: Json, mode: int) -> Json:
        draco = primitive.get("extensions", {}).get(_DRACO)
        if draco is not None and importlib.util.find_spec("DracoPy") is None:
            raise MissingExtraError(
                "the file is compressed with Draco: pip install 'ssgi-cl[draco]' to read it"
            )
        names = {"POSITION": "POSITION", "NORMAL": "_NORMAL", "COLOR_0": "_COLOR"}
        names |= {f"TEXCOORD_{i}": f"_UV{i}" for i in range(8)}
        kept = {key: name for key, name in names.items() if key in primitive["attributes"]}
        result: Json = {"mode": mode, "material": len(self._primitives)}
        result["attributes"] = {
            name: self._accessor(primitive["attributes"][key], draco is not None)
            for key, name in kept.items()
        }
        if "indices" in primitive:
            result["indices"] = self._accessor(primitive["indices"], draco is not None)
        if draco is not None:
            packed = {
                kept[key]: number for key, number in draco["attributes"].items() if key in kept
            }
            view = self._view(draco["bufferView"], 0)
            result["extensions"] = {_DRACO: {"bufferView": view, "attributes": packed}}
        self._primitives.append(primitive)
        return result

    def _accessor(self, index: Any, packed: bool) -> int:
        """Copy an accessor, with the bytes it reads, and return its number."""
        accessor = _item(self._document.get("accessors", []), index, "an accessor")
        kind, component = accessor["type"], accessor["componentType"]
        count, start = accessor["count"], accessor.get("byteOffset", 0)
        if kind not in _WIDTHS or component not in _BYTES or count < 0 or start < 0:
            raise SceneError(f"accessor {index} is {accessor}: not one that glTF allows")
        copy = {"type": kind, "componentType": component, "count": count}
        if packed:
            copy["count"] = 0  # replaced by what the compressed data holds
        elif "sparse" in accessor:
            raise SceneError(f"accessor {index} is sparse, which is not supported")
        elif "bufferView" not in accessor:
            raise SceneError(f"accessor {index} has no buffer view")
        else:
            view = _item(self._document["bufferViews"], accessor["bufferView"], "a buffer view")
            row = _BYTES[component] * _WIDTHS[kind]
            stride = view.get("byteStride", row)
            available = len(self._views[accessor["bufferView"]])
            if stride < row or (count and start + (count - 1) * stride + row > available):
                raise SceneError(
                    f"accessor {index} reads {count} items of {row} bytes, {stride} apart, from "
                    f"byte {start} of a view of {available} bytes"
                )
            copy["byteOffset"] = start
            copy["bufferView"] = self._view(
                accessor["bufferView"], stride if "byteStride" in view else 0
            )
        self._accessors.append(copy)
        return len(self._accessors) - 1

    def _view(self, index: int, stride: int) -> int:
        key = (index, stride)
        if key not in self._view_of:
            data = _item(self._views, index, "a buffer view")
            view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
            if stride:
                view["byteStride"] = stride
            self._binary += data + bytes(-len(data) % 4)
            self._view_of[key] = len(self._buffer_views)
            self._buffer_views.append(view)
        return self._view_of[key]

    def _node_tree(self, has_triangles: list[bool]) -> tuple[list[Json], list[int]]:
        """Return the nodes with nothing but transforms, children and meshes; and the roots."""
        given = self._document.get("nodes", [])
        parents = np.zeros(len(given), dtype=np.int64)
        nodes = []
        for node in given:
            copy = {
                key: node[key]
                for key in ("matrix", "translation", "rotation", "scale", "children")
                if key in node
            }
            for child in copy.get("children", []):
                _item(given, child, "a child of a node")
                parents[child] += 1
            if "mesh" in node and _item(has_triangles, node["mesh"], "the mesh of a node"):
                copy["mesh"] = node["mesh"]
            nodes.append(copy)
        if "scenes" in self._document:
            scene = _item(self._document["scenes"], self._document.get("scene", 0), "the scene")
            roots = scene.get("nodes", [])
        else:
            roots = [int(i) for i in np.flatnonzero(parents == 0)]
        for root in roots:
            _item(given, root, "a node of the scene")
            parents[root] += 1
        if (parents > 1).any() or len(set(roots)) != len(roots):
            node = int(np.argmax(parents > 1))
            raise SceneError(f"node {node} hangs in several places: expected a tree of nodes")
        return nodes, roots
