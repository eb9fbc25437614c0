"""Which tiles are open, in float64 numpy: every pixel against every tangent plane within reach."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera

if TYPE_CHECKING:
    from ssgi_cl.techniques.tiles import Reach

TILE = 16
"""Pixels of a tile's side."""

Doubles = NDArray[np.float64]


def nearness(depth: Doubles, camera: Camera) -> Doubles:
    """Return v: 1 / depth (perspective) or -depth; -inf where nothing is."""
    there = np.isfinite(depth)
    safe = np.where(there, depth, 1.0)
    return np.where(there, -safe if camera.is_orthographic else 1.0 / safe, -np.inf)


def rises_reference(
    depth: NDArray[np.floating], normal: NDArray[np.floating], camera: Camera, reach_px: int
) -> Doubles:
    """Return by how much anything within a square of `reach_px` rises above each pixel's tangent
    plane, in v over that of the pixel; -inf where nothing is.

    Args:
        depth: [rows, columns].
        normal: [rows, columns, 3] view space, facing the viewer.
        camera: without a margin.
        reach_px: pixels on either side.
    """
    v = nearness(np.asarray(depth, np.float64), camera)
    rows, columns = v.shape
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    forward = 0.0 if camera.is_orthographic else 1.0
    n = np.asarray(normal, np.float64)
    result = np.full(v.shape, -np.inf)
    for y in range(rows):
        for x in range(columns):
            if v[y, x] == -np.inf:
                continue
            view_ray = np.array([(x + 0.5) * to_x + at_x, (y + 0.5) * to_y + at_y]) * forward
            n_dot_v = n[y, x, :2] @ view_ray - n[y, x, 2]
            scale = (v[y, x] if forward else 1.0) / n_dot_v
            top, bottom = max(y - reach_px, 0), min(y + reach_px + 1, rows)
            left, right = max(x - reach_px, 0), min(x + reach_px + 1, columns)
            plane = (
                v[y, x]
                + (np.arange(left, right) - x) * (n[y, x, 0] * to_x * scale)
                + ((np.arange(top, bottom) - y) * (n[y, x, 1] * to_y * scale))[:, None]
            )
            result[y, x] = np.max(v[top:bottom, left:right] - plane) / abs(v[y, x])
    return result


def by_tile(values: NDArray[np.floating], what: np.ufunc) -> Doubles:
    """Return [rows of tiles, columns of tiles] of pixels, reduced by `what`."""
    rows = np.arange(0, values.shape[0], TILE)
    columns = np.arange(0, values.shape[1], TILE)
    reduced: Doubles = what.reduceat(what.reduceat(values, rows, axis=0), columns, axis=1)
    return reduced


def too_far(depth: NDArray[np.floating], camera: Camera, reach: Reach) -> NDArray[np.bool_]:
    """Return in which pixels the radius covers less than a pixel, or nothing is."""
    to_x, to_y, _, _ = camera.pixel_to_view
    pixels = max(1.0 / abs(to_x), 1.0 / abs(to_y))
    far = np.ones_like(depth) if camera.is_orthographic else depth
    far_off: NDArray[np.bool_] = (reach.radius * pixels / far < reach.step) | ~np.isfinite(depth)
    return far_off
