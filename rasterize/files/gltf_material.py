"""Materials and images of a glTF document, read from its JSON so that no bits are lost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.checks import MOST_LIGHT
from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Material, Wrap
from ssgi_cl.core.srgb import mean_color
from ssgi_cl.rasterize.files.gltf_document import item
from ssgi_cl.rasterize.files.gltf_schema import KTX2, Json
from ssgi_cl.rasterize.files.metal_rough import Lobe, metal_rough_lobe, rough_lobe
from ssgi_cl.rasterize.files.textures import TextureSet, lets_through, read_uri

_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
"""Constants of OpenGL that samplers have (glTF 2.0, 5.26)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfMaterial:
    """A material and how it lays its texture.

    Attributes:
        material: what `Scene` keeps.
        uv_set: which TEXCOORD_n the base colour texture uses.
        uv_matrix: [2, 3] of KHR_texture_transform, for glTF's coordinates (v runs down).
        mode: the file's alphaMode.
    """

    material: Material
    uv_set: int = 0
    uv_matrix: NDArray[np.float64] | None = None
    mode: str = "OPAQUE"

    def laid_out(self, uvs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `uvs` [vertices, 2] as the file has them with v = 0 at the bottom row."""
        if self.uv_matrix is not None:
            uvs = uvs @ self.uv_matrix[:, :2].T + self.uv_matrix[:, 2]
        return np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)


class GltfMaterials:
    """The materials of a document, read when first asked for.

    Attributes:
        in_order: those asked for, in that order, and further ones of their parts.
        textures: of all.
    """

    def __init__(self, document: Json, views: list[memoryview], folder: Path, textures: TextureSet) -> None:
        self.in_order: list[Material] = []
        self._document, self._views, self._folder, self.textures = document, views, folder, textures
        self._known: dict[int | None, tuple[int, GltfMaterial]] = {}
        self._images: dict[int, NDArray[np.uint8] | None] = {}

    @property
    def numbers(self) -> list[int]:
        """Numbers of the document's materials that were asked for."""
        return [index for index in self._known if index is not None]

    def of(self, index: int | None) -> tuple[int, GltfMaterial]:
        """Return the place in `in_order` and the material of a primitive; None is grey."""
        if index not in self._known:
            material = GltfMaterial(material=Material()) if index is None else self._read(index)
            self._known[index] = len(self.in_order), material
            self.in_order.append(material.material)
        return self._known[index]

    def _read(self, index: int) -> GltfMaterial:
        source: Json = item(self._document.get("materials", []), index, "the number of a material")
        extensions: Json = source.get("extensions", {})
        glossy: Json | None = extensions.get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            factor = glossy.get("diffuseFactor", [1.0] * 4)
            laid: Json | None = glossy.get("diffuseTexture")
        else:
            metallic: Json = source.get("pbrMetallicRoughness", {})
            factor = metallic.get("baseColorFactor", [1.0] * 4)
            laid = metallic.get("baseColorTexture")
        color = np.clip(factor, 0.0, 1.0)
        mode = source.get("alphaMode", "OPAQUE")
        cutoff = {"MASK": float(source.get("alphaCutoff", 0.5)), "BLEND": 0.5}.get(mode, 0.0)
        texture, uv_set, uv_matrix, image, base = -1, 0, None, None, color[:3]
        if laid is not None and (image := self._image(laid["index"])) is not None:
            texture, base = self.textures.add(image, self._wrap(laid["index"])), base * mean_color(image)
            uv_set, uv_matrix = _layout(laid)
        lobe = self._lobe(source, base)
        through = self._through(source)
        emission, glow = self._emission(source, index)
        glow_texture = -1
        if glow is not None:
            own = _layout(source["emissiveTexture"])
            if image is None:
                uv_set, uv_matrix = own
            if _same_layout(own, (uv_set, uv_matrix)):
                glow_texture = self.textures.add(glow, self._wrap(source["emissiveTexture"]["index"]))
            else:
                red, green, blue = (np.array(emission) * mean_color(glow)).tolist()
                emission = red, green, blue
                name = shown(source.get("name") or f"material {index}")
                self.textures.note(
                    f"{name}: its emissive texture is laid otherwise than its base colour, and counts with its mean"
                )
        matt = lobe.matt * (1.0 - through)
        passed = (lobe.matt * through * base).tolist()
        return GltfMaterial(
            material=Material(
                name=str(source.get("name", "")),
                specular=lobe.specular,
                gloss=lobe.gloss,
                albedo=(matt * float(color[0]), matt * float(color[1]), matt * float(color[2])),
                texture=texture,
                alpha_cutoff=min(max(cutoff, 0.0), 1.0),
                alpha=float(color[3]),
                blends=mode == "BLEND" and lets_through(float(color[3]), image),
                transmission=(passed[0], passed[1], passed[2]),
                emission=emission,
                emission_texture=glow_texture,
                double_sided=bool(source.get("doubleSided", False)),
            ),
            uv_set=uv_set,
            uv_matrix=uv_matrix,
            mode=str(mode),
        )

    def _wrap(self, texture: int) -> Wrap:
        """Return what the sampler of a texture says of coordinates beyond [0, 1]; it repeats where nothing is said."""
        number = self._document["textures"][texture].get("sampler")
        if number is None:
            return _WRAPS[10497], _WRAPS[10497]
        sampler: Json = item(self._document.get("samplers", []), number, f"the sampler of texture {texture}")
        kinds = [sampler.get(name, 10497) for name in ("wrapS", "wrapT")]
        for kind in kinds:
            if kind not in _WRAPS:
                raise SceneError(f"sampler {number} wraps by {kind!r}: expected one of {', '.join(map(str, _WRAPS))}")
        return _WRAPS[kinds[0]], _WRAPS[kinds[1]]

    def _lobe(self, source: Json, base: NDArray[np.float64]) -> Lobe:
        """Return what a material mirrors; textures of metal and roughness count with their mean.

        `base` is the base colour, the mean of its texture.
        """
        glossy = source.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            reflectance = np.array(glossy.get("specularFactor", [1.0] * 3), dtype=np.float64)
            return rough_lobe(reflectance, base, 1.0 - float(glossy.get("glossinessFactor", 0.0)))
        factors: Json = source.get("pbrMetallicRoughness", {})
        metal = float(factors.get("metallicFactor", 1.0))
        roughness = float(factors.get("roughnessFactor", 1.0))
        laid = factors.get("metallicRoughnessTexture")
        return metal_rough_lobe(base, metal * self._mean(laid, 2), roughness * self._mean(laid, 1))

    def _mean(self, laid: Json | None, channel: int) -> float:
        """Return the mean of a texture's channel in [0, 1]; 1 without a texture."""
        image = None if laid is None else self._image(laid["index"])
        return 1.0 if image is None else float(image[..., channel].mean()) / 255.0

    def _through(self, source: Json) -> float:
        """Return the share of the base colour that is transmitted; a texture counts with its mean."""
        thin: Json = source.get("extensions", {}).get("KHR_materials_transmission", {})
        factor = float(thin.get("transmissionFactor", 0.0)) * self._mean(thin.get("transmissionTexture"), 0)
        return min(max(factor, 0.0), 1.0)

    def _emission(self, source: Json, index: int) -> tuple[tuple[float, float, float], NDArray[np.uint8] | None]:
        """Return the radiance, and the image that it is multiplied by, if any."""
        strong: Json = source.get("extensions", {}).get("KHR_materials_emissive_strength", {})
        factor = np.array(source.get("emissiveFactor", [0.0] * 3), dtype=np.float64)
        emission = factor * float(strong.get("emissiveStrength", 1.0))
        if not (emission <= MOST_LIGHT).all():  # false for NaN as well
            raise SceneError(
                f"material {index} emits {emission.tolist()}: expected finite numbers up to "
                f"{MOST_LIGHT:g} (W m^-2 sr^-1)"
            )
        laid = source.get("emissiveTexture")
        image = self._image(laid["index"]) if laid is not None and emission.any() else None
        red, green, blue = (float(value) for value in emission.clip(0.0, None))
        return (red, green, blue), image

    def _image(self, texture: int) -> NDArray[np.uint8] | None:
        """Return the pixels of texture number `texture`; None where textures are not drawn or its file is not found."""
        if not self.textures.drawn:
            return None
        entry: Json = item(self._document.get("textures", []), texture, "the number of a texture")
        extensions: Json = entry.get("extensions", {})
        index = extensions.get("EXT_texture_webp", {}).get("source", entry.get("source"))
        if KTX2 in extensions:
            if index is None:
                raise SceneError(
                    f"texture {texture} is a KTX2 image ({KTX2}) alone, which is not read: export it with PNG, JPEG or "
                    "WebP; load_scene(..., textures=False) or --no-textures draws the scene without"
                )
            self.textures.note(f"KTX2 images ({KTX2}) are not read: those that the file has beside them are drawn")
        if index is None:
            raise SceneError(f"texture {texture} has no image in a supported format: {sorted(entry)}")
        if index not in self._images:
            image: Json = item(self._document.get("images", []), index, f"the image of texture {texture}")
            what = f"image {index} {shown(image.get('name', image.get('uri', '')))}"
            uri = image.get("uri", "")
            if "bufferView" in image:
                data = bytes(item(self._views, image["bufferView"], f"the view of {what}"))
                self._images[index] = self.textures.decode(data, what)
            elif uri.startswith("data:"):
                data = read_uri(uri, self._folder, f"the uri of {what}")
                self._images[index] = self.textures.decode(data, what)
            elif uri:
                self._images[index] = self.textures.read(self._folder, unquote(uri), f"the uri of image {index}")
            else:
                raise SceneError(f"{what} has neither a uri nor a buffer view")
        return self._images[index]


def _layout(laid: Json) -> tuple[int, NDArray[np.float64] | None]:
    """Return the set of coordinates and the matrix of a textureInfo."""
    uv_set = laid.get("texCoord", 0)
    moved = laid.get("extensions", {}).get("KHR_texture_transform")
    if moved is None:
        return uv_set, None
    scale, offset = moved.get("scale", [1.0] * 2), moved.get("offset", [0.0] * 2)
    angle = float(moved.get("rotation", 0.0))
    cosine, sine = math.cos(angle), math.sin(angle)
    matrix = np.array(
        [[cosine * scale[0], sine * scale[1], offset[0]], [-sine * scale[0], cosine * scale[1], offset[1]]]
    )
    return moved.get("texCoord", uv_set), matrix


def _same_layout(one: tuple[int, NDArray[np.float64] | None], other: tuple[int, NDArray[np.float64] | None]) -> bool:
    """Return whether two textures lie alike."""
    plain = np.eye(2, 3)
    matrices = [plain if matrix is None else matrix for _, matrix in (one, other)]
    return one[0] == other[0] and np.array_equal(matrices[0], matrices[1])
