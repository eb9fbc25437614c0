"""Structs that the host passes to kernels by value: one declaration for numpy and for OpenCL C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera


@dataclass(frozen=True)
class Struct:
    """A C struct of 4-byte members, so that no compiler pads it.

    Attributes:
        name: its name in kernels.
        members: name -> "float" or "int".
    """

    name: str
    members: tuple[tuple[str, str], ...]

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The numpy type of the same layout."""
        kinds = {"float": np.float32, "int": np.int32}
        members = [(name, kinds[kind]) for name, kind in self.members]
        return np.dtype(members, metadata={"struct": self.name})

    @property
    def text(self) -> str:
        """The definition in OpenCL C."""
        members = " ".join(f"{kind} {name};" for name, kind in self.members)
        return f"typedef struct {{ {members} }} {self.name};"

    def pack(self, values: Mapping[str, float]) -> np.ndarray[Any, Any]:
        """Return the values as a numpy scalar that PyOpenCL passes by value."""
        return np.array(tuple(values[name] for name, _ in self.members), self.dtype)


def floats(*names: str) -> tuple[tuple[str, str], ...]:
    """Return float members of these names."""
    return tuple((name, "float") for name in names)


def ints(*names: str) -> tuple[tuple[str, str], ...]:
    """Return int members of these names."""
    return tuple((name, "int") for name in names)


CAMERA = Struct(
    "SsgiCamera",
    (
        *floats("to_x", "at_x", "to_y", "at_y", "from_x", "centre_x", "from_y", "centre_y"),
        *floats("perspective", "tolerance_depth", "rows_above", "rows_below"),
    ),
)


ROTATION = ("xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz")
"""Members that hold a 3 x 3 matrix, row by row."""


def rotation_values(matrix: NDArray[np.float64]) -> dict[str, float]:
    """Return the members of a struct that hold a [3, 3] matrix; see `ROTATION`."""
    return dict(zip(ROTATION, matrix.ravel().tolist(), strict=True))


def camera_values(
    camera: Camera, margin: tuple[int, int] = (0, 0), rows_above: int = 0, rows_below: int = 0
) -> dict[str, float]:
    """Return the members of SsgiCamera for arrays with `margin` = (rows, columns) on every side.

    Of a band of rows of these arrays, `rows_above` and `rows_below` are the others.
    """
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    at_x, at_y = at_x - to_x * margin[1], at_y - to_y * margin[0]
    return {
        "to_x": to_x,
        "at_x": at_x,
        "to_y": to_y,
        "at_y": at_y,
        "from_x": 1.0 / to_x,
        "centre_x": -at_x / to_x,
        "from_y": 1.0 / to_y,
        "centre_y": -at_y / to_y,
        "perspective": 0.0 if camera.is_orthographic else 1.0,
        "tolerance_depth": camera.view_height if camera.is_orthographic else 0.0,
        "rows_above": float(rows_above),
        "rows_below": float(rows_below),
    }
