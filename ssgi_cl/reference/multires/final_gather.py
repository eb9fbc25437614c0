"""Irradiance at points by rays to triangles whose radiance a volume has, in float64."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

BEFORE = 0.01
"""Cells before a surface at which the volume is looked up."""

TURNS = -0.5
"""Component z of normals below which the directions across them turn."""


def final_gather_reference(
    points: Doubles, normals: Doubles, ways: Doubles, corners: Doubles, sides: Doubles, low: Doubles, side: float
) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return irradiance [n, 3] in W/m^2 at points, and of which [n] a ray passes near an edge of what it meets.

    E = pi / rays sum L over the first triangles that rays meet, of the mean radiance of surfaces there.

    Args:
        points, normals: [n, 3], from where rays start.
        ways: [n, rays, 3] their directions, z along the normal; x and y as Duff et al. 2017, "Building an Orthonormal
            Basis, Revisited", say.
        corners: [triangles, 3, 3].
        sides: [cells, cells, cells, 6, 4] by z, y and x: radiance, W m^-2 sr^-1, of surfaces that face +x, -x,
            +y, -y, +z and -z, and their area.
        low, side: corner of least coordinates of the volume, and side of a cell.
    """
    x, y, z = normals.T
    sign = np.where(z > TURNS, 1.0, -1.0)
    a, b = -1.0 / (sign + z), -x * y / (sign + z)
    across = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    up = np.stack([b, sign + y * y * a, -y], axis=1)
    way = ways @ np.stack([across, up, normals], axis=1)
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    face = np.cross(one, two)
    irradiance, near = np.zeros((len(points), 3)), np.zeros(len(points), np.bool_)
    for i, (point, rays) in enumerate(zip(points, way, strict=True)):
        p = np.cross(rays[:, None], two)
        det = (p * one).sum(axis=2)
        det = np.where(np.abs(det) < 1e-12, 1e-12, det)
        s = point - corners[:, 0]
        q = np.cross(s, one)
        u, v = (s * p).sum(axis=2) / det, (rays[:, None] * q).sum(axis=2) / det
        t = (two * q).sum(axis=1) / det
        inside = np.minimum(np.minimum(u, v), 1.0 - u - v)
        distance = np.where((inside >= 0.0) & (t > 0.0), t, math.inf)
        nearest = distance.argmin(axis=1)
        length = distance.min(axis=1)
        met = np.isfinite(length)
        normal = face[nearest] / np.linalg.norm(face[nearest], axis=1, keepdims=True)
        normal *= np.sign((normal * rays).sum(axis=1))[:, None]
        place = (point + np.where(met, length, 0.0)[:, None] * rays - low) / side - BEFORE * normal
        at = np.clip(place, 0, len(sides) - 1e-9).astype(np.intp)
        there = sides[at[:, 2], at[:, 1], at[:, 0]]
        chosen = np.stack(
            [there[np.arange(len(rays)), 2 * axis + (normal[:, axis] > 0.0)] for axis in range(3)], axis=1
        )
        weight = np.abs(normal) * chosen[..., 3]
        radiance = (weight[..., None] * chosen[..., :3]).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-20)[:, None]
        irradiance[i] = math.pi / len(rays) * radiance[met].sum(axis=0)
        # Rays that another triangle's edge or a wall between cells decides about.
        edge = (np.abs(inside) < 1e-4) & (t > -1e-4) & (t < length[:, None] + 1e-4)
        near[i] = edge.any() or (np.abs(place - np.round(place)) < 1e-3)[met].any()
    return irradiance, near
