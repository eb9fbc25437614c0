"""Results and their errors as pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.io.previews import share_view
from ssgi_cl.reference.filters.tonemap import encoded_reference
from ssgi_cl.techniques.filters.tonemap import auto_exposure

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

OCCLUSION_RANGE = 0.25
"""Difference of A at the ends of an error map's scale."""
LIGHT_RANGE = 0.5
"""Relative difference of luminance at the ends of an error map's scale."""
DARK_SHARE = 0.01
"""Of the mean luminance: what is added to the truth that a difference is divided by."""
LEVELS = 17
"""Steps of an error map's scale: enough to read, few enough to pack well."""
TOO_DARK, JUST, TOO_BRIGHT = (((12, 44, 110), (64, 138, 214)), (246, 246, 246), ((240, 142, 40), (128, 48, 0)))
"""RGB from the ends to the middle: blue and orange, which no common colour blindness confuses."""
_NOTHING = (128, 128, 128)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def scale() -> NDArray[np.uint8]:
    """Return [LEVELS, 3]: the colours of an error map from too dark to too bright."""
    stops = np.array([*TOO_DARK, JUST, *TOO_BRIGHT], np.float64)
    where = np.linspace(0.0, len(stops) - 1.0, LEVELS)
    colors = [np.interp(where, np.arange(len(stops)), stops[:, c]) for c in range(3)]
    return np.rint(np.stack(colors, axis=-1)).astype(np.uint8)


def exposure_of(truth: Floats, seen: Mask) -> float:
    """Return what to multiply irradiance with so that the truth is well lit.

    The log-average luminance of what is seen and not black becomes middle grey.
    """
    return auto_exposure(np.where(seen[..., None], _finite(truth), np.float32(0.0)))


def encoded(image: Floats, exposure: float) -> NDArray[np.uint8]:
    """Return what a screen shows, [rows, columns] or [rows, columns, 3].

    Args:
        image: [rows, columns], a share: black is 0 and white 1, without gamma; or
            [rows, columns, 3], light: multiplied by the exposure, then the library's filmic curve
            and sRGB. What is not finite is black.
        exposure: of light.
    """
    image = _finite(image)
    if image.ndim == 2:
        return share_view(image)
    return np.rint(encoded_reference(image, exposure)).astype(np.uint8)


def error_colors(image: Floats, truth: Floats, seen: Mask) -> NDArray[np.uint8]:
    """Return [rows, columns, 3]: blue is too dark, orange too bright, grey not compared.

    Of shares the difference, of light the difference of luminance over that of the truth, to which
    1 % of its mean is added so that black pixels have an error too. Ends of the scale are
    `OCCLUSION_RANGE` and `LIGHT_RANGE`.
    """
    value, reference = (_finite(array).astype(np.float64) for array in (image, truth))
    if value.ndim == 2:
        share = (value - reference) / OCCLUSION_RANGE
    else:
        value, reference = value @ _LUMINANCE, reference @ _LUMINANCE
        base = DARK_SHARE * float(reference[seen].mean()) if seen.any() else 0.0
        share = (value - reference) / np.maximum(reference + base, 1e-30) / LIGHT_RANGE
    level = np.rint((np.clip(share, -1.0, 1.0) + 1.0) * 0.5 * (LEVELS - 1)).astype(np.uint8)
    level[~seen] = LEVELS
    colors: NDArray[np.uint8] = np.concatenate([scale(), np.array([_NOTHING], np.uint8)])[level]
    return colors


def _finite(image: Floats) -> Floats:
    return np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
