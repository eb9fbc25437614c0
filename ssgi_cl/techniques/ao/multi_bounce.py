"""Multiple bounces of ambient light, from ambient occlusion and albedo alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.device.constants import (
    SHADE_CUBE_CONSTANT,
    SHADE_CUBE_SLOPE,
    SHADE_LINE_CONSTANT,
    SHADE_LINE_SLOPE,
    SHADE_SQUARE_CONSTANT,
    SHADE_SQUARE_SLOPE,
)

SCALE = (
    (SHADE_CUBE_SLOPE, SHADE_CUBE_CONSTANT),
    (SHADE_SQUARE_SLOPE, SHADE_SQUARE_CONSTANT),
    (SHADE_LINE_SLOPE, SHADE_LINE_CONSTANT),
)
"""Factors of A^3, A^2 and A: (slope, constant) over the albedo."""


@checked_keywords
def multi_bounce(ao: ArrayLike, albedo: ArrayLike) -> NDArray[np.float32]:
    """Brighten A by the light that nearby occluders reflect.

    The cubic that Jimenez et al. 2016 ("Practical Realtime Strategies for Accurate Indirect
    Occlusion") fitted to paths traced in scenes of a single albedo: good where
    neighbouring surfaces are of similar colour. Never below A, and 1 where A is.

    As published.

    Args:
        ao: A [rows, columns] in [0, 1].
        albedo: [rows, columns, 3] linear reflectance in [0, 1], or one RGB for all pixels, or one
            number.

    Returns:
        [rows, columns, 3] float32 in [0, 1], a factor of ambient light in each colour.

    Raises:
        TypeError, ValueError: an array that is not of real numbers, a wrong shape, or a value that
            is NaN or out of range; the message says which.
    """
    a = checks.plane("ao", ao, low=0.0, high=1.0)[..., None]
    if np.ndim(albedo) < 2:
        colour = checks.rgb("albedo", albedo, "reflectance")
        if (colour > 1.0).any():
            raise ValueError(f"albedo is {colour.tolist()}: expected numbers >= 0 and <= 1 (reflectance)")
        albedo = np.broadcast_to(colour, (*a.shape[:2], 3))
    rho = checks.plane("albedo", albedo, channels=3, low=0.0, high=1.0, unit="reflectance")
    if rho.shape[:2] != a.shape[:2]:
        raise ValueError(f"albedo has shape {rho.shape}: expected {(*a.shape[:2], 3)} as ao")
    cube, square, line = (rho * np.float32(s) + np.float32(c) for s, c in SCALE)
    # At A = 1 the fit is up to 1.0001.
    brightened: NDArray[np.float32] = np.clip(((cube * a + square) * a + line) * a, a, 1.0)
    return brightened
