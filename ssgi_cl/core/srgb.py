"""The transfer function of sRGB, in which pictures and textures are stored."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_to_linear(encoded: ArrayLike) -> NDArray[np.float64]:
    """Return the linear value of sRGB-encoded numbers in [0, 1] (IEC 61966-2-1)."""
    value = np.asarray(encoded, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.abs(value) + 0.055) / 1.055) ** 2.4)


BYTES = srgb_to_linear(np.arange(256) / 255.0)
"""[256] float64: the linear value of each byte."""


def mean_color(texture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return [3] float64: the mean linear colour of an sRGB-encoded texture [rows, columns, 3 or more]."""
    counts = [np.bincount(texture[..., channel].ravel(), minlength=256) for channel in range(3)]
    return np.array([BYTES @ count / count.sum() for count in counts])
