"""PLY: trimesh decodes the data; the header is read in ply_header, colours here."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Material
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.rasterize.files.notes import not_drawn
from ssgi_cl.rasterize.files.ply_header import INDEX_LISTS, PlyHeader, read_header
from ssgi_cl.rasterize.files.ply_polygons import as_triangles
from ssgi_cl.rasterize.files.textures import UTF8_MARK, TextureSet
from ssgi_cl.rasterize.parts import Contents, Part


def read(path: Path, textures: TextureSet) -> Contents:
    """Read a PLY file of polygons, text or binary; they are cut into triangles.

    Colours (red, green, blue of vertices, else of faces; integers of their type's range or
    floating-point numbers in [0, 1]) are taken as sRGB-encoded. The image that a `TextureFile`
    comment names is the texture. The material is white if there are colours or a texture, else
    grey. Points of no face, and elements other than vertices and faces, are noted.

    Raises:
        SceneError: damaged.
    """
    data = path.read_bytes().removeprefix(UTF8_MARK)
    header = read_header(data, path)
    try:
        loaded = _decoded(header.bytes, data[header.start :], header.corner_uvs)
        fits = _lists_fit(loaded.metadata["_ply_raw"]["face"])
    except MemoryError:
        raise
    except Exception:  # trimesh takes all polygons to have as many corners as the first
        fits = False
    if not fits:
        loaded = _cut(header, data, path)
    raw = loaded.metadata["_ply_raw"]
    positions = np.asarray(loaded.vertices, dtype=np.float64)
    triangles = np.asarray(loaded.faces, dtype=np.int64)
    untouched = len(positions) == raw["vertex"]["length"]
    uvs = getattr(loaded.visual, "uv", None)
    part = Part(
        name=path.name,
        positions=positions,
        triangles=triangles,
        material_ids=np.zeros(len(triangles), dtype=np.int64),
        normals=_columns(raw["vertex"], ("nx", "ny", "nz")) if untouched else None,
        uvs=None if uvs is None else np.asarray(uvs, dtype=np.float64),
        colors=_colors(raw["vertex"]) if untouched else None,
    )
    if part.colors is None and (of_face := _colors(raw["face"])) is not None:
        part = part.with_face_colors(of_face)
    texture = -1
    if header.texture and part.uvs is not None:
        image = textures.read(path.parent, header.texture, f"the TextureFile of {path.name}")
        texture = -1 if image is None else textures.add(image)
    for note in _left_out(header, len(positions) - len(np.unique(triangles)) if untouched else 0):
        textures.note(note)
    white = texture >= 0 or part.colors is not None
    return Contents([part], [Material(albedo=(1.0, 1.0, 1.0)) if white else Material()])


def _left_out(header: PlyHeader, points: int) -> Iterator[str]:
    """Yield a line for each kind of thing that is not drawn; `points` are in no face."""
    if points:
        yield not_drawn(points, "point of no face", "points of no face")
    for name, number in header.others:
        if number:
            yield not_drawn(number, f"element {shown(name)}", f"elements {shown(name)}")


def _decoded(header: bytes, data: bytes, corner_uvs: bool) -> trimesh.Trimesh:
    """Return what trimesh makes of the data; whatever fails raises."""
    with np.errstate(invalid="ignore", over="ignore"):
        options: dict[str, Any] = {"process": False, "validate": False, "skip_materials": True}
        file = io.BytesIO(header + data)
        loaded = trimesh.load(file, file_type="ply", fix_texture=corner_uvs, **options)
    if not isinstance(loaded, trimesh.Trimesh):
        raise SceneError("no triangle")
    return loaded


def _cut(header: PlyHeader, data: bytes, path: Path) -> trimesh.Trimesh:
    """Return what trimesh makes of the data with its polygons cut into triangles."""
    try:
        cut = as_triangles(header.bytes, data[header.start :])
        return _decoded(cut, b"", header.corner_uvs)
    except MemoryError:
        raise
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    except Exception as error:  # the header is sound, so whatever fails, fails at the data
        reason = f"{type(error).__name__}: {error}"[:200]
        raise SceneError(f"{path} is cut off or damaged: its data doesn't fit its header ({reason})") from error


def _lists_fit(element: dict[str, Any]) -> bool:
    """Return whether trimesh, which takes all lists to be as long as the first, was right, and faces are triangles."""
    data = element["data"]
    if isinstance(data, np.ndarray) and data.dtype.names:
        for name in data.dtype.names:
            if data.dtype[name].names and (data[name]["f0"] != data[name]["f0"][0]).any():
                return False
    lists = data[next(key for key in INDEX_LISTS if key in element["properties"])]
    if isinstance(lists, np.ndarray) and lists.dtype.names:
        lists = lists["f1"]
    corners = {lists.shape[1]} if np.ndim(lists) == 2 else set(map(len, lists))
    return corners <= {3}


def _columns(element: dict[str, Any], names: tuple[str, ...]) -> NDArray[np.float64] | None:
    if not all(name in element["properties"] for name in names):
        return None
    if any(np.asarray(element["data"][name]).dtype.kind not in "iuf" for name in names):
        raise SceneError(f"{', '.join(names)}: some rows of the file have fewer numbers")
    return np.column_stack([element["data"][name] for name in names]).astype(np.float64)


def _colors(element: dict[str, Any]) -> NDArray[np.float64] | None:
    """Return [items, 3] linear colours of an element, or None."""
    values = _columns(element, ("red", "green", "blue"))
    if values is None:
        return None
    stored = np.asarray(element["data"]["red"]).dtype
    if stored.kind in "iu":
        values = values / np.iinfo(stored).max
    return srgb_to_linear(np.clip(values, 0.0, 1.0))
