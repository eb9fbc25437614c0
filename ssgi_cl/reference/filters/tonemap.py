"""Tone mapping in float64, as defined in kernels/filters/tonemap.cl."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIDDLE_GREY = 0.18
"""Reflectance of a photographer's grey card (Reinhard et al. 2002, eq. 2)."""


def encoded_reference(radiance: ArrayLike, exposure: float, curve: str = "filmic") -> NDArray[np.float64]:
    """Return sRGB values in [0, 255], not rounded, of linear radiance of any shape."""
    value = np.maximum(np.asarray(radiance, np.float64) * exposure, 0.0)
    if curve == "filmic":
        value = np.minimum(value, 1e6)  # the curve is at its end long before
        value = value * (2.51 * value + 0.03) / (value * (2.43 * value + 0.59) + 0.14)
    value = np.minimum(value, 1.0)
    high = 1.055 * value ** (1.0 / 2.4) - 0.055
    return 255.0 * np.where(value <= 0.0031308, 12.92 * value, high)


def auto_exposure_reference(radiance: ArrayLike) -> float:
    """Return the exposure that brings the log-average luminance of all pixels to middle grey, at most what
    makes the highlight 2.5.

    The highlight is the 95th percentile of what is not black; luminances count as between 1/32 of it and itself.
    """
    luminance = np.asarray(radiance, np.float64) @ [0.2126, 0.7152, 0.0722]
    lit = luminance[luminance > 0.0]
    if not lit.size:
        return 1.0
    highlight = np.quantile(lit, 0.95, method="inverted_cdf")
    average = np.exp(np.log(np.clip(lit, highlight / 32.0, highlight)).mean())
    return float(min(MIDDLE_GREY / average, 2.5 / highlight))
