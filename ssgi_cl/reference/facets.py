"""Planes of triangles from a depth image in float64, as kernels/direct/facet.clh defines them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.reference.gbuffer import Doubles

FLAT = 4e-6
"""Second difference on a plane at most, relative to the value."""
ALIKE = 0.2
"""Least cosine between the facet's normal and the interpolated one."""


def facets_reference(depth: NDArray[np.floating], normal: Doubles, camera: Camera) -> tuple[NDArray[np.bool_], Doubles]:
    """Return where the facet is known, and its normal [rows, columns, 3], the given one elsewhere.

    Args:
        depth: [rows, columns], without margin.
        normal: [rows, columns, 3], world space, unit length.
        camera: that sees them.
    """
    flat = camera.is_orthographic
    with np.errstate(divide="ignore", invalid="ignore"):
        value = depth.astype(np.float64) if flat else 1.0 / depth.astype(np.float64)
        value = np.where(np.isfinite(depth), value, np.inf)
        known_x, across = _change(value)
        flat_y, change_y = _change(value.T)
        known_y, down = flat_y.T, change_y.T
        sx, sy, ox, oy = camera.pixel_to_view
        a, b = across / sx, down / sy
        column, row = np.arange(depth.shape[1]) + 0.5, np.arange(depth.shape[0])[:, None] + 0.5
        w = value - a * (sx * column + ox) - b * (sy * row + oy)
        found = np.stack([a, b, np.ones_like(a)] if flat else [-a, -b, w], axis=-1)
        found /= np.linalg.norm(found, axis=-1, keepdims=True)
        found = found @ camera.view[:3, :3]
        cosine = np.sum(found * normal, axis=-1)
        known = known_x & known_y & (np.abs(cosine) > ALIKE)
    turned = found * np.sign(cosine)[..., None]
    return known, np.where(known[..., None], turned, normal)


def _change(value: Doubles) -> tuple[NDArray[np.bool_], Doubles]:
    """Return where the change from column to column is known, and the change."""
    padded = np.pad(value, ((0, 0), (2, 2)), constant_values=np.inf)
    columns = value.shape[1]
    near = [padded[:, i : i + columns] for i in range(5)]
    known, change = np.zeros(value.shape, np.bool_), np.zeros(value.shape)
    for first in (0, 2, 1):
        before, middle, after = near[first : first + 3]
        bend = np.abs(before + after - 2.0 * middle)
        is_flat = bend <= np.abs(value) * FLAT
        is_flat &= np.isfinite(value)
        change = np.where(is_flat, 0.5 * (after - before), change)
        known |= is_flat
    return known, change
