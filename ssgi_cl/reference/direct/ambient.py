"""Irradiance of environments in float64: the integral, and its interpolation on an octahedron."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ssgi_cl.core.lights import Environment
from ssgi_cl.reference.gbuffer import Doubles

FACE = 32
"""Edges of triangles along an edge of the octahedron."""
ROWS, COLUMNS = 64, 128
"""Parts that the interpolated model takes an image in, at least; each counts as one direction."""


def ambient_reference(environments: Sequence[Environment], normal: Doubles) -> Doubles:
    """Return E [..., 3] in W/m^2 as kernels interpolate it, for normals [..., 3] in world space.

    Images of more than 95 x 191 texels are taken in larger parts there than here.
    """
    flat = normal.reshape(-1, 3)
    steps = np.sum(np.abs(flat), axis=-1, keepdims=True)
    # Of barycentric coordinates on a face, scaled so that vertices are whole numbers, the fractions
    # sum to 0, 1 or 2: a vertex, a triangle with a vertex on top, or one with an edge on top.
    # Rounded, as what falls short of a vertex by 1e-15 has other sums.
    scaled = np.round(np.abs(flat) / np.where(steps > 0.0, steps, 1.0) * FACE, 9)
    whole = np.floor(scaled)
    part = scaled - whole
    inverted = np.rint(part.sum(axis=-1)) == 2.0
    sign = np.where(flat < 0.0, -1.0, 1.0)
    total = np.zeros((len(flat), 3))
    for axis in range(3):
        one = np.eye(3)[axis]
        corner = np.where(inverted[:, None], whole + 1.0 - one, whole + one)
        weight = np.where(inverted, 1.0 - part[:, axis], part[:, axis])
        # Where only a vertex counts, the weights are all 0.
        alone = part.sum(axis=-1) < 0.5
        corner[alone], weight[alone] = whole[alone], 1.0 / 3.0
        vertex, place = np.unique(sign * corner, axis=0, return_inverse=True)
        length = np.linalg.norm(vertex, axis=-1, keepdims=True)
        unit = vertex / np.where(length > 0.0, length, 1.0)
        found = irradiance(environments, unit, ROWS, COLUMNS)
        total += weight[:, None] * found[place.ravel()]
    result: Doubles = total.reshape(normal.shape)
    return result


def irradiance(environments: Sequence[Environment], normal: Doubles, rows: int = 90, columns: int = 180) -> Doubles:
    """Return E [n, 3] = Int L max(0, n.w) dw in W/m^2 for normals [n, 3] in world space.

    Args:
        environments: their light adds up.
        normal: of unit length.
        rows, columns: of equal steps in angle that each image is at least cut into. A step's light
            has the mean direction of its solid angle, which is exact but for steps that cross the
            receiver's horizon.
    """
    total = np.zeros((len(normal), 3))
    for environment in environments:
        radiance = np.asarray(environment.radiance, np.float64)
        if radiance.ndim == 1:
            total += np.pi * radiance
            continue
        image = np.repeat(radiance, math.ceil(rows / len(radiance)), axis=0)
        image = np.repeat(image, math.ceil(columns / radiance.shape[1]), axis=1)
        polar_step, step = np.pi / image.shape[0], 2.0 * np.pi / image.shape[1]
        polar = (np.arange(image.shape[0])[:, None] + 0.5) * polar_step
        azimuth = (np.arange(image.shape[1]) + 0.5) * step - np.pi
        # Int sin^2 p dp, Int sin p cos p dp and Int cos a da over a step round its middle.
        across = 0.5 * polar_step - 0.5 * np.cos(2.0 * polar) * np.sin(polar_step)
        along = 0.5 * np.sin(2.0 * polar) * np.sin(polar_step)
        chord = 2.0 * np.sin(0.5 * step)
        vector = np.stack(
            np.broadcast_arrays(across * chord * np.sin(azimuth), along * step, -across * chord * np.cos(azimuth)),
            axis=-1,
        ).reshape(-1, 3)
        lit = image.reshape(-1, 3)
        some = lit.any(axis=-1)
        vector, lit = np.ascontiguousarray(vector[some].T), lit[some]
        for first in range(0, len(normal), 16):
            cosine = normal[first : first + 16] @ vector
            total[first : first + 16] += np.maximum(cosine, 0.0, out=cosine) @ lit
    return total
