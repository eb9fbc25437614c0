"""File formats of G-buffers: modules by name, imported when a file is first read or written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

MODULES = {"exr": "ssgi_cl.io.exr"}
"""Format -> the module that has the functions of `GBufferFormat`. Their libraries take time to
import, and this package knows arrays only."""


class GBufferFormat(Protocol):
    """What the module of a format offers."""

    def read_gbuffer(
        self,
        path: str | os.PathLike[str],
        channels: Mapping[str, str | tuple[str, ...]] | None,
        *,
        size: tuple[int, int],
    ) -> dict[str, NDArray[np.float32]]:
        """Return the arrays of a G-buffer whose camera has `size` (rows, columns)."""

    def write(self, path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
        """Write arrays, whole or not at all."""


def format_of(name: str) -> GBufferFormat:
    """Return the format of this name."""
    return cast(GBufferFormat, import_module(MODULES[name]))
