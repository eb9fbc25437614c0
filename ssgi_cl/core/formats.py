"""Files of G-buffers and environments: readers and writers that the package above this one provides."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ssgi_cl.core.camera import Camera
    from ssgi_cl.core.gbuffer import GBuffer
    from ssgi_cl.core.lights import Environment


class Files(Protocol):
    """Readers and writers of files."""

    def read_with_kind(
        self,
        path: str | os.PathLike[str],
        channels: Mapping[str, str | tuple[str, ...]] | None,
        *,
        size: tuple[int, int],
        layer: str | None,
        part: str | None,
        layout: str | None,
    ) -> tuple[dict[str, Any], str]:
        """Return the arrays of a G-buffer whose camera has `size` (rows, columns) with its notes, and the kind of
        depth that is expected."""

    def read_motion(
        self,
        path: str | os.PathLike[str],
        channels: str | Sequence[str] | None,
        *,
        kind: str | None,
        layer: str | None,
        part: str | None,
    ) -> tuple[NDArray[np.float32], tuple[str, ...]]:
        """Return motion as a file has it, and the channels that it is read from; see `ssgi_cl.io.exr.read_motion`."""

    def read_camera(self, path: str | os.PathLike[str]) -> tuple[Camera | None, str, NDArray[np.float64]]:
        """Return the camera that a file describes, or None, a note, and [3, 3] from the file's world to its own."""

    def write(
        self,
        path: str | os.PathLike[str],
        arrays: Mapping[str, Any],
        *,
        like: str | os.PathLike[str] | None = None,
        camera: Camera | None = None,
        half: bool = False,
        parts: bool = False,
    ) -> None:
        """Write arrays, whole or not at all; see `ssgi_cl.io.exr.write`."""

    def write_picture(self, path: str | os.PathLike[str], image: Any) -> None:
        """Write an image [rows, columns] or [rows, columns, 3] of uint8 or uint16 as PNG, whole or not at all."""

    def gbuffer_png(self, gbuffer: GBuffer) -> bytes:
        """Return a picture of the arrays of a G-buffer, side by side, as PNG."""

    def read_environment(self, path: str | os.PathLike[str]) -> Environment:
        """Return the environment of a latitude-longitude image."""


_provider: Callable[[], Files] | None = None


def provide(provider: Callable[[], Files]) -> None:
    """Say what returns the readers and writers; it is called when a file is first used."""
    global _provider
    _provider = provider


def files() -> Files:
    """Return the readers and writers."""
    assert _provider is not None  # noqa: S101  the package provides them when it is imported
    return _provider()
