"""A line fitted to what is found at 5 x 5 points of a lattice, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

WIDE = 2
"""Neighbours on each side."""
REACH = 0.3
"""Distance at which a neighbour counts nothing, in harmonic mean distances of what its rays meet."""
ALONG, SLOPE = 0.8, 2.0
"""The same where the harmonic mean distance stays the same, as along an edge, and 1 / its change over the distance at
which that counts nothing."""
OFF = 4.0
"""1 / the height above the plane, in distances, at which it counts nothing."""
ALIKE = 20.0
"""1 / (1 - cosine of the angle between normals) at which it counts nothing."""
STEADY = 1.0
"""Added to the sums of squared lattice steps."""


def gather_smooth_reference(points: Doubles, normals: Doubles, found: Doubles, near: Doubles, rays: Doubles) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2, 0 where no surface is and where no rays were.

    Args:
        points: [rows, columns, 3], infinite where no surface is.
        normals: [rows, columns, 3] of unit length.
        found: [rows, columns, 3] in W/m^2.
        near: [rows, columns] mean of 1 / distance of what rays of a point meet, 1 / units of `points`.
        rays: [rows, columns] how many rays a point has.
    """
    rows, columns = near.shape
    there = np.isfinite(points[..., 0]) & (rays > 0.0)
    result = np.zeros((rows, columns, 3))
    for row, column in np.argwhere(there):
        design, light, weights = [], [], []
        for y in range(max(row - WIDE, 0), min(row + WIDE + 1, rows)):
            for x in range(max(column - WIDE, 0), min(column + WIDE + 1, columns)):
                way = points[y, x] - points[row, column]
                distance = float(np.linalg.norm(way))
                weight = 1.0
                if not there[y, x]:
                    continue
                if distance > 0.0:
                    up = abs(float(way @ normals[row, column])) / distance
                    alike = float(normals[y, x] @ normals[row, column])
                    pair = near[row, column], near[y, x]
                    slope = abs(pair[0] - pair[1]) / max(pair[0] * pair[1], 1e-300) / distance
                    along = (1.0 - distance * max(pair) / ALONG) * (1.0 - min(SLOPE * slope, 1.0))
                    weight = max(max(1.0 - distance * max(pair) / REACH, along) - OFF * up, 0.0)
                    weight *= min(max(1.0 - ALIKE * (1.0 - alike), 0.0), 1.0)
                design.append((1.0, x - column, y - row))
                light.append(found[y, x])
                weights.append(weight * rays[y, x] / rays[row, column])
        a, w = np.array(design), np.array(weights)[:, None]
        normal = a.T @ (w * a) + np.diag((0.0, STEADY, STEADY))
        result[row, column] = np.maximum(np.linalg.solve(normal, a.T @ (w * np.array(light)))[0], 0.0)
    return result
