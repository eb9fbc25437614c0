"""Smooth edges in float64, place by place as `kernels/filters/smooth_edges.cl` defines them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

Numbers = NDArray[np.int32]

FAR = 1e4
OTHER_MATERIAL = 4.0
APART = 0.05
OWN = 0.1
NEVER = 1e6


def smooth_edges_reference(
    radiance: ArrayLike,
    view: SurfaceView,
    centres: Numbers,
    triangles: Numbers,
    depths: ArrayLike,
    places: ArrayLike,
    materials: Numbers,
) -> Doubles:
    """Return the mean of what is seen at places of each pixel, [rows, columns, channels].

    Args:
        radiance: [rows, columns, channels].
        view: the surfaces at pixel centres, without a margin.
        centres: [rows, columns] triangles there, -1 where none is.
        triangles: [places, rows, columns] likewise at each place.
        depths: likewise, scene units.
        places: [places, 2] pixels right of and below the centre.
        materials: of each triangle.
    """
    light, offsets = np.asarray(radiance, np.float64), np.asarray(places, np.float64)
    reach = range(-2, 3)
    steps = sorted(((dy, dx) for dy in reach for dx in reach), key=lambda step: (max(map(abs, step)), step))
    near = sum(max(map(abs, step)) < 2 for step in steps)
    total = np.zeros_like(light)
    for triangle, depth, place in zip(triangles, np.asarray(depths, np.float64), offsets, strict=True):
        scores = np.stack([_score(view, centres, triangle, depth, place, materials, step) for step in steps])
        best = np.argmin(scores[:near], axis=0)
        lost = scores[:near].min(axis=0) >= OTHER_MATERIAL
        best = np.where(lost, np.argmin(scores, axis=0), best)
        best = np.where((triangle == centres) | (scores[0] <= OWN), 0, best)
        lights = np.stack([_moved(light, step, 0.0) for step in steps])
        total += np.take_along_axis(lights, best[None, ..., None], axis=0)[0]
    return total / len(offsets)


def _moved(array: NDArray[Any], step: tuple[int, int], beyond: float) -> NDArray[Any]:
    """Return what pixels `step` rows and columns away have; `beyond` the image a value."""
    rows, columns = array.shape[:2]
    around = np.pad(array, [(2, 2), (2, 2), *[(0, 0)] * (array.ndim - 2)], constant_values=beyond)
    return around[2 + step[0] : 2 + step[0] + rows, 2 + step[1] : 2 + step[1] + columns]


def _score(
    view: SurfaceView,
    centres: Numbers,
    triangle: Numbers,
    depth: Doubles,
    place: Doubles,
    materials: Numbers,
    step: tuple[int, int],
) -> Doubles:
    """Return how badly the pixels `step` away show what is seen at a place; infinite beyond the image."""
    camera = view.camera
    sx, sy, ox, oy = camera.pixel_to_view
    row, column = np.indices(centres.shape) + 0.5

    def point(right: Doubles, down: Doubles, deep: Doubles) -> Doubles:
        k = np.ones_like(deep) if camera.is_orthographic else deep
        return np.stack([(sx * right + ox) * k, (sy * down + oy) * k, -deep], axis=-1)

    seen = _moved(centres, step, -1)
    both = (seen >= 0) & (triangle >= 0)
    own = np.where(triangle >= 0, depth, 1.0)
    other = np.where(both, _moved(view.depth, step, 1.0), own)
    extent = abs(sy) * (1.0 if camera.is_orthographic else own)
    away = point(column + place[0], row + place[1], own) - point(column + step[1], row + step[0], other)
    height = np.abs((_moved(view.normal, step, 0.0) * away).sum(axis=-1)) / extent
    unlike = materials[np.maximum(seen, 0)] != materials[np.maximum(triangle, 0)]
    score = np.where(both, np.minimum(height, FAR) + OTHER_MATERIAL * unlike, NEVER)
    score = np.where(seen == triangle, 0.0, score)
    score = score + APART * ((step[1] - place[0]) ** 2 + (step[0] - place[1]) ** 2)
    inside = _moved(np.ones(centres.shape), step, 0.0) > 0.0
    return np.where(inside, score, np.inf)
