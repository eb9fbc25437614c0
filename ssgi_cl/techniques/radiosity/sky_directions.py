"""Partition of the sphere by solid angle and flux, a direction for each part.

Surfels look up the visibility of every part, dark ones too. `core.environment_samples` has
directions of equal flux, none of them dark, for depth maps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.environment_samples import solid_angles, summed
from ssgi_cl.core.lights import Environment
from ssgi_cl.core.vpls import LUMINANCE

Doubles = NDArray[np.float64]

LEAST_ROWS = 32
"""Least rows of an image that directions are chosen from: coarser ones are repeated to it."""


def sky_directions(environments: Sequence[Environment], count: int) -> tuple[Doubles, Doubles, Doubles]:
    """Return directions, solid angles and mean radiance of parts of the sphere.

    Half of the parts' measure is solid angle, half luminous flux: what is bright is divided
    further. Parts are pieces of a latitude-longitude image along a curve; each one's direction is
    the mean of its texels by luminance.

    Args:
        environments: any number; they are summed.
        count: of parts, >= 2.

    Returns:
        Unit vectors [count, 3] in world space, sr [count] with sum 4 pi, and W m^-2 sr^-1
        [count, 3].
    """
    constant, images = np.zeros(3), []
    for environment in environments:
        radiance = np.asarray(environment.radiance, np.float64)
        if radiance.ndim == 1:
            constant = constant + radiance
        else:
            images.append(radiance)
    if not images:
        return _sphere(count), np.full(count, 4.0 * math.pi / count), np.tile(constant, (count, 1))
    return _parts(summed(images, (LEAST_ROWS, 2 * LEAST_ROWS), constant), count)


def _sphere(count: int) -> Doubles:
    """Return [count, 3] points of a Fibonacci spiral."""
    number = np.arange(count) + 0.5
    y = 1.0 - 2.0 * number / count
    angle = number * math.pi * (3.0 - math.sqrt(5.0))
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.cos(angle), y, radius * np.sin(angle)], axis=1)


def _parts(image: Doubles, count: int) -> tuple[Doubles, Doubles, Doubles]:
    rows, columns = image.shape[:2]
    solid = np.repeat(solid_angles(rows, columns), columns)
    polar = (np.arange(rows) + 0.5) * (math.pi / rows)
    # The middle column looks down -z, columns run to +x.
    around = ((np.arange(columns) + 0.5) / columns - 0.5) * (2.0 * math.pi)
    ways = np.empty((rows, columns, 3))
    ways[..., 0] = np.sin(polar)[:, None] * np.sin(around)
    ways[..., 1] = np.cos(polar)[:, None]
    ways[..., 2] = -np.sin(polar)[:, None] * np.cos(around)
    radiance, flat = image.reshape(-1, 3), ways.reshape(-1, 3)
    scale = max(float(radiance.max()), 1e-300)
    flux = (radiance / scale) @ LUMINANCE * solid
    measure = solid / (4.0 * math.pi) + flux / max(float(flux.sum()), 1e-300)
    order = _strips(rows, columns, max(int(math.sqrt(count / 2)), 1))
    ends = np.cumsum(measure[order])
    part = np.minimum((ends - 0.5 * measure[order]) / ends[-1] * count, count - 1).astype(np.intp)
    sums = np.zeros((count, 8))
    weight = flux + 1e-6 * solid * max(float(flux.sum()), 1e-300)
    values = np.column_stack([solid, radiance / scale * solid[:, None], flat * weight[:, None], weight])[order]
    np.add.at(sums, part, values)
    sums = sums[sums[:, 0] > 0.0]
    way = sums[:, 4:7]
    length = np.maximum(np.sqrt(np.sum(way**2, axis=1, keepdims=True)), 1e-300)
    return way / length, sums[:, 0], sums[:, 1:4] / sums[:, :1] * scale


def _strips(rows: int, columns: int, strips: int) -> NDArray[np.intp]:
    """Return the order of texels in horizontal strips, each column of a strip after the other."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    strip = row * strips // rows
    back = np.where(strip % 2, columns - 1 - column, column)
    up = np.where(back % 2, rows - 1 - row, row)
    return np.lexsort((up, back, strip))
