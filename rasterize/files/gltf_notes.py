"""Notes on a glTF document: a line for each feature that is not drawn, or drawn in another way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ssgi_cl.core.errors import shown
from ssgi_cl.rasterize.files.gltf_document import UNDERSTOOD
from ssgi_cl.rasterize.files.gltf_schema import Json
from ssgi_cl.rasterize.files.notes import material_notes

MATERIAL_FIELDS = {
    "normalTexture": "bumps of a normal texture are not drawn",
    "occlusionTexture": "an occlusion texture is not used, ambient occlusion is computed",
}
"""What of a material is not drawn, by the field that has it; trimesh has the same fields."""
MEAN_OF_METAL = "a texture of metal and roughness counts with its mean"

_MATERIAL_EXTENSIONS = {
    "KHR_materials_volume": "volumes are not drawn, they are thin walls",
    "KHR_materials_clearcoat": "a clear coat is not drawn",
    "KHR_materials_sheen": "sheen is not drawn",
    "KHR_materials_iridescence": "iridescence is not drawn",
    "KHR_materials_anisotropy": "anisotropy is not drawn",
    "KHR_materials_dispersion": "dispersion is not drawn",
    "KHR_materials_specular": "factors of its specular reflection are not used",
    "KHR_materials_ior": "its index of refraction is not used",
    "KHR_materials_unlit": "it is lit like others",
}
_DRAWN_EXTENSIONS = (
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
)


def notes_of(document: Json, materials: Iterable[int]) -> Iterator[str]:
    """Yield a line for each feature of a document that is not drawn as the file says.

    Args:
        document: the checked JSON.
        materials: numbers of the materials in use.
    """
    used = [document["materials"][index] for index in sorted(materials)]
    yield from material_notes(
        (shown(material.get("name") or f"material {index}"), _features(material))
        for index, material in zip(sorted(materials), used, strict=True)
    )
    yield from _geometry(document)
    unknown = set(document.get("extensionsUsed", [])) - {*UNDERSTOOD, *_MATERIAL_EXTENSIONS, *_DRAWN_EXTENSIONS}
    for extension in sorted(unknown):
        yield f"extension {shown(extension)} is not known: what it adds is not drawn"


def _features(material: Json) -> Iterator[str]:
    """Yield the features of a material that are not drawn."""
    if material.get("alphaMode") == "BLEND":
        yield "G-buffers and shadows have blended surfaces where their opacity is 0.5 or more"
    yield from (text for field, text in MATERIAL_FIELDS.items() if field in material)
    if "metallicRoughnessTexture" in material.get("pbrMetallicRoughness", {}):
        yield MEAN_OF_METAL
    extensions = material.get("extensions", {})
    if "KHR_materials_transmission" in extensions:
        yield "light passes straight through it, neither bent nor scattered; G-buffers show it"
    yield from (text for name, text in _MATERIAL_EXTENSIONS.items() if name in extensions)


def _geometry(document: Json) -> Iterator[str]:
    primitives = [each for mesh in document.get("meshes", []) for each in mesh["primitives"]]
    lines = sum(primitive.get("mode", 4) < 4 for primitive in primitives)
    if lines:
        yield f"{lines} primitive(s) of points and lines are not drawn"
    if any("targets" in primitive for primitive in primitives):
        yield "morph targets are not applied"
    if document.get("animations"):
        yield "animations are not played: nodes stand as the file places them"
    if len(document.get("scenes", [])) > 1:
        yield f"{len(document['scenes']) - 1} more scene(s) of the file are not drawn"
