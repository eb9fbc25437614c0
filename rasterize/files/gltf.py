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

from ssgi_cl.core.errors import MissingExtraError, SceneError
from ssgi_cl.rasterize.files.gltf_accessors import INDEX_TYPES, Accessors, as_floats
from ssgi_cl.rasterize.files.gltf_document import item, read_document
from ssgi_cl.rasterize.files.gltf_material import GltfMaterials
from ssgi_cl.rasterize.files.gltf_nodes import placed_meshes, placed_nodes
from ssgi_cl.rasterize.files.gltf_notes import notes_of
from ssgi_cl.rasterize.files.gltf_schema import DRACO, Json
from ssgi_cl.rasterize.files.gltf_skin import joint_matrices, posed
from ssgi_cl.rasterize.files.gltf_view import cameras_of, lights_of
from ssgi_cl.rasterize.files.textures import TextureSet
from ssgi_cl.rasterize.files.vertex_alpha import with_vertex_alpha
from ssgi_cl.rasterize.parts import MOST_TRIANGLES, Contents, Part, check_triangles

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_ATTRIBUTES = {
    "POSITION": ("POSITION", ("VEC3",)),
    "NORMAL": ("_NORMAL", ("VEC3",)),
    "COLOR_0": ("_COLOR", ("VEC3", "VEC4")),
    **{f"TEXCOORD_{i}": (f"_UV{i}", ("VEC2",)) for i in range(8)},
    "JOINTS_0": ("_JOINTS", ("VEC4",)),
    "WEIGHTS_0": ("_WEIGHTS", ("VEC4",)),
}
"""Attributes that are read: the name that trimesh gets, and the types that each may have."""

_MOST_PARTS = 250_000
_MOST_BYTES = 1 << 32
"""Of all buffer views in use; views may overlap, so that a small file can ask for far more."""


def read(path: Path, textures: TextureSet) -> Contents:
    """Read a glTF file: every instance of every triangle mesh of its default scene, and its view.

    The albedo is the base colour, also of a metal (its reflection is as coloured, but not
    diffuse). Emission is emissiveFactor times KHR_materials_emissive_strength in W m^-2 sr^-1.
    Blended materials are cut out at one half. COLOR_0 is linear; its alpha is not used. Skins are
    applied in the pose in which nodes stand. Points, lines and morph targets are left out, as is
    what is not visible (KHR_node_visibility). Textures repeat. Lights and cameras are read as
    gltf_view says. The contents' notes name what of the file is not drawn.

    Raises:
        SceneError: damaged, or it needs something that would be lost: meshopt, GPU instancing, an
            extension that is required and unknown.
        MissingExtraError: it is compressed with Draco and DracoPy is not installed.
    """
    document, views = read_document(path)
    nodes = placed_nodes(document)
    matrices, placed = dict(nodes), placed_meshes(document, nodes)
    materials = GltfMaterials(document, views, path.parent, textures)
    geometry = _Geometry(document, views)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused later
        scene = trimesh.load_scene(io.BytesIO(geometry.as_glb()), file_type="glb", process=False, validate=False)
    made = {}
    for name, mesh in scene.geometry.items():
        if isinstance(mesh, trimesh.Trimesh):
            number = geometry.number_of(mesh)
            made[number] = geometry.part(number, mesh, materials, f"{path.name}: {name}")
    nodes_of, meshes_of = document.get("nodes", []), geometry.numbers
    parts_of = [[number for number in numbers if number in made] for numbers in meshes_of]
    triangles_of = [sum(len(made[number].triangles) for number in numbers) for numbers in parts_of]
    # Before they are made: a small file can place much in many places.
    check_triangles(sum(triangles_of[nodes_of[node]["mesh"]] for node, _ in placed))
    if sum(len(parts_of[nodes_of[node]["mesh"]]) for node, _ in placed) > _MOST_PARTS:
        raise SceneError(f"the file has more than {_MOST_PARTS} primitives with all instances")
    parts = []
    for node, matrix in placed:
        joints = None
        if "skin" in nodes_of[node]:
            joints = joint_matrices(document, nodes_of[node]["skin"], matrices, geometry.accessors)
        for number in parts_of[nodes_of[node]["mesh"]]:
            weights = geometry.weights.get(number)
            if joints is None or weights is None:
                parts.append(made[number].transformed(matrix))
            else:
                parts.append(posed(made[number], joints, *weights))
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
        accessors: of the document.
        numbers: for each mesh of the document, the numbers of its primitives.
        weights: joints and their weights, [vertices, 4] each, by the number of a primitive that has both.
    """

    def __init__(self, document: Json, views: list[memoryview]) -> None:
        self._document, self._views = document, views
        self.accessors = Accessors(document, views)
        self.weights: dict[int, tuple[NDArray[np.int64], NDArray[np.float64]]] = {}
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
        if {"JOINTS_0", "WEIGHTS_0"} <= attributes.keys():
            joints = np.asarray(data[_ATTRIBUTES["JOINTS_0"][0]], np.int64)
            self.weights[number] = joints, self._floats(attributes, "WEIGHTS_0", data[_ATTRIBUTES["WEIGHTS_0"][0]])
        normals, colors, uvs = (None if v is None else self._floats(attributes, key, v) for key, v in given)
        part = Part(
            name=name,
            positions=self._floats(attributes, "POSITION", np.asarray(mesh.vertices)),
            triangles=triangles,
            material_ids=np.full(len(triangles), index),
            normals=normals,
            uvs=None if uvs is None else material.laid_out(uvs),
            colors=None if colors is None else np.clip(colors[:, :3], 0.0, None),
        )
        if colors is None or colors.shape[1] < 4 or material.mode == "OPAQUE":
            return part
        blends = material.mode == "BLEND"
        return with_vertex_alpha(part, colors[:, 3], materials.in_order, materials.textures, blends=blends)

    def _floats(self, attributes: Json, key: str, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return `values` of an attribute as numbers; normalised integers come to [-1, 1]."""
        return as_floats(self._document["accessors"][attributes[key]], values)

    def _mesh(self, mesh: Json) -> Json:
        primitives = []
        first = len(self._primitives)
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in primitive["attributes"]:
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
        result: Json = {"mode": _TRIANGLES if mode == _FAN else mode, "material": len(self._primitives)}
        result["attributes"] = {
            name: self._accessor(given[key], _ATTRIBUTES[key][1], draco is not None) for key, name in kept.items()
        }
        corners = given["POSITION"]
        if "indices" in primitive:
            corners = primitive["indices"]
            result["indices"] = self._accessor(corners, ("SCALAR",), draco is not None)
            if self._document["accessors"][corners]["componentType"] not in INDEX_TYPES:
                raise SceneError(f"accessor {corners} holds indices: expected unsigned integers")
        count = self._document["accessors"][corners]["count"]
        if mode == _TRIANGLES and count % 3:
            raise SceneError(f"accessor {corners} has {count} corners: expected three a triangle")
        if mode == _FAN:
            result["indices"] = self._fan(primitive, count)
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
        accessor = self.accessors.checked(index, kinds)
        copy = {name: accessor[name] for name in ("type", "componentType", "count")}
        if packed:
            copy["count"] = 0  # replaced by what the compressed data holds
        elif self.accessors.is_plain(index):
            copy["byteOffset"], stride = self.accessors.bounds(index)
            view = self._document["bufferViews"][accessor["bufferView"]]
            copy["bufferView"] = self._view(accessor["bufferView"], stride if "byteStride" in view else 0)
        else:
            copy["bufferView"] = self._added(self.accessors.read(index, kinds).tobytes())
        self._accessors.append(copy)
        return len(self._accessors) - 1

    def _fan(self, primitive: Json, count: int) -> int:
        """Return the accessor of the triangles of a fan of `count` corners."""
        if count > MOST_TRIANGLES:
            raise SceneError(f"a triangle fan has {count} corners: expected at most {MOST_TRIANGLES}")
        corners = np.arange(count, dtype=np.uint32)
        if "indices" in primitive:
            corners = self.accessors.read(primitive["indices"], ("SCALAR",))[:, 0].astype(np.uint32)
        triangles = np.stack([np.broadcast_to(corners[:1], max(count - 2, 0)), corners[1:-1], corners[2:]], axis=1)
        accessor = {"type": "SCALAR", "componentType": 5125, "count": triangles.size}
        self._accessors.append({**accessor, "bufferView": self._added(triangles.astype("<u4").tobytes())})
        return len(self._accessors) - 1

    def _added(self, data: bytes | memoryview, stride: int = 0) -> int:
        """Return the number of a new buffer view of these bytes."""
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if stride:
            view["byteStride"] = stride
        self._binary += data
        self._binary += bytes(-len(data) % 4)
        if len(self._binary) > _MOST_BYTES:
            raise SceneError(f"the buffer views cover more than {_MOST_BYTES} bytes in all")
        self._buffer_views.append(view)
        return len(self._buffer_views) - 1

    def _view(self, index: int, stride: int) -> int:
        key = (index, stride)
        if key not in self._view_of:
            data = item(self._views, index, "a buffer view")
            self._view_of[key] = self._added(data, stride)
        return self._view_of[key]
