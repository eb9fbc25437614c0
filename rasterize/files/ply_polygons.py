"""PLY files of polygons that trimesh does not read, of several sizes or many corners, cut into triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError
from ssgi_cl.rasterize.files.ply_header import INDEX_LISTS, TYPES
from ssgi_cl.rasterize.files.polygons import triangulate

_WORDS = {kind: word for word, kind in reversed(TYPES.items())}
"""Type by dtype: the names of the first PLY."""


@dataclass
class _Element:
    """An element of a header: its properties are (name, dtype, dtype of the count or "")."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)


def as_triangles(header: bytes, data: bytes) -> bytes:
    """Return a binary PLY file whose faces are triangles: of the elements vertex and face alone.

    Properties of a polygon are those of each of its triangles; texture coordinates of corners go with them.

    Args:
        header: checked, from "ply" to "end_header".
        data: what follows it.

    Raises:
        SceneError: a list refers to a vertex that is not there.
        ValueError, IndexError: the data is cut off.
    """
    elements, order = _elements(header.decode())
    rows = _text_rows(elements, data) if order == "" else _binary_rows(elements, data, order)
    by_name = {element.name: element for element in elements}
    vertex, face = by_name["vertex"], by_name["face"]
    polygons = rows["face"]
    indices = next(polygons[name] for name in INDEX_LISTS if name in polygons)
    counts = np.array([len(each) for each in indices], dtype=np.int64)
    numbers = np.concatenate([*indices, np.zeros(0)])
    points = np.stack([rows["vertex"][axis] for axis in "xyz"], axis=1).astype(np.float64)
    astray = numbers[~((numbers >= 0) & (numbers < len(points)))]  # NaN is
    if len(astray):
        raise SceneError(f"a face refers to vertex {astray[0]:.0f}, but there are {len(points)}")
    corners = numbers.astype(np.int64)
    cut, owner = triangulate(counts, points[corners])
    made: dict[str, NDArray[Any]] = {}
    text = ["ply", "format binary_little_endian 1.0", f"element vertex {vertex.count}"]
    text += [f"property {_WORDS[kind]} {name}" for name, kind, count in vertex.properties if not count]
    text.append(f"element face {len(cut)}")
    for name, kind, count in face.properties:
        if name in INDEX_LISTS:
            made[name] = corners[cut].astype("<i4")
        elif name == "texcoord" and count:
            flat = np.concatenate([*polygons[name], np.zeros(0)])
            if len(flat) != 2 * len(corners):
                raise SceneError("the texcoord lists of faces have another length than their corners")
            made[name] = flat.reshape(-1, 2)[cut].reshape(-1, 6).astype("<f4")
        elif not count:
            made[name] = np.asarray(polygons[name])[owner].astype(f"<{kind}")
            text.append(f"property {_WORDS[kind]} {name}")
            continue
        else:
            continue
        text.append(f"property list uchar {'int' if name in INDEX_LISTS else 'float'} {name}")
    vertices = _table({name: rows["vertex"][name] for name, _, count in vertex.properties if not count}, vertex.count)
    return "\n".join([*text, "end_header\n"]).encode() + vertices.tobytes() + _table(made, len(cut)).tobytes()


def _table(columns: dict[str, NDArray[Any]], count: int) -> NDArray[Any]:
    """Return rows of all columns, lists with their length before them."""
    kinds: list[Any] = []
    for name, values in columns.items():
        if values.ndim == 2:
            kinds += [(f"{name} count", "u1"), (name, values.dtype.newbyteorder("<"), values.shape[1])]
        else:
            kinds.append((name, values.dtype.newbyteorder("<")))
    table = np.zeros(count, dtype=kinds)
    for name, values in columns.items():
        table[name] = values
        if values.ndim == 2:
            table[f"{name} count"] = values.shape[1]
    return table


def _elements(header: str) -> tuple[list[_Element], str]:
    """Return the elements of a header, and the byte order of its data; "" of text."""
    elements: list[_Element] = []
    order = ""
    for line in header.splitlines():
        words = line.split()
        if words[0] == "format":
            order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1], "")
        elif words[0] == "element":
            elements.append(_Element(words[1], int(words[2])))
        elif words[0] == "property":
            count = TYPES[words[2]] if words[1] == "list" else ""
            elements[-1].properties.append((words[-1], TYPES[words[-2]], count))
    return elements, order


def _text_rows(elements: list[_Element], data: bytes) -> dict[str, dict[str, Any]]:
    """Return the values of each property of each element: an array, or a list of arrays."""
    words, place, rows = data.split(), 0, {}
    for element in elements:
        values: dict[str, list[Any]] = {name: [] for name, _, _ in element.properties}
        for _ in range(element.count):
            for name, _, count in element.properties:
                length = int(words[place]) if count else 1
                place += bool(count)
                if length < 0 or place + length > len(words):
                    raise ValueError("a list goes beyond the end of the data")
                numbers = np.array(words[place : place + length], dtype=np.float64)
                values[name].append(numbers if count else numbers[0])
                place += length
        rows[element.name] = _columns(element, values)
    return rows


def _binary_rows(elements: list[_Element], data: bytes, order: str) -> dict[str, dict[str, Any]]:
    """Return what `_text_rows` does of binary data."""
    place, rows = 0, {}
    for element in elements:
        plain = [(name, order + kind) for name, kind, count in element.properties if not count]
        if len(plain) == len(element.properties):
            table = np.frombuffer(data, dtype=plain, count=element.count, offset=place)
            rows[element.name] = {name: table[name] for name, _ in plain}
            place += table.nbytes
            continue
        values: dict[str, list[Any]] = {name: [] for name, _, _ in element.properties}
        for _ in range(element.count):
            for name, kind, count in element.properties:
                length = 1
                if count:
                    length = int(np.frombuffer(data, order + count, 1, place)[0])
                    place += int(count[1])
                    if length < 0:
                        raise ValueError("a list has a negative length")
                numbers = np.frombuffer(data, order + kind, length, place) if length else np.zeros(0)
                place += int(kind[1]) * length
                values[name].append(numbers if count else numbers[0])
        rows[element.name] = _columns(element, values)
    return rows


def _columns(element: _Element, values: dict[str, list[Any]]) -> dict[str, Any]:
    return {
        name: values[name] if count else _column(name, kind, np.array(values[name]))
        for name, kind, count in element.properties
    }


def _column(name: str, kind: str, values: NDArray[Any]) -> NDArray[Any]:
    """Return values as the type of their property; of floats, what is beyond it becomes infinite."""
    dtype = np.dtype(kind)
    if dtype.kind != "f" and len(values):
        least, most = np.iinfo(dtype).min, np.iinfo(dtype).max
        if not (values.min() >= least and values.max() <= most):
            raise SceneError(f"{name} is {values.min():g} to {values.max():g}: expected {least} to {most}")
    with np.errstate(over="ignore"):
        return values.astype(dtype)
