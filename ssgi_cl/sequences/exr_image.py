"""The G-buffer in an OpenEXR file, read by rows: for images that are larger than memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_kind import detected_kind
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_band import Band, band_with, rows_with_padding
from ssgi_cl.core.normal_space import SAME, UnclearSpaceError, detected_space
from ssgi_cl.core.seen_extent import default_radius, seen_extent, sparse_step
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.sequences.exr_passes import Passes, interpreted
from ssgi_cl.techniques.bands import PIXEL_BYTES, FoundRows, each_band
from ssgi_cl.techniques.technique import Technique

PROBED = 384
"""Pixels along the shorter side that tell the kind of depth and the space of normals."""
HOST_BYTES = 40, 100
"""Of host memory for a pixel of a band, read, checked and written; without normals and with them."""

Stored = Callable[[Path, tuple[int, int] | None], tuple[dict[str, Any], str, list[str]]]


class ExrImage:
    """The rows of the G-buffer in a file, as `techniques.bands.ImageRows`.

    Args:
        source: the file, of one part.
        camera: of its data window.
        axes: from the file's world to that of the camera; None if unknown.
        passes: how it is read.
        stored: returns the arrays of some rows as the file has them.
        said: note on the camera.

    Attributes:
        notes: what was read and found.
    """

    layers = 1
    margin = (0, 0)

    def __init__(
        self, source: Path, camera: Camera, axes: NDArray[np.float64] | None, passes: Passes, stored: Stored, said: str
    ) -> None:
        self.source, self.camera, self.size = source, camera, camera.size
        self._axes, self._passes, self._stored = axes, passes, stored
        self._outline = _outline(camera)
        self._first = 0
        self._kept: dict[str, NDArray[np.float32]] = {}  # rows that were read last, from this one on
        self._kind, self._space = passes.depth_kind, passes.normal_space
        self.notes = (said, *self._find_kinds())

    def _find_kinds(self) -> list[str]:
        """Find the kind of depth and the space of normals by every so-many-th pixel, for all of the image."""
        arrays, camera, notes = self._thinned()
        if self._kind is None and self._passes.depth_range is None:
            found = detected_kind(arrays["depth"], camera, self._expected)
            self._kind = found.name if found.clear else self._expected or None
        self._has_normals = "normal" in arrays
        normal = arrays.pop("normal", None)
        found_notes = self._interpret(arrays, camera)
        if normal is not None:
            self._space = self._space or self._found_space(normal, arrays["depth"], camera)
            found_notes.append(f"normals are read as those of {self._space}")
        return [*notes, *found_notes]

    def _thinned(self) -> tuple[dict[str, NDArray[np.float32]], Camera, list[str]]:
        """Return the arrays of every so-many-th pixel as the file has them, their camera, and notes."""
        height, width = self.size
        step = max(min(height, width) // PROBED, 1)
        rows = [self._stored(self.source, (row, row + 1)) for row in range(step // 2, height - height % step, step)]
        _, self._expected, notes = rows[0]
        columns = slice(step // 2, width - width % step, step)
        arrays = {name: np.concatenate([each[0][name] for each in rows])[:, columns] for name in rows[0][0]}
        whole = self.camera.cropped(0, 0, width - width % step, height - height % step)
        count = arrays["depth"].shape
        return arrays, replace(whole, width=count[1], height=count[0]), notes

    def _found_space(self, normal: NDArray[np.float32], planar: NDArray[np.float32], camera: Camera) -> str:
        """Return the name of the space of normals. ValueError: they have none of those that can be named."""
        axes = SAME if self._axes is None else self._axes
        depth = np.where(planar > 0.0, planar, np.inf)
        try:
            space = detected_space(normal, depth, camera, world=self._axes is not None, axes=axes)
        except UnclearSpaceError as error:
            if error.few:
                return "camera" if self._axes is None else "world"
            raise ValueError(
                f"{self.source}: {error}; say it with --normals, or leave them out: --no-normals"
            ) from None
        if space.found:
            raise ValueError(
                f"{self.source}: the normals are of a world whose axes are not the camera's: expected --no-normals, or "
                "no --max-memory"
            )
        return space.name

    def _camera(self, first: int, end: int) -> Camera:
        return self.camera.cropped(0, first, self.camera.width, end - first)

    def _interpret(self, arrays: dict[str, Any], camera: Camera) -> list[str]:
        return interpreted(
            arrays, self.source, camera, self._expected, self._axes, self._passes, self._space, self._kind
        )

    def _read(self, first: int, end: int) -> dict[str, NDArray[np.float32]]:
        """Return planar depth and normals in world space of some rows, checked."""
        arrays, _, _ = self._stored(self.source, (first, end))
        camera = self._camera(first, end)
        self._interpret(arrays, camera)
        try:
            checked = GBuffer(camera=camera, nan=self._passes.nan, **arrays)  # type: ignore[arg-type]
        except ValueError as error:
            raise ValueError(f"{self.source}, of rows from {first} on: {error}") from None
        return {name: getattr(checked, name) for name in arrays}

    def _rows(self, first: int, end: int) -> dict[str, NDArray[np.float32]]:
        """Return rows of the image; those that the request before had are not read again."""
        have = self._first, self._first + len(self._kept.get("depth", ()))
        if have[0] <= first and end <= have[1]:
            return {name: array[first - have[0] : end - have[0]] for name, array in self._kept.items()}
        if have[0] <= first < have[1] < end:
            new = self._read(have[1], end)
            arrays = {name: np.concatenate([self._kept[name][first - have[0] :], new[name]]) for name in new}
        else:
            arrays = self._read(first, end)
        self._first, self._kept = first, arrays
        return arrays

    def nearest(self, first: int, end: int) -> float:
        """Return the least depth of rows, scene units; +inf of none."""
        # The band asks for rows before these, which are still there.
        low = min(self._first, first) if self._kept else first
        return float(self._rows(low, end)["depth"][first - low :].min(initial=np.inf))

    def band(self, first: int, end: int, halo: int) -> GBuffer:
        """Return rows `first` to before `end` with `halo` more on either side."""
        low, high = max(first - halo, 0), min(end + halo, self.size[0])
        count = end - first + 2 * halo
        arrays = {
            name: rows_with_padding(array, 0, first - halo - low, count, np.inf if name == "depth" else 0.0)
            for name, array in self._rows(low, high).items()
        }
        return band_with(self._outline, first, end, halo, arrays)

    def whole(self) -> GBuffer:
        """Return all of it."""
        return GBuffer(camera=self.camera, **self._rows(0, self.size[0]))  # type: ignore[arg-type]

    def seen_extent(self) -> float:
        """Return what `core.seen_extent.seen_extent` does of the whole image, from the same pixels."""
        height, width = self.size
        step = sparse_step(height * width)
        rows = [self._read(row, row + 1)["depth"][:, step // 2 :: step] for row in range(step // 2, height, step)]
        return seen_extent(self.camera, np.concatenate(rows))

    def each_band(
        self, technique: Technique, parameters: Mapping[str, Any], runtime: Runtime, most: int
    ) -> Iterator[FoundRows]:
        """Yield the results of a technique of ambient occlusion, band by band, in `most` bytes of memory."""
        arguments = dict(parameters)
        if arguments.get("radius") is None:
            arguments["radius"] = default_radius(self.seen_extent())
        in_bands = technique.function.in_bands  # type: ignore[attr-defined]
        plan = in_bands.plan(self._outline, runtime, arguments)
        device = most * PIXEL_BYTES // (PIXEL_BYTES + HOST_BYTES[self._has_normals])
        return each_band(in_bands.function, self, runtime, plan, device)


def _outline(camera: Camera) -> GBuffer:
    """Return a G-buffer of a camera whose arrays are of one row, at which nobody may look."""
    row = GBuffer(camera=camera.cropped(0, 0, camera.width, 1), depth=np.ones((1, camera.width), np.float32))
    object.__setattr__(row, "camera", camera)
    object.__setattr__(row, "band", Band(camera, (0, 0), 0))
    return row
