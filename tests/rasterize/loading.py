"""Scene files in the making, for the tests of their readers."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.files.load import load_scene

from ..faults.seeds import glb

# float32 positions within a few units of the origin.
POSITION = {"rtol": 0, "atol": 1e-6}
# Normals and colours go through a few float32 roundings.
ROUNDED = {"rtol": 0, "atol": 1e-6}


def written(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


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
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.json |= {"nodes": [{"mesh": 0}], "meshes": [{"primitives": []}]}
        self.json |= {"materials": [], "accessors": [], "bufferViews": []}

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
        kind = {"type": kinds[1 if array.ndim == 1 else array.shape[1]], "componentType": components[dtype]}
        self.json["accessors"].append({"bufferView": self.view(array.tobytes()), "count": len(array), **kind, **more})
        return len(self.json["accessors"]) - 1

    def triangle(self, x: float = 0.0, material: int | None = None, mesh: int = 0, **attributes: int) -> dict[str, Any]:
        positions = self.accessor([[x, 0, 0], [x + 1, 0, 0], [x, 1, 0]], "f4")
        primitive: dict[str, Any] = {"attributes": {"POSITION": positions, **attributes}}
        if material is not None:
            primitive["material"] = material
        self.json["meshes"][mesh]["primitives"].append(primitive)
        return primitive

    def material(self, factor: list[float] | None = None, rough: dict[str, Any] | None = None, **more: Any) -> int:
        inner = {} if factor is None else {"baseColorFactor": factor}
        self.json["materials"].append({"pbrMetallicRoughness": inner | (rough or {}), **more})
        return len(self.json["materials"]) - 1

    def lay(self, material: int, pixels: Any, **laid: Any) -> None:
        """Give a material a texture for its base colour."""
        self.json["images"] = [{"bufferView": self.view(png(pixels))}]
        self.json["textures"] = [{"source": 0}]
        self.json["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0, **laid}

    def bytes(self) -> bytes:
        self.json["buffers"] = [{"byteLength": len(self.binary)}]
        return glb(self.json, self.binary)

    def load(self, folder: Path) -> Scene:
        return load_scene(written(folder, "a.glb", self.bytes()))
