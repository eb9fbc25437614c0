"""Accessors of a glTF document as arrays: sparse ones, those without a view, and matrices of skins."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.rasterize.files.gltf_document import item
from ssgi_cl.rasterize.files.gltf_schema import Json

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""dtype of each component type."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
"""Numbers of each type; columns of MAT3 and MAT2 of bytes have padding, and none are read."""
LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0, 5125: 4294967295.0}
"""What a normalised integer of each component type is divided by."""
INDEX_TYPES = (5121, 5123, 5125)

MOST_ROWS = 50_000_000
"""Of an accessor without bytes of its own, which a small file can claim."""


class Accessors:
    """The accessors of a document, checked when they are read."""

    def __init__(self, document: Json, views: list[memoryview]) -> None:
        self._all = document.get("accessors", [])
        self._view_of = document.get("bufferViews", [])
        self._views = views

    def checked(self, index: int, kinds: tuple[str, ...]) -> Json:
        """Return an accessor of one of the types `kinds`.

        Raises:
            SceneError: there is none of this number, or it is of another type.
        """
        accessor: Json = item(self._all, index, "an accessor")
        if accessor["type"] not in kinds or accessor["componentType"] not in COMPONENTS:
            raise SceneError(
                f"accessor {index} is {shown(accessor['type'])} of component type {accessor['componentType']}: "
                f"expected {' or '.join(kinds)} of one that glTF has"
            )
        return accessor

    def is_plain(self, index: int) -> bool:
        """Return whether an accessor is a view's bytes as they are."""
        accessor = self._all[index]
        return "bufferView" in accessor and "sparse" not in accessor

    def bounds(self, index: int) -> tuple[int, int]:
        """Return (first byte, bytes from row to row) of an accessor's rows in its view.

        Raises:
            SceneError: they are not all in the view.
        """
        accessor = self._all[index]
        width = WIDTHS[accessor["type"]] * np.dtype(COMPONENTS[accessor["componentType"]]).itemsize
        return self._bounds(f"accessor {index}", accessor, accessor["count"], width)

    def read(self, index: int, kinds: tuple[str, ...]) -> NDArray[Any]:
        """Return [count, numbers] of an accessor in its component type, sparse values put in.

        Without a view it holds zeros.

        Raises:
            SceneError: as `checked` and `bounds`, or a sparse index is out of range.
        """
        accessor = self.checked(index, kinds)
        width, dtype, count = WIDTHS[accessor["type"]], COMPONENTS[accessor["componentType"]], accessor["count"]
        if "bufferView" in accessor:
            values = self._rows(f"accessor {index}", accessor, count, width, dtype)
        elif count > MOST_ROWS:
            raise SceneError(f"accessor {index} claims {count} zeros: expected at most {MOST_ROWS}")
        else:
            values = np.zeros((count, width), dtype)
        sparse = accessor.get("sparse")
        if sparse is None:
            return values
        what = f"the sparse part of accessor {index}"
        places = sparse["indices"]
        if places["componentType"] not in INDEX_TYPES:
            raise SceneError(
                f"{what} has indices of component type {places['componentType']}: expected unsigned integers"
            )
        rows = self._rows(what, places, sparse["count"], 1, COMPONENTS[places["componentType"]])[:, 0].astype(np.int64)
        if (rows >= count).any():
            raise SceneError(f"{what} puts values in row {int(rows.max())}: expected less than {count}")
        values = values.copy()
        values[rows] = self._rows(what, sparse["values"], sparse["count"], width, dtype)
        return values

    def floats(self, index: int, kinds: tuple[str, ...]) -> NDArray[np.float64]:
        """Return what `read` does as numbers; normalised integers come to [-1, 1]."""
        return as_floats(self._all[index], self.read(index, kinds))

    def _bounds(self, what: str, holder: Json, count: int, width: int) -> tuple[int, int]:
        data = item(self._views, holder["bufferView"], f"the buffer view of {what}")
        start, stride = holder.get("byteOffset", 0), self._view_of[holder["bufferView"]].get("byteStride", width)
        if stride < width or (count and start + (count - 1) * stride + width > len(data)):
            raise SceneError(
                f"{what} reads {count} items of {width} bytes, {stride} apart, from byte {start} of a view of "
                f"{len(data)} bytes"
            )
        return start, stride

    def _rows(self, what: str, holder: Json, count: int, numbers: int, dtype: str) -> NDArray[Any]:
        """Return [count, numbers] that a view holds."""
        size = np.dtype(dtype).itemsize
        start, stride = self._bounds(what, holder, count, numbers * size)
        if not count:
            return np.zeros((0, numbers), dtype)
        data = np.frombuffer(self._views[holder["bufferView"]], np.uint8)
        rows = np.lib.stride_tricks.as_strided(data[start:], (count, numbers * size), (stride, 1), writeable=False)
        return np.ascontiguousarray(rows).view(dtype)


def as_floats(accessor: Json, values: NDArray[Any]) -> NDArray[np.float64]:
    """Return the values of an accessor as numbers; normalised integers come to [-1, 1]."""
    with np.errstate(invalid="ignore"):  # a signalling NaN, which is refused later
        numbers = np.asarray(values, dtype=np.float64)
    if accessor.get("normalized"):
        numbers = np.maximum(numbers / LARGEST[accessor["componentType"]], -1.0)
    return numbers
