"""Wavefront OBJ: text to a part and its materials.

Read here rather than through trimesh, which takes relative indices from the end of the file,
skips lines that part their words by tabs, drops Ke and keeps only 8 bits of Kd.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Material
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.rasterize.files.mtl import MtlMaterial, read_mtl
from ssgi_cl.rasterize.files.notes import material_notes, not_drawn
from ssgi_cl.rasterize.files.polygons import triangulate
from ssgi_cl.rasterize.files.textures import TextureSet, found_beside, is_file
from ssgi_cl.rasterize.parts import Contents, Part

_LEFT_OUT = {"p": "point", "l": "line", "curv": "curve", "curv2": "curve", "surf": "curved surface"}
_MISSING_SLASHES = (b"/0/0", b"/0", b"")


@dataclass
class _Statements:
    """The lines of a file, sorted by kind."""

    vertices: list[str] = field(default_factory=list)
    uvs: list[str] = field(default_factory=list)
    normals: list[str] = field(default_factory=list)
    faces: list[str] = field(default_factory=list)
    # How many vertices, uvs and normals came before each face: relative indices count from there.
    before: list[tuple[int, int, int]] = field(default_factory=list)
    material_of_face: list[int] = field(default_factory=list)
    material_names: list[str] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    # How many things there are of each statement that is not drawn.
    left_out: dict[str, int] = field(default_factory=dict)


def read(path: Path, textures: TextureSet) -> Contents:
    """Read an OBJ file and its material libraries.

    Polygons are cut into triangles. Colours that follow the position of a vertex are taken as
    sRGB-encoded, in [0, 1] or [0, 255]. A material that no library defines is grey. Smoothing groups
    are left out (the crease angle stands for them). Lines, points, curves, what of a material is not
    drawn, and a library, a material or a texture that is not found are noted.

    Raises:
        SceneError: a number or an index can't be read, or a texture is damaged.
    """
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    statements = _sort_lines(text)
    table = _numbers("v", statements.vertices, least=3)
    positions, colors = table[:, :3], _vertex_colors(table)
    uvs = _numbers("vt", statements.uvs, least=1)
    uvs = np.column_stack([uvs[:, 0], uvs[:, 1] if uvs.shape[1] > 1 else np.zeros(len(uvs))])
    normals = _numbers("vn", statements.normals, least=3)[:, :3]

    corners, counts = _corners(statements, (len(positions), len(uvs), len(normals)))
    cut, face = triangulate(counts, positions[corners[:, 0]])
    material_ids = np.array(statements.material_of_face, dtype=np.int64)[face]
    library = _libraries(statements, path.parent, textures)
    for name in statements.material_names:
        if name and name not in library:
            textures.note(f"material {shown(name)} is in no library: it is drawn grey")
    for kind in dict.fromkeys(_LEFT_OUT.values()):
        if number := sum(statements.left_out.get(key, 0) for key, each in _LEFT_OUT.items() if each == kind):
            textures.note(not_drawn(number, kind))
    grey = [MtlMaterial(material=Material(name=name)) for name in statements.material_names]
    found = [library.get(name, grey[i]) for i, name in enumerate(statements.material_names)]

    for note in material_notes((shown(m.material.name), m.features) for m in found):
        textures.note(note)

    used, vertex = _unique_corners(corners[cut].reshape(-1, 3), material_ids, found)
    # Index -1 (absent) falls on the row of zeros that is put at the end.
    uvs = np.concatenate([uvs, np.zeros((1, 2))])[used[:, 1]]
    scale = np.array([m.uv_scale for m in found])[used[:, 3]]
    offset = np.array([m.uv_offset for m in found])[used[:, 3]]
    part = Part(
        name=path.name,
        positions=positions[used[:, 0]],
        triangles=vertex.reshape(-1, 3),
        material_ids=material_ids,
        normals=np.concatenate([normals, np.zeros((1, 3))])[used[:, 2]],
        uvs=uvs * scale + offset,
        colors=None if colors is None else colors[used[:, 0]],
    )
    return Contents([part], [m.material for m in found])


def _sort_lines(text: str) -> _Statements:
    found = _Statements()
    lists = {"v": found.vertices, "vt": found.uvs, "vn": found.normals}
    faces, before, material_of_face = found.faces, found.before, found.material_of_face
    names: dict[str, int] = {}
    material = -1
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").split("\n"):
        words = line.split(None, 1)
        if len(words) < 2:
            continue
        key, rest = words
        if key in lists:
            lists[key].append(rest)
        elif key == "f":
            if material < 0:
                material = names.setdefault("", len(names))
            faces.append(rest)
            before.append((len(found.vertices), len(found.uvs), len(found.normals)))
            material_of_face.append(material)
        elif key == "usemtl":
            material = names.setdefault(rest.strip(), len(names))
        elif key == "mtllib":
            found.libraries.append(rest.strip())
        elif key in _LEFT_OUT:
            number = len(rest.split("#", 1)[0].split()) if key == "p" else 1
            found.left_out[key] = found.left_out.get(key, 0) + number
    found.material_names = list(names) or [""]
    return found


def _words(rows: list[str]) -> tuple[list[bytes], NDArray[np.int64], NDArray[np.int64]]:
    """Return the words of all rows, how many each row has, and how many slashes each word has."""
    text = "\n".join([*rows, ""])
    if "#" in text:
        text = "\n".join([*(row.split("#", 1)[0] for row in rows), ""])
    plain = text.encode("ascii", errors="replace")
    # The bytes are counted all at once: a list for each row would take most of the time.
    letters = np.frombuffer(plain, dtype=np.uint8)
    blank = (letters == ord(" ")) | ((letters >= ord("\t")) & (letters <= ord("\r")))
    starts = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
    row_ends = np.flatnonzero(letters == ord("\n"))
    before_row = np.concatenate([[0], np.searchsorted(starts, row_ends)])
    before_word = np.searchsorted(np.flatnonzero(letters == ord("/")), [*starts, len(letters)])
    return plain.split(), np.diff(before_row), np.diff(before_word)


def _numbers(key: str, rows: list[str], *, least: int) -> NDArray[np.float64]:
    """Return [rows, numbers] float64, as many numbers as the shortest row has."""
    words, counts, _ = _words(rows)
    width = int(counts.min()) if rows else least
    if width < least:
        row = rows[int(np.argmin(counts))].strip()
        raise SceneError(f"'{key} {row[:80]}': expected at least {least} numbers")
    try:
        flat = np.array(list(map(float, words)), dtype=np.float64)
    except ValueError as error:
        reason = str(error)[:120]
        raise SceneError(f"a '{key}' line holds a word that is not a number: {reason}") from None
    if len(flat) == len(rows) * width:
        return flat.reshape(-1, width)
    starts = np.cumsum(counts) - counts
    table: NDArray[np.float64] = flat[starts[:, None] + np.arange(width)]
    return table


def _vertex_colors(table: NDArray[np.float64]) -> NDArray[np.float64] | None:
    if table.shape[1] < 6:
        return None
    colors = table[:, 3:6]
    if not np.isfinite(colors).all() or (colors < 0).any() or (colors > 255).any():
        raise SceneError("the colour of a vertex is outside of [0, 1] and [0, 255]")
    return srgb_to_linear(colors / 255.0 if colors.max(initial=0.0) > 1.0 else colors)


def _corners(statements: _Statements, lengths: tuple[int, int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return [corners, 3] indices of vertex, uv (or -1), normal (or -1); [faces] corner counts."""
    words, counts, slashes = _words(statements.faces)
    try:
        given = _indices(words, slashes)
    except (ValueError, IndexError, OverflowError):
        raise SceneError(
            "an 'f' line holds a corner that is not v, v/vt, v//vn or v/vt/vn with whole numbers"
        ) from None
    before = np.repeat(np.array(statements.before, dtype=np.int64).reshape(-1, 3), counts, axis=0)
    corners = np.where(given < 0, before + given, given - 1)
    absent = given == 0
    absent[:, 0] = False
    wrong = ~absent & ((corners < 0) | (corners >= np.array(lengths)))
    if wrong.any():
        corner, kind = (int(i) for i in np.argwhere(wrong)[0])
        face = int(np.searchsorted(np.cumsum(counts), corner, side="right"))
        raise SceneError(
            f"'f {statements.faces[face].strip()[:80]}' refers to {('v', 'vt', 'vn')[kind]} "
            f"{given[corner, kind]}, but there are {lengths[kind]}"
        )
    corners[absent] = -1
    return corners, counts


def _indices(words: list[bytes], slashes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return [corners, 3] indices as they are written, 0 for those left out."""
    if not words:
        return np.zeros((0, 3), dtype=np.int64)
    width = int(slashes[0]) + 1
    if width > 3 or (slashes != slashes[0]).any():
        words = [word + _MISSING_SLASHES[word.count(b"/")] for word in words]
        width = 3
    numbers = b"/".join(words).replace(b"//", b"/0/").split(b"/")
    table = np.array(list(map(int, numbers)), dtype=np.int64).reshape(len(words), width)
    return np.pad(table, ((0, 0), (0, 3 - width)))


def _unique_corners(
    corners: NDArray[np.int64], material_ids: NDArray[np.int64], found: list[MtlMaterial]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return [vertices, 4] distinct (v, vt, vn, laying material), and the vertex of each corner."""
    plain = np.array([m.uv_scale == (1.0, 1.0) and m.uv_offset == (0.0, 0.0) for m in found])
    # All materials that lay their texture plainly share vertices: the first of them stands in.
    stand_in = np.where(plain, int(np.argmax(plain)), np.arange(len(found)))
    columns = [*corners.T, np.repeat(stand_in[material_ids], 3)]
    key, reach = np.zeros(len(corners), dtype=np.int64), 1
    for column in columns:
        size = int(column.max(initial=-1)) + 2
        if reach * size >= 2**62:
            key = np.unique(key, return_inverse=True)[1]
            reach = len(corners)
        key, reach = key * size + column + 1, reach * size
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return np.column_stack(columns)[first], inverse


def _libraries(statements: _Statements, folder: Path, textures: TextureSet) -> dict[str, MtlMaterial]:
    found: dict[str, MtlMaterial] = {}
    for line in dict.fromkeys(statements.libraries):
        for name in _library_names(line, lambda name: is_file(folder / name)):
            path = found_beside(folder, name)
            if path is None:
                textures.note(f"the mtllib is {shown(name)}, which is not found: its materials are drawn grey")
                continue
            text = path.read_bytes().decode("utf-8-sig", errors="replace")
            found |= read_mtl(text, path.parent, textures, within=folder)
    return found


def _library_names(line: str, exists: Callable[[str], bool]) -> list[str]:
    """Return the files of an mtllib line: one whose name holds blanks, or several."""
    return [line] if exists(line) or not line.split() else line.split()
