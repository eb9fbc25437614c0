"""Scenes and meshes of trimesh, made or loaded by the caller."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Material
from ssgi_cl.core.srgb import mean_color, srgb_to_linear
from ssgi_cl.rasterize.files.gltf_notes import MATERIAL_FIELDS, MEAN_OF_METAL
from ssgi_cl.rasterize.files.metal_rough import Lobe, metal_rough_lobe
from ssgi_cl.rasterize.files.mtl_notes import features_of
from ssgi_cl.rasterize.files.notes import material_notes, not_drawn
from ssgi_cl.rasterize.files.textures import TextureSet, lets_through, rgba_of
from ssgi_cl.rasterize.files.trimesh_view import view_of
from ssgi_cl.rasterize.parts import Contents, Part

_KINDS = {"PointCloud": "point cloud", "Path2D": "path", "Path3D": "path", "VoxelGrid": "voxel grid"}
_GREY = Material()
_WHITE = Material(albedo=(1.0, 1.0, 1.0))


def read_trimesh(source: trimesh.Scene | trimesh.Trimesh, textures: TextureSet) -> Contents:
    """Return the parts and materials of a mesh, or of every instance of a scene.

    Colours of vertices and faces are taken as sRGB-encoded; factors of materials as linear, with
    the bits that trimesh has left of them (a file read by path keeps them all). Normals are kept
    where they differ from those that trimesh computes itself. A scene's lights and its camera are kept
    if they were set; what of a scene is not drawn is noted.

    Raises:
        SceneError: there is no mesh.
        TypeError: `source` is neither.
    """
    reader = _Reader(textures)
    if isinstance(source, trimesh.Trimesh):
        parts = [reader.part(source, "mesh")]
        return Contents(parts, reader.materials, notes=tuple(material_notes(reader.features)))
    if not isinstance(source, trimesh.Scene):
        raise TypeError(f"source is {type(source).__name__}: expected a path, or a Scene or Trimesh of trimesh")
    parts = []
    made: dict[str, Part] = {}
    others: dict[str, int] = {}
    for node in source.graph.nodes_geometry:
        matrix, key = source.graph[node]
        name = str(key)
        mesh = source.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh):
            kind = _KINDS.get(type(mesh).__name__, type(mesh).__name__)
            others[kind] = others.get(kind, 0) + 1
            continue
        if name not in made:
            made[name] = reader.part(mesh, name)
        parts.append(made[name].transformed(np.asarray(matrix, dtype=np.float64)))
    left_out = [not_drawn(number, kind) for kind, number in others.items()]
    if not parts:
        raise SceneError("; ".join(["the trimesh scene places no mesh", *left_out]))
    lights, cameras, notes = view_of(source)
    return Contents(parts, reader.materials, lights, cameras, (*material_notes(reader.features), *left_out, *notes))


class _Reader:
    def __init__(self, textures: TextureSet) -> None:
        self.materials: list[Material] = []
        self.features: list[tuple[str, list[str]]] = []  # not drawn, by name of their material
        self._textures = textures
        self._index: dict[int, int] = {}
        # Keeps materials alive, so that an id stands for one material only.
        self._seen: list[object] = []

    def part(self, mesh: trimesh.Trimesh, name: str) -> Part:
        """Return a mesh in its own coordinates."""
        triangles = np.asarray(mesh.faces, dtype=np.int64)
        uvs, colors, of_face = None, None, None
        visual: Any = mesh.visual  # of colours or of textures, as its kind says
        if visual.kind == "texture":
            if visual.uv is not None:
                uvs = np.asarray(visual.uv, dtype=np.float64)
            colors = _linear_attribute(visual.vertex_attributes.get("color"))
            material_ids = self._material_ids(visual, len(triangles))
        else:
            if visual.kind == "vertex":
                colors = srgb_to_linear(np.asarray(visual.vertex_colors)[:, :3] / 255.0)
            elif visual.kind == "face":
                of_face = srgb_to_linear(np.asarray(visual.face_colors)[:, :3] / 255.0)
            plain = _GREY if visual.kind is None else _WHITE
            material_ids = np.full(len(triangles), self._add(plain, plain))
        part = Part(
            name=name,
            positions=np.asarray(mesh.vertices, dtype=np.float64),
            triangles=triangles,
            material_ids=material_ids,
            normals=_given_normals(mesh),
            uvs=uvs,
            colors=colors,
        )
        return part if of_face is None else part.with_face_colors(of_face)

    def _material_ids(self, visual: Any, count: int) -> NDArray[np.int64]:
        several = getattr(visual.material, "materials", None)
        of_face = getattr(visual, "face_materials", None)
        if several and of_face is not None:
            numbers = np.array([self._add(m, self._material(m)) for m in several])
            return numbers[np.asarray(of_face, dtype=np.int64)]
        return np.full(count, self._add(visual.material, self._material(visual.material)))

    def _add(self, key: object, material: Material) -> int:
        if id(key) not in self._index:
            self._index[id(key)] = len(self.materials)
            self._seen.append(key)
            self.materials.append(material)
            self.features.append((shown(material.name), list(_features(key))))
        return self._index[id(key)]

    def _material(self, source: Any) -> Material:
        is_pbr = isinstance(source, trimesh.visual.material.PBRMaterial)
        return self._pbr(source) if is_pbr else self._simple(source)

    def _pbr(self, source: Any) -> Material:
        color = _factor(source.baseColorFactor, (1.0, 1.0, 1.0, 1.0))
        emission = _factor(source.emissiveFactor, (0.0, 0.0, 0.0, 1.0))[:3]
        if source.emissiveTexture is not None and emission.any():
            glow = rgba_of(source.emissiveTexture, "the emissive texture")
            emission = emission * mean_color(glow)
        cutoff = 0.5 if source.alphaCutoff is None else float(source.alphaCutoff)
        mode = source.alphaMode or "OPAQUE"
        lobe = _lobe(source, color)
        laid = source.baseColorTexture
        image = None if laid is None else rgba_of(laid, "a texture")
        return Material(
            name=str(source.name or ""),
            albedo=_rgb(lobe.matt * color.clip(0.0, 1.0)),
            specular=lobe.specular,
            gloss=lobe.gloss,
            texture=self._texture(source.baseColorTexture),
            alpha=float(color[3].clip(0.0, 1.0)),
            alpha_cutoff={"MASK": min(max(cutoff, 0.0), 1.0), "BLEND": 0.5}.get(mode, 0.0),
            blends=mode == "BLEND" and lets_through(float(color[3]), image),
            emission=_rgb(emission.clip(0.0, None)),
            double_sided=source.doubleSided is not False,
        )

    def _simple(self, source: Any) -> Material:
        fields = getattr(source, "kwargs", None) or {}
        color = _factor(getattr(source, "diffuse", None), (0.8, 0.8, 0.8, 1.0))
        texture = self._texture(getattr(source, "image", None))
        # What trimesh read from an .mtl file it also keeps unrounded, as numbers or as words.
        albedo = _triple(fields.get("kd"), color[:3]).clip(0.0, 1.0)
        gloss = float(getattr(source, "glossiness", None) or 1.0)
        return Material(
            name=str(getattr(source, "name", None) or ""),
            albedo=_rgb(albedo),
            texture=texture,
            alpha=float(color[3]),
            alpha_cutoff=0.5 if color[3] < 1.0 else 0.0,
            blends=bool(color[3] < 1.0),
            emission=_rgb(_triple(fields.get("ke"), np.zeros(3)).clip(0.0, None)),
            specular=_rgb(_triple(fields.get("ks"), np.zeros(3)).clip(0.0, 1.0)),
            gloss=min(max(gloss, 1.0), 1e6) if math.isfinite(gloss) else 1.0,
        )

    def _texture(self, image: Any) -> int:
        if image is None or not self._textures.drawn:
            return -1
        return self._textures.add(rgba_of(image, "a texture"))


def _features(source: object) -> Iterator[str]:
    """Yield what of a material of trimesh is not drawn as it says."""
    yield from (text for field, text in MATERIAL_FIELDS.items() if getattr(source, field, None) is not None)
    if getattr(source, "metallicRoughnessTexture", None) is not None:
        yield MEAN_OF_METAL
    # What an .mtl file says besides; words, or what trimesh made of them.
    fields = getattr(source, "kwargs", None) or {}
    others = {str(key).lower(): _words(value) for key, value in fields.items()}
    yield from features_of({}, (), others)
    if unread := [key for key in ("map_ke", "pm", "pr", "map_pm", "map_pr") if key in others]:
        yield f"{', '.join(unread)} of an .mtl file: not read from trimesh, only from a file by its path"


def _words(value: Any) -> list[str]:
    """Return the words of a statement; none of what is no words, such as an image."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return [str(word) for word in value]
    return str(value).split() if isinstance(value, (str, int, float)) else []


def _lobe(source: Any, color: NDArray[np.float64]) -> Lobe:
    """Return what a material mirrors; textures count with their mean."""
    base = color[:3].clip(0.0, 1.0)
    if source.baseColorTexture is not None:
        base = base * mean_color(rgba_of(source.baseColorTexture, "a texture"))
    metal = 1.0 if source.metallicFactor is None else float(source.metallicFactor)
    roughness = 1.0 if source.roughnessFactor is None else float(source.roughnessFactor)
    if source.metallicRoughnessTexture is not None:
        means = rgba_of(source.metallicRoughnessTexture, "a texture").mean(axis=(0, 1)) / 255.0
        metal, roughness = metal * float(means[2]), roughness * float(means[1])
    return metal_rough_lobe(base, metal, roughness)


def _given_normals(mesh: trimesh.Trimesh) -> NDArray[np.float64] | None:
    """Return [vertices, 3] normals that came with the mesh, None if trimesh computed them.

    trimesh doesn't say which; those it computes are the same as those of a bare copy.
    """
    given = np.asarray(mesh.vertex_normals, dtype=np.float64)
    bare = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)
    computed = np.asarray(bare.vertex_normals, dtype=np.float64)
    return None if np.allclose(given, computed, rtol=0.0, atol=1e-6) else given


def _linear_attribute(values: Any) -> NDArray[np.float64] | None:
    """Return [vertices, 3] of a glTF colour attribute: linear, integers span [0, 1]."""
    if values is None:
        return None
    stored = np.asarray(values)
    scale = float(np.iinfo(stored.dtype).max) if stored.dtype.kind in "iu" else 1.0
    return np.clip(stored[:, :3].astype(np.float64) / scale, 0.0, None)


def _factor(values: Any, otherwise: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Return [4] numbers of a factor, which trimesh keeps as floats or as 8 bits."""
    if values is None:
        return np.array(otherwise)
    stored = np.asarray(values).ravel()
    numbers = stored / 255.0 if stored.dtype.kind in "iu" else stored.astype(np.float64)
    return np.concatenate([numbers, otherwise[len(numbers) :]])[:4]


def _triple(values: Any, otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
    if values is None:
        return otherwise
    if isinstance(values, str):
        values = values.split()
    numbers = np.array([float(value) for value in np.ravel(values)])
    return numbers[:3] if len(numbers) >= 3 else np.repeat(numbers[:1], 3)


def _rgb(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
