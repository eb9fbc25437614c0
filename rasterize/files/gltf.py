"""glTF 2.0 (.glb, .gltf): trimesh decodes the meshes, the rest is read here.

trimesh keeps 8 bits of a material's factors, fills what it can't decode with zeros, ignores that
an attribute is normalised and names meshes as it likes. So it gets a document that holds nothing
but checked geometry, where each primitive carries its own number as the name of its material and
its attributes under names that trimesh passes on untouched. The document is read in gltf_document,
nodes in gltf_nodes, materials in gltf_material.
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

from ssgi_cl.core.errors import MissingExtraError, SceneError, shown
from ssgi_cl.rasterize.files.gltf_document import item, read_document
from ssgi_cl.rasterize.files.gltf_material import GltfMaterials
from ssgi_cl.rasterize.files.gltf_nodes import placed_meshes, placed_nodes
from ssgi_cl.rasterize.files.gltf_notes import notes_of
from ssgi_cl.rasterize.files.gltf_schema import DRACO, Json
from ssgi_cl.rasterize.files.gltf_view import cameras_of, lights_of
from ssgi_cl.rasterize.files.textures import TextureSet
from ssgi_cl.rasterize.parts import MOST_TRIANGLES, Contents, Part, check_triangles

_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0, 5125: 4294967295.0}
_INDEX_TYPES = (5121, 5123, 5125)
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_ATTRIBUTES = {
    "POSITION": ("POSITION", ("VEC3",)),
    "NORMAL": ("_NORMAL", ("VEC3",)),
    "COLOR_0": ("_COLOR", ("VEC3", "VEC4")),
    **{f"TEXCOORD_{i}": (f"_UV{i}", ("VEC2",)) for i in range(8)},
}
"""Attributes that are read: the name that trimesh gets, and the types that each may have."""

_MOST_PARTS = 250_000
_MOST_BYTES = 1 << 32
"""Of all buffer views in use; views may overlap, so that a small file can ask for far more."""


def read(path: Path, textures: TextureSet) -> Contents:
    """Read a glTF file: every instance of every triangle mesh of its default scene, and its view.

    The albedo is the base colour, also of a metal (its reflection is as coloured, but not
    diffuse). Emission is emissiveFactor times KHR_materials_emissive_strength in W m^-2 sr^-1.
    Blended materials are cut out at one half. COLOR_0 is linear; its alpha is not used. Points,
    lines, morph targets and skins are left out. Textures repeat. Lights and cameras are read as
    gltf_view says. The contents' notes name what of the file is not drawn.

    Raises:
        SceneError: damaged, or it needs something that would be lost: meshopt, GPU instancing,
            sparse accessors, triangle fans, an extension that is required and unknown.
        MissingExtraError: it is compressed with Draco and DracoPy is not installed.
    """
    document, views = read_document(path)
    nodes = placed_nodes(document)
    placed = placed_meshes(document, nodes)
    materials = GltfMaterials(document, views, path.parent, textures)
    geometry = _Geometry(document, views)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused later
        scene = trimesh.load_scene(io.BytesIO(geometry.as_glb()), file_type="glb", process=False, validate=False)
    made = {}
    for name, mesh in scene.geometry.items():
        if isinstance(mesh, trimesh.Trimesh):
            number = geometry.number_of(mesh)
            made[number] = geometry.part(number, mesh, materials, f"{path.name}: {name}")
    parts_of = [[made[n] for n in numbers if n in made] for numbers in geometry.numbers]
    triangles_of = [sum(len(part.triangles) for part in parts) for parts in parts_of]
    # Before they are made: a small file can place much in many places.
    check_triangles(sum(triangles_of[mesh] for mesh, _ in placed))
    if sum(len(parts_of[mesh]) for mesh, _ in placed) > _MOST_PARTS:
        raise SceneError(f"the file has more than {_MOST_PARTS} primitives with all instances")
    parts = [part.transformed(matrix) for mesh, matrix in placed for part in parts_of[mesh]]
    notes: list[str] = []
    nodes.sort(key=lambda node: node[0])  # in the file's order
    lights, cameras = lights_of(document, nodes, notes), cameras_of(document, nodes, notes)
    notes += notes_of(document, materials.numbers)
    return Contents(parts, materials.in_order, lights, cameras, tuple(notes))


class _Geometry:
    """The geometry of a document, checked, as a document of its own.

    Each attribute but POSITION goes under a name of ours (`_NORMAL`, _UV with a number, `_COLOR`), which
    trimesh hands on as it lies in the file.

    Attributes:
        numbers: for each mesh of the document, the numbers of its primitives.
    """

    def __init__(self, document: Json, views: list[memoryview]) -> None:
        self._document, self._views = document, views
        self._primitives: list[Json] = []
        self._accessors: list[Json] = []
        self._buffer_views: list[Json] = []
        self._binary = bytearray()
        self._view_of: dict[tuple[int, int], int] = {}
        self._vertices = 0
        self.numbers: list[list[int]] = []
        self._meshes = [self._mesh(mesh) for mesh in document.get("meshes", [])]

    def as_glb(self) -> bytes:
        """Return the document as a .glb file in which every mesh stands once."""
        drawn = [mesh for mesh in self._meshes if mesh["primitives"]]
        document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(drawn)))}],
            "nodes": [{"mesh": number} for number in range(len(drawn))],
            "meshes": drawn,
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

    def number_of(self, mesh: trimesh.Trimesh) -> int:
        """Return the number of the primitive that trimesh made `mesh` of."""
        visual: Any = mesh.visual
        return int(visual.material.name)

    def part(self, number: int, mesh: trimesh.Trimesh, materials: GltfMaterials, name: str) -> Part:
        """Return what trimesh made of a primitive, with the material that the file gives it."""
        primitive = self._primitives[number]
        index, material = materials.of(primitive.get("material"))
        attributes: Json = primitive["attributes"]
        data: dict[str, Any] = dict(mesh.vertex_attributes)
        triangles = np.asarray(mesh.faces, dtype=np.int64)
        keys = "NORMAL", "COLOR_0", f"TEXCOORD_{material.uv_set}"
        given = ((key, data.get(_ATTRIBUTES[key][0]) if key in _ATTRIBUTES else None) for key in keys)
        normals, colors, uvs = (None if v is None else self._floats(attributes, key, v) for key, v in given)
        return Part(
            name=name,
            positions=self._floats(attributes, "POSITION", np.asarray(mesh.vertices)),
            triangles=triangles,
            material_ids=np.full(len(triangles), index),
            normals=normals,
            uvs=None if uvs is None else material.laid_out(uvs),
            colors=None if colors is None else np.clip(colors[:, :3], 0.0, None),
        )

    def _floats(self, attributes: Json, key: str, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return `values` of an attribute as numbers; normalised integers come to [-1, 1]."""
        accessor = self._document["accessors"][attributes[key]]
        with np.errstate(invalid="ignore"):  # a signalling NaN, which is refused later
            numbers = np.asarray(values, dtype=np.float64)
        if accessor.get("normalized"):
            numbers = np.maximum(numbers / _LARGEST[accessor["componentType"]], -1.0)
        return numbers

    def _mesh(self, mesh: Json) -> Json:
        primitives = []
        first = len(self._primitives)
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode == _FAN:
                raise SceneError("the file holds triangle fans: export it as triangles")
            if mode not in (_TRIANGLES, _STRIP) or "POSITION" not in primitive["attributes"]:
                continue
            primitives.append(self._primitive(primitive, mode))
        self.numbers.append(list(range(first, len(self._primitives))))
        return {"primitives": primitives}

    def _primitive(self, primitive: Json, mode: int) -> Json:
        draco = primitive.get("extensions", {}).get(DRACO)
        if draco is not None and importlib.util.find_spec("DracoPy") is None:
            raise MissingExtraError("the file is compressed with Draco: pip install 'ssgi-cl[draco]' to read it")
        given = primitive["attributes"]
        kept = {key: name for key, (name, _) in _ATTRIBUTES.items() if key in given}
        result: Json = {"mode": mode, "material": len(self._primitives)}
        result["attributes"] = {
            name: self._accessor(given[key], _ATTRIBUTES[key][1], draco is not None) for key, name in kept.items()
        }
        corners = given["POSITION"]
        if "indices" in primitive:
            corners = primitive["indices"]
            result["indices"] = self._accessor(corners, ("SCALAR",), draco is not None)
            if self._document["accessors"][corners]["componentType"] not in _INDEX_TYPES:
                raise SceneError(f"accessor {corners} holds indices: expected unsigned integers")
        count = self._document["accessors"][corners]["count"]
        if mode == _TRIANGLES and count % 3:
            raise SceneError(f"accessor {corners} has {count} corners: expected three a triangle")
        # Many primitives may share one accessor, but each gets vertices of its own.
        self._vertices += self._document["accessors"][given["POSITION"]]["count"]
        if self._vertices > MOST_TRIANGLES:
            raise SceneError(f"the primitives have more than {MOST_TRIANGLES} vertices in all")
        if draco is not None:
            packed = {kept[key]: number for key, number in draco["attributes"].items() if key in kept}
            view = self._view(draco["bufferView"], 0)
            result["extensions"] = {DRACO: {"bufferView": view, "attributes": packed}}
        self._primitives.append(primitive)
        return result

    def _accessor(self, index: int, kinds: tuple[str, ...], packed: bool) -> int:
        """Copy an accessor, with the bytes it reads, and return its number."""
        accessor = item(self._document.get("accessors", []), index, "an accessor")
        kind, component = accessor["type"], accessor["componentType"]
        count, start = accessor["count"], accessor.get("byteOffset", 0)
        if kind not in kinds or component not in _BYTES:
            raise SceneError(
                f"accessor {index} is {shown(kind)} of component type {component}: expected "
                f"{' or '.join(kinds)} of one that glTF has"
            )
        copy = {"type": kind, "componentType": component, "count": count}
        if packed:
            copy["count"] = 0  # replaced by what the compressed data holds
        elif "sparse" in accessor:
            raise SceneError(f"accessor {index} is sparse, which is not supported")
        elif "bufferView" not in accessor:
            raise SceneError(f"accessor {index} has no buffer view")
        else:
            item(self._views, accessor["bufferView"], f"the buffer view of accessor {index}")
            view = self._document["bufferViews"][accessor["bufferView"]]
            row = _BYTES[component] * _WIDTHS[kind]
            stride = view.get("byteStride", row)
            available = len(self._views[accessor["bufferView"]])
            if stride < row or (count and start + (count - 1) * stride + row > available):
                raise SceneError(
                    f"accessor {index} reads {count} items of {row} bytes, {stride} apart, from "
                    f"byte {start} of a view of {available} bytes"
                )
            copy["byteOffset"] = start
            copy["bufferView"] = self._view(accessor["bufferView"], stride if "byteStride" in view else 0)
        self._accessors.append(copy)
        return len(self._accessors) - 1

    def _view(self, index: int, stride: int) -> int:
        key = (index, stride)
        if key not in self._view_of:
            data = item(self._views, index, "a buffer view")
            view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
            if stride:
                view["byteStride"] = stride
            self._binary += data
            self._binary += bytes(-len(data) % 4)
            if len(self._binary) > _MOST_BYTES:
                raise SceneError(f"the buffer views cover more than {_MOST_BYTES} bytes in all")
            self._view_of[key] = len(self._buffer_views)
            self._buffer_views.append(view)
        return self._view_of[key]
