"""The header of a PLY file: checked against the format and against the length of the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ssgi_cl.core.errors import SceneError, shown

_LONGEST_HEADER = 1 << 16
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
"""Type of numpy, without byte order, by its name in a header."""
INDEX_LISTS = ("vertex_indices", "vertex_index")
"""Names of the list of a face's vertices."""


@dataclass
class _Element:
    name: str
    count: int
    lines: list[str] = field(default_factory=list)
    singles: list[str] = field(default_factory=list)
    lists: list[str] = field(default_factory=list)
    least_bytes: int = 0


@dataclass(frozen=True)
class PlyHeader:
    """The header of a PLY file.

    Attributes:
        texture: the file that a `TextureFile` comment names, or "".
        corner_uvs: whether faces have texture coordinates of their corners.
        bytes: the header anew, with nothing in it but what was checked.
        start: where the data begins.
        others: name and number of what there is besides vertices and faces.
    """

    texture: str
    corner_uvs: bool
    bytes: bytes
    start: int
    others: tuple[tuple[str, int], ...]


def read_header(data: bytes, path: Path) -> PlyHeader:
    """Return the header of a file, whose promises fit into its length.

    Raises:
        SceneError: the header is not one, or promises more than the file holds, or no triangle.
    """
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise SceneError(f"{path} is not a PLY file: there is no header")
    start = data.find(b"\n", end) + 1 or len(data)
    lines = data[:end].decode("utf-8", errors="replace").splitlines()[1:]
    elements: list[_Element] = []
    texture = ""
    form = ""
    for line in lines:
        words = line.split()
        key = words[0].lower() if words else "comment"
        if key == "format" and len(words) == 3 and words[1] in _FORMATS:
            form = words[1]
        elif key == "element" and len(words) == 3 and words[2].isdecimal():
            elements.append(_Element(words[1], int(words[2])))
        elif key == "property" and elements:
            _property(elements[-1], words, form, path)
        elif key not in ("comment", "obj_info"):
            raise SceneError(f"{path} has the line {shown(line)} in its header")
        elif "texturefile" in line.lower():
            texture = line[line.lower().index("texturefile") + len("texturefile") :].strip()
    if not form:
        raise SceneError(f"{path} has no format line with {', '.join(_FORMATS)} in its header")
    _check(elements, len(data) - start, path)
    text = ["ply", f"format {form} 1.0"]
    for element in elements:
        text += [f"element {element.name} {element.count}", *element.lines]
    corner_uvs = any("texcoord" in element.lists for element in elements)
    others = tuple((each.name, each.count) for each in elements if each.name not in ("vertex", "face"))
    return PlyHeader(texture, corner_uvs, "\n".join([*text, "end_header\n"]).encode(), start, others)


def _property(element: _Element, words: list[str], form: str, path: Path) -> None:
    *types, name = words[1:] or [""]
    is_list = types[:1] == ["list"] and len(types) == 3
    counted = is_list and TYPES.get(types[1], "f")[0] != "f"
    known = all(kind in TYPES for kind in types[-1:]) and (counted or len(types) == 1)
    if not known or name in (*element.singles, *element.lists):
        raise SceneError(f"{path} has the line {shown(' '.join(words))} in its header")
    (element.lists if is_list else element.singles).append(name)
    element.lines.append(" ".join(words))
    # Text takes a digit and a blank; an empty list its count alone.
    element.least_bytes += 2 if form == "ascii" else np.dtype(TYPES[types[1 if is_list else 0]]).itemsize


def _check(elements: list[_Element], left: int, path: Path) -> None:
    by_name = {element.name: element for element in elements}
    if len(by_name) != len(elements):
        raise SceneError(f"{path} has two elements of the same name in its header")
    for element in elements:
        if element.count * max(element.least_bytes, 1) > left + 1:  # no blank after the last word
            raise SceneError(
                f"{path} is cut off or damaged: {element.count} times {shown(element.name)} in {left} bytes of data"
            )
        left -= element.count * element.least_bytes
    vertex, face = by_name.get("vertex"), by_name.get("face")
    if vertex is None or any(axis not in vertex.singles for axis in "xyz"):
        raise SceneError(f"{path} has no vertices with the properties x, y and z")
    if face is None or not face.count:
        cloud = f": it is a cloud of {vertex.count} points, which are not drawn" if vertex.count else ""
        raise SceneError(f"{path} holds no triangle{cloud}")
    if not any(name in face.lists for name in INDEX_LISTS):
        raise SceneError(f"{path} has no list vertex_indices in its faces")
