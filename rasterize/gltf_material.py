"""Materials and images of a glTF document, read from its JSON so that no bits are lost."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.errors import SceneError

from .scene import Material
from .textures import TextureSet, decode_image, mean_color, read_beside

Json = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfMaterial:
    """A material and how it lays its texture.

    Attributes:
        material: what `Scene` keeps.
        uv_set: which TEXCOORD_n the base colour texture uses.
        uv_matrix: [2, 3] of KHR_texture_transform, for glTF's coordinates (v runs down).
    """

    material: Material
    uv_set: int = 0
    uv_matrix: NDArray[np.float64] | None = None

    def laid_out(self, uvs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `uvs` [vertices, 2] as the file has them with v = 0 at the bottom row."""
        if self.uv_matrix is not None:
            uvs = uvs @ self.uv_matrix[:, :2].T + self.uv_matrix[:, 2]
        return np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


class GltfMaterials:
    """The materials of a document, read when first asked for.

    Attributes:
        in_order: those asked for, in that order.
    """

    def __init__(
        self, document: Json, views: list[bytes], folder: Path, textures: TextureSet
    ) -> None:
        self.in_order: list[Material] = []
        self._document = document
        self._views = views
        self._folder = folder
        self._textures = textures
        self._known: dict[int | None, tuple[int, GltfMaterial]] = {}
        self._images: dict[int, NDArray[np.uint8]] = {}

    def of(self, index: int | None) -> tuple[int, GltfMaterial]:
        """Return the place in `in_order` and the material of a primitive; None is grey."""
        if index not in self._known:
            material = GltfMaterial(material=Material()) if index is None else self._read(index)
            self._known[index] = len(self.in_order), material
            self.in_order.append(material.material)
        return self._known[index]

    def _read(self, index: int) -> GltfMaterial:
        source: Json = _entry(self._document, "materials", index)
        extensions: Json = source.get("extensions", {})
        glossy: Json | None = extensions.get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            factor = glossy.get("diffuseFactor", [1.0] * 4)
            laid: Json | None = glossy.get("diffuseTexture")
        else:
            metallic: Json = source.get("pbrMetallicRoughness", {})
            factor = metallic.get("baseColorFactor", [1.0] * 4)
            laid = metallic.get("baseColorTexture")
        color = _numbers(factor, 4, f"the base colour of material {index}").clip(0.0, 1.0)
        mode = source.get("alphaMode", "OPAQUE")
        cutoff = {"MASK": float(source.get("alphaCutoff", 0.5)), "BLEND": 0.5}.get(mode, 0.0)
        texture, uv_set, uv_matrix = -1, 0, None
        if laid is not None:
            texture = self._textures.add(self._image(laid["index"]))
            uv_set, uv_matrix = _layout(laid)
        return GltfMaterial(
            material=Material(
                name=str(source.get("name", "")),
                albedo=(float(color[0]), float(color[1]), float(color[2])),
                texture=texture,
                alpha_cutoff=min(max(cutoff, 0.0), 1.0),
                alpha=float(color[3]),
                emission=self._emission(source, index),
            ),
            uv_set=uv_set,
            uv_matrix=uv_matrix,
        )

    def _emission(self, source: Json, index: int) -> tuple[float, float, float]:
        """Return the radiance; an emissive texture counts with its mean, as emission is uniform."""
        strength = (
            source.get("extensions", {})
            .get("KHR_materials_emissive_strength", {})
            .get("emissiveStrength", 1.0)
        )
        factor = source.get("emissiveFactor", [0.0] * 3)
        emission = _numbers(factor, 3, f"the emission of material {index}") * float(strength)
        laid = source.get("emissiveTexture")
        if laid is not None and emission.any():
            emission = emission * mean_color(self._image(laid["index"]))
        red, green, blue = (float(value) for value in emission.clip(0.0, None))
        return red, green, blue

    def _image(self, texture: int) -> NDArray[np.uint8]:
        """Return the pixels of texture number `texture`."""
        entry: Json = _entry(self._document, "textures", texture)
        webp = entry.get("extensions", {}).get("EXT_texture_webp", {})
        index = webp.get("source", entry.get("source"))
        if index is None:
            raise SceneError(
                f"texture {texture} has no image in a supported format: {sorted(entry)}"
            )
        if index not in self._images:
            image: Json = _entry(self._document, "images", index)
            name = str(image.get("name", image.get("uri", "")))
            what = f"image {index} {name[:80]!r}"
            if "bufferView" in image:
                view = image["bufferView"]
                if not 0 <= view < len(self._views):
                    raise SceneError(f"{what} lies in buffer view {view}, which doesn't exist")
                data = self._views[view]
            else:
                data = read_uri(image["uri"], self._folder, f"the uri of {what}")
            self._images[index] = decode_image(data, what)
        return self._images[index]


def read_uri(uri: str, folder: Path, what: str) -> bytes:
    """Return what a data URI holds, or the contents of a file in `folder` or below."""
    if not uri.startswith("data:"):
        return read_beside(folder, unquote(uri), what)
    head, _, payload = uri.partition(",")
    return base64.b64decode(payload) if head.endswith(";base64") else unquote_to_bytes(payload)


def _layout(laid: Json) -> tuple[int, NDArray[np.float64] | None]:
    """Return the set of coordinates and the matrix of a textureInfo."""
    uv_set = laid.get("texCoord", 0)
    moved = laid.get("extensions", {}).get("KHR_texture_transform")
    if moved is None:
        return uv_set, None
    what = "KHR_texture_transform"
    scale = _numbers(moved.get("scale", [1.0] * 2), 2, what)
    offset = _numbers(moved.get("offset", [0.0] * 2), 2, what)
    angle = float(moved.get("rotation", 0.0))
    cosine, sine = math.cos(angle), math.sin(angle)
    matrix = np.array(
        [
            [cosine * scale[0], sine * scale[1], offset[0]],
            [-sine * scale[0], cosine * scale[1], offset[1]],
        ]
    )
    return moved.get("texCoord", uv_set), matrix


def _entry(document: Json, kind: str, index: Any) -> Any:
    items = document.get(kind, [])
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
        raise SceneError(f"{index!r} is not one of the {len(items)} {kind}")
    return items[index]


def _numbers(values: Any, count: int, what: str) -> NDArray[np.float64]:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise SceneError(f"{what} is {values!r}: expected {count} finite numbers")
    return numbers
