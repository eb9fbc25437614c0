"""Loading scenes from files and from trimesh."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ssgi_cl.core import checks
from ssgi_cl.core.errors import SceneError, SsgiError
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.files.textures import TextureSet
from ssgi_cl.rasterize.normals import DEFAULT_CREASE_ANGLE
from ssgi_cl.rasterize.parts import Contents, assemble

if TYPE_CHECKING:
    import trimesh

# A module is imported when it is needed: trimesh takes as long as all the rest of the library.
READERS = {".glb": "gltf", ".gltf": "gltf", ".obj": "obj", ".ply": "ply"}
"""Modules that read files, by their suffix: `read` in each, which says what it keeps and what it leaves out."""


@checked_keywords
def load_scene(
    source: str | os.PathLike[str] | trimesh.Scene | trimesh.Trimesh,
    *,
    crease_angle: float = DEFAULT_CREASE_ANGLE,
    textures: bool = True,
    cull: bool | None = None,
) -> Scene:
    """Load a scene from a file (.glb, .gltf, .obj with .mtl, .ply) or from trimesh objects.

    Every instance becomes triangles in world space around the centre of their bounds. Normals are
    kept where the source has them and computed where it hasn't. Triangles without area are
    dropped. Factors of materials are linear, textures and colours in OBJ and PLY sRGB-encoded.

    Args:
        source: path of the file, or what trimesh made.
        crease_angle: radians, in [0, pi]; where normals are missing, faces that meet at a sharper
            angle keep an edge between them, others are smoothed. 0 makes every face flat.
        textures: whether textures are read; without, materials have their factors alone.
        cull: whether triangles lack their back, see `Material.double_sided`; by default as the source
            says: in glTF those of materials that are not `doubleSided`, elsewhere none.

    Returns:
        The scene with the lights and cameras that a glTF file describes, or that were set in a scene of
        trimesh, and notes on what of the source is not drawn.

    Raises:
        SceneError: the file is missing, of an unknown kind, damaged or without triangles; a texture
            can't be read; a vertex is not finite. Textures, libraries and materials that are not found
            in the file's folder are noted.
        MissingExtraError: the file needs a package that is not installed.
        ValueError: `crease_angle` is out of range.
    """
    angle = checks.number("crease_angle", crease_angle, low=0.0, high=math.pi, unit="radians")
    checks.switch("textures", textures)
    if cull is not None:
        checks.switch("cull", cull)
    images = TextureSet(drawn=textures)
    if not isinstance(source, (str, os.PathLike)):
        from ssgi_cl.rasterize.files.from_trimesh import read_trimesh

        return _joined(read_trimesh(source, images), images, angle, cull)
    path = Path(source)
    if not path.is_file():
        raise SceneError(f"{path}: there is no such file")
    module = READERS.get(path.suffix.lower())
    if module is None:
        raise SceneError(f"{path} ends in {path.suffix!r}: expected one of {', '.join(READERS)}")
    reader = import_module(f"ssgi_cl.rasterize.files.{module}")
    try:
        return _joined(reader.read(path, images), images, angle, cull)
    except SsgiError as error:
        if str(path.name) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
    except MemoryError as error:
        raise SceneError(f"{path} asks for more memory than there is") from error
    except Exception as error:  # a damaged file can trip any part of a parser
        raise SceneError(f"{path} can't be read: {type(error).__name__}: {error}") from error


def _joined(contents: Contents, textures: TextureSet, crease_angle: float, cull: bool | None) -> Scene:
    """Return the scene of what a file holds."""
    materials = contents.materials
    if cull is not None:
        materials = [replace(material, double_sided=not cull) for material in materials]
    scene = assemble(contents.parts, materials, textures.textures, textures.wraps, crease_angle=crease_angle)
    notes = (*contents.notes, *textures.notes)
    if not (contents.lights or contents.cameras or notes):
        return scene
    return replace(scene, lights=contents.lights, cameras=contents.cameras, notes=notes)
