"""Bands of a G-buffer: some rows of its image, with more round them that are read alone."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera

if TYPE_CHECKING:
    from ssgi_cl.core.gbuffer import GBuffer

_LAYERED = {"depth": 2, "normal": 3, "albedo": 3, "emission": 3, "specular": 3, "gloss": 2, "thickness": 2, "motion": 3}
"""Arrays of a G-buffer, and their dimensions without layers."""


@dataclass(frozen=True)
class Band:
    """Where in an image the rows of a G-buffer lie.

    Attributes:
        camera: of the whole image.
        margin: (rows, columns) of the whole G-buffer.
        first: row of the whole G-buffer's arrays that is the first of the band's; negative where the band
            begins outside of them.
    """

    camera: Camera
    margin: tuple[int, int]
    first: int

    @property
    def rows(self) -> int:
        """Rows of the whole G-buffer's arrays."""
        return self.camera.height + 2 * self.margin[0]


def band_of(gbuffer: GBuffer, first: int, end: int, halo: int) -> GBuffer:
    """Return rows `first` to before `end` of a G-buffer's image, as one of their own.

    Its margin is `halo` rows more than that of the G-buffer; nothing is in those that lie outside of the
    arrays. Arrays are views, unless there are such rows.

    Techniques give these rows the bits that they have in the whole image, if `first` is a multiple of the
    rows after which their pattern repeats, and `halo` reaches as far as they read.
    """
    top = first - halo
    rows = end - first + 2 * (gbuffer.margin[0] + halo)
    arrays = {}
    for name, dimensions in _LAYERED.items():
        array = getattr(gbuffer, name)
        if array is not None:
            axis = array.ndim - dimensions
            arrays[name] = rows_with_padding(array, axis, top, rows, np.inf if name == "depth" else 0.0)
    return band_with(gbuffer, first, end, halo, arrays)


def band_with(gbuffer: GBuffer, first: int, end: int, halo: int, arrays: dict[str, NDArray[Any]]) -> GBuffer:
    """Return a band as `band_of` does, whose arrays are given and checked already."""
    camera, margin = gbuffer.camera, gbuffer.margin
    fields = {
        **arrays,
        "camera": camera.cropped(0, first, camera.width, end - first),
        "margin": (margin[0] + halo, margin[1]),
        "band": Band(camera, margin, first - halo),
        "array_kind": None,
        "notes": (),
    }
    part = copy(gbuffer)
    for name, value in fields.items():
        object.__setattr__(part, name, value)
    return part


def rows_with_padding(array: NDArray[Any], axis: int, first: int, rows: int, outside: float) -> NDArray[Any]:
    """Return `rows` rows of an array from row `first` on, along `axis`; `outside` where it has none."""
    end = first + rows
    whole = array.shape[axis]
    cut = (slice(None),) * axis + (slice(max(first, 0), min(end, whole)),)
    before, after = max(-first, 0), max(end - whole, 0)
    if not before and not after:
        return array[cut]
    widths = [(before, after) if each == axis else (0, 0) for each in range(array.ndim)]
    return np.pad(array[cut], widths, constant_values=outside)
