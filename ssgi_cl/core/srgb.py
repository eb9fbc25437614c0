"""The transfer function of sRGB, in which pictures and textures are stored."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_to_linear(encoded: ArrayLike) -> NDArray[np.float64]:
    """Return the linear value of sRGB-encoded numbers in [0, 1] (IEC 61966-2-1)."""
    value = np.asarray(encoded, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.abs(value) + 0.055) / 1.055) ** 2.4)
