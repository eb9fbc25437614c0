"""The size of what a camera sees, from depths: the measure of radii."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import RadiusWarning

RADIUS_SHARE = 0.05
"""Radius of ambient occlusion where none is given, as a share of the picture's diagonal at what is seen."""
TOO_NEAR = 0.05
"""Share of the surfaces seen that are passed over, the nearest: a leaf before the lens."""
_MOST_SAMPLES = 2_500


def seen_extent(camera: Camera, depth: NDArray[Any]) -> float:
    """Return the diagonal of the picture at the distance of what is seen, in scene units; inf if nothing is.

    The distance is the harmonic mean of depths: what is near counts most, a distant backdrop
    little, and no single pixel makes it jump when the camera moves.

    Args:
        camera: that saw the depths; of an orthographic one they do not matter.
        depth: linear view depths; +inf where nothing is.
    """
    across = math.hypot(*(2.0 / np.diag(camera.projection)[:2]))
    if camera.is_orthographic:
        return across
    seen = np.sort(depth[np.isfinite(depth)].astype(np.float64))
    seen = seen[int(TOO_NEAR * len(seen)) :]
    return across / float((1.0 / seen).mean()) if len(seen) else math.inf


def default_radius(extent: float) -> float:
    """Return the radius of ambient occlusion for what `seen_extent` returned, scene units; 1 where nothing is seen."""
    return RADIUS_SHARE * extent if math.isfinite(extent) else 1.0


def sparse_step(pixels: int) -> int:
    """Return the step of `sparse` in a depth map of so many pixels."""
    return max(1, round(math.sqrt(pixels / _MOST_SAMPLES)))


def sparse(depth: NDArray[Any]) -> NDArray[Any]:
    """Return two thousand values of a depth map [rows, columns], evenly spread."""
    step = sparse_step(depth.size)
    return depth[step // 2 :: step, step // 2 :: step]


def warn_of_radius(radius: float, camera: Camera, depth: NDArray[Any]) -> None:
    """Warn of a radius that reaches less than a pixel, or over the whole image, at the distance of what is seen."""
    extent = seen_extent(camera, sparse(depth))
    if not (math.isfinite(extent) and isinstance(radius, (int, float)) and 0.0 < radius < math.inf):
        return
    diagonal = math.hypot(camera.width, camera.height)
    pixels = diagonal * radius / extent
    if pixels < 1.0 or radius > extent:
        warnings.warn(
            f"radius is {radius:g} scene units, {pixels:.3g} pixels where most surfaces are seen: expected 1 to "
            f"{diagonal:.0f} pixels, such as radius={RADIUS_SHARE * extent:.3g}",
            RadiusWarning,
            stacklevel=6,
        )
