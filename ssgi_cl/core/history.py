"""The history of a value over frames: its means, how many frames they stand for, and where they begin anew."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks


class Reset(IntFlag):
    """Reasons for which the history of a pixel begins anew: each tap that counts failed one of these tests."""

    FIRST = 1
    """There is no history: the first frame, or a cut."""
    NOTHING = 2
    """No surface is in the pixel."""
    BORDER = 4
    """A tap lies outside of the previous image, or the surface was behind its camera."""
    EMPTY = 8
    """No surface was there."""
    PLANE = 16
    """The surface there lies off the tangent plane."""
    LAYER = 32
    """A deeper layer fits better: the surface was hidden."""
    NORMAL = 64
    """Its normal is another."""
    CHANGED = 128
    """Not begun anew: the mean was no longer right and moved, and stands for few frames from here on."""


@dataclass(frozen=True, eq=False)
class History:
    """What `accumulate` knows of each pixel of a frame; the next call takes it. Row 0 on top.

    Attributes:
        mean: [rows, columns] or [rows, columns, 3] float32, over up to `limit` frames: the result itself.
        fast: likewise, over up to `fast` frames.
        square: likewise, the mean of squares, over as many frames as `mean`.
        count: [rows, columns] float32 >= 1, frames that `mean` stands for; between whole numbers where taps of
            several counts were joined.
        reasons: [rows, columns] uint8, sums of `Reset`; 0 where the history goes on as it was.

    Raises:
        TypeError: an array is not of real numbers.
        ValueError: shapes that differ.
    """

    mean: NDArray[Any]
    fast: NDArray[Any]
    square: NDArray[Any]
    count: NDArray[Any]
    reasons: NDArray[np.uint8]

    def __post_init__(self) -> None:
        shape = np.shape(self.mean)
        for name in ("mean", "fast", "square", "count", "reasons"):
            array = checks.as_array(name, getattr(self, name))
            if array.dtype.kind not in "fiu":
                raise TypeError(f"{name} has dtype {array.dtype}: expected a real array")
            wanted = shape[:2] if name in ("count", "reasons") else shape
            if len(shape) not in (2, 3) or shape[2:] not in ((), (3,)) or array.shape != wanted:
                raise ValueError(
                    f"{name} has shape {array.shape}: expected {wanted}, of a mean [rows, columns] or with 3 channels"
                )

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns)"""
        rows, columns = self.count.shape
        return rows, columns

    @property
    def variance(self) -> NDArray[Any]:
        """Variance of the value over the frames of `mean`, of its shape; of one frame 0."""
        result: NDArray[Any] = np.maximum(self.square - self.mean * self.mean, 0.0)
        return result

    @property
    def standard_error(self) -> NDArray[Any]:
        """Standard error of `mean` if frames are independent, of its shape; +inf of one frame."""
        count = self.count if self.mean.ndim == 2 else self.count[..., None]
        frames = np.broadcast_to(count, self.mean.shape)
        with np.errstate(divide="ignore"):
            error: NDArray[Any] = np.where(
                frames > 1.0, np.sqrt(self.variance / np.maximum(frames - 1.0, 1e-6)), np.inf
            )
        return error

    @property
    def begun(self) -> NDArray[np.bool_]:
        """[rows, columns] whether the pixel began anew in this frame."""
        result: NDArray[np.bool_] = (self.reasons & ~np.uint8(Reset.CHANGED)) != 0
        return result

    def because(self, reason: Reset) -> NDArray[np.bool_]:
        """Return [rows, columns], whether a reason is among those of each pixel."""
        result: NDArray[np.bool_] = (self.reasons & np.uint8(reason)) != 0
        return result
