"""Planes of the triangles that receivers show, where normals differ from them, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

FLAT = 4e-6
"""Second difference on a plane at most, relative to the value."""
LEAST = 0.2
"""Least cosine between the facet's normal and the given one."""
SAME = 0.999
"""Cosine from which on they are taken for one."""


def tilted(view: SurfaceView) -> tuple[NDArray[np.bool_], Doubles]:
    """Return where the facet is known and not across the normal, and the facet's normal [rows, columns, 3].

    The normal is in view space; elsewhere it is the view's own. Margins are included.
    """
    there = np.isfinite(view.depth)
    value = np.where(there, view.flatness(np.where(there, view.depth, 1.0)), np.inf)
    row, column = view.centres()
    sx, sy = view.slopes(row, column)
    to_x, to_y = (a - b for a, b in zip(view.slopes(row + 1.0, column + 1.0), (sx, sy), strict=True))
    flat = view.camera.is_orthographic
    n = view.normal
    with np.errstate(invalid="ignore"):
        known_x, across = _change(value)
        known_y, down = _change(value.T)
        known_y, down = known_y.T, down.T
        a, b = across / to_x, down / to_y
        w = value - a * sx - b * sy
        facet = np.stack([a, b, np.ones_like(a)] if flat else [-a, -b, w], axis=-1)
        facet = facet / np.linalg.norm(facet, axis=-1, keepdims=True)
        cosine = np.sum(facet * n, axis=-1)
        # Depths that may be rounded to steps don't change at all between two of them.
        changes = (across != 0.0) | (down != 0.0) | view.exact
        known = there & known_x & known_y & changes & (cosine > LEAST) & (cosine < SAME)
    return known, np.where(known[..., None], facet, n)


def _change(value: Doubles) -> tuple[NDArray[np.bool_], Doubles]:
    """Return where the change from column to column is known, and the change."""
    padded = np.pad(value, ((0, 0), (2, 2)), constant_values=np.inf)
    near = [padded[:, i : i + value.shape[1]] for i in range(5)]
    known, change = np.zeros(value.shape, np.bool_), np.zeros(value.shape)
    for first in (0, 2, 1):
        before, middle, after = near[first : first + 3]
        is_flat = (np.abs(before + after - 2.0 * middle) <= np.abs(value) * FLAT) & np.isfinite(value)
        change = np.where(is_flat, 0.5 * (after - before), change)
        known |= is_flat
    return known, change
