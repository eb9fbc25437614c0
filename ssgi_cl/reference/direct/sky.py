"""The sky's light through the open sectors of a slice, in float64."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.reference.ao.bitmask_ao import sector_of
from ssgi_cl.reference.ao.slices import Scan, Slice
from ssgi_cl.reference.gbuffer import Doubles


def looked_up(sky: Doubles, scan: Scan, plane: Slice, free: NDArray[np.bool_], cones: int) -> Doubles:
    """Return the mean radiance [rows, columns, 3] of a slice's sectors, 0 of those not `free`.

    Args:
        sky: map [size, size, 3] by octahedral direction.
        free: [rows, columns, sectors].
        cones: directions that are looked up.
    """
    total = np.zeros((*free.shape[:2], 3))
    for share, direction in cones_of(scan, plane, free, cones):
        total += share[..., None] * texel(sky, direction)
    return total


def cones_of(scan: Scan, plane: Slice, chosen: NDArray[np.bool_], cones: int) -> Iterator[tuple[Doubles, Doubles]]:
    """Yield the share of a slice's sectors that are `chosen` and in a cone, and its direction.

    Args:
        chosen: [rows, columns, sectors].
        cones: equal steps of the sine from the projected normal; directions are in world space.
    """
    sectors = chosen.shape[-1]
    number = np.arange(sectors)
    edges = [_sector(plane, 2.0 * i / cones - 1.0, sectors) for i in range(1, cones)]
    first = chosen[..., :1]
    edges = [np.zeros_like(first, int), *edges, np.full_like(first, sectors, int)]
    for cone in range(cones):
        share = (chosen & (number >= edges[cone]) & (number < edges[cone + 1])).mean(axis=-1)
        sine = (2.0 * cone + 1.0) / cones - 1.0
        yield share, _direction(scan, plane, *_turned(plane, sine))


def _turned(plane: Slice, sine: float) -> tuple[Doubles, Doubles]:
    """Return sine and cosine from the view ray of an angle from the projected normal."""
    cosine = np.sqrt(1.0 - sine * sine)
    return (plane.sin_normal * cosine + plane.cos_normal * sine, plane.cos_normal * cosine - plane.sin_normal * sine)


def _sector(plane: Slice, sine: float, sectors: int) -> NDArray[np.int64]:
    s, c = _turned(plane, sine)
    first = sector_of(c / np.maximum(s, 1e-30), plane, 1, count=sectors)
    second = sector_of(c / np.maximum(-s, 1e-30), plane, -1, count=sectors)
    return np.where(s >= 0.0, first, second)[..., None]


def _direction(scan: Scan, plane: Slice, s: Doubles, c: Doubles) -> Doubles:
    """Return the world-space direction in a slice with this sine and cosine."""
    view_ray = np.stack([*scan.slope, -np.ones_like(s)], axis=-1)
    view_ray = view_ray / np.linalg.norm(view_ray, axis=-1, keepdims=True)
    offset = np.stack([plane.cosine * scan.to_x, plane.sine * scan.to_y, np.zeros_like(s)], axis=-1)
    across = offset - np.sum(offset * view_ray, axis=-1, keepdims=True) * view_ray
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    view = across * s[..., None] - view_ray * c[..., None]
    result: Doubles = view @ scan.view.camera.view[:3, :3]
    return result


def texel(sky: Doubles, direction: Doubles) -> Doubles:
    """Return the map's radiance [..., 3] in directions [..., 3] of any length but 0."""
    size = len(sky)
    d = direction / np.sum(np.abs(direction), axis=-1, keepdims=True)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    u = np.where(y < 0.0, np.copysign(1.0 - np.abs(z), x), x)
    v = np.where(y < 0.0, np.copysign(1.0 - np.abs(x), z), z)
    column, row = (np.clip(((w + 1.0) * 0.5 * size).astype(int), 0, size - 1) for w in (u, v))
    result: Doubles = sky[row, column]
    return result
