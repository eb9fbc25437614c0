"""Random numbers and directions that make a Monte-Carlo estimate: the same in every run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

TILE_ORDER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
"""Bayer's order of the pixels of a tile: those close in number lie far apart."""

DEPTH_BIAS = 2e-6
"""Bias relative to depth: some roundings of a float32 position (2^-24 each)."""


def r_points(first: int, last: int, dimensions: int) -> NDArray[np.float64]:
    """Return points `first` to `last` of the R sequence (Roberts 2018) in [0, 1)^dimensions."""
    root = 2.0  # to be that of g^(dimensions + 1) = g + 1; each step brings it 3 times nearer
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1.0))
    steps = root ** -np.arange(1.0, dimensions + 1.0)
    points: NDArray[np.float64] = np.arange(first + 1, last + 1)[:, None] * steps
    points -= np.floor(points)
    return points


def r2_points(first: int, last: int) -> Floats:
    """Return points `first` to `last` of the R sequence in [0, 1)^2, as float32."""
    return r_points(first, last, 2).astype(np.float32)


def hashed(keys: NDArray[np.uint64], seed: int = 0) -> Floats:
    """Return a number in [0, 1) for each of `keys`: the same for the same key, as if at random.

    Another seed, 0 to 2^63 - 1, gives numbers that have nothing to do with those of the first.
    """
    state = _mixed((keys ^ _mixed(np.array([seed], np.uint64))) * np.uint64(0x9E3779B97F4A7C15))
    numbers: Floats = (state >> np.uint64(40)).astype(np.float32) * np.float32(2.0**-24)
    return numbers


def _mixed(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return splitmix64's finaliser (Steele et al. 2014), which maps 0 to 0."""
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        state = (state ^ (state >> np.uint64(shift))) * np.uint64(factor)
    mixed: NDArray[np.uint64] = state ^ (state >> np.uint64(31))
    return mixed


def wrapped(values: Floats) -> Floats:
    """Return `values` in [0, 2), moved to [0, 1) in place."""
    values -= values >= 1.0
    return values


def basis(axis: Floats) -> tuple[Floats, Floats, Floats]:
    """Return three unit vectors [n, 3] at right angles of which the last is `axis`.

    Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    x, y, z = axis.T
    sign = np.copysign(np.float32(1.0), z)
    a = np.float32(-1.0) / (sign + z)
    b = x * y * a
    first = np.stack([np.float32(1.0) + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return first, second, axis


def directions(u: Floats, v: Floats, axes: tuple[Floats, Floats, Floats], weighting: str) -> Floats:
    """Return [..., n, 3] unit vectors of hemispheres from u, v [..., n] in [0, 1)."""
    one = np.float32(1.0)
    if weighting == "cosine":
        ring, height = np.sqrt(u), np.sqrt(one - u)
    else:
        height = one - u
        ring = np.sqrt(u * (one + height))
    angle = np.float32(2.0 * math.pi) * v
    east, north = ring * np.cos(angle), ring * np.sin(angle)
    way = np.empty((*u.shape, 3), np.float32)
    for d in range(3):
        way[..., d] = east * axes[0][:, d] + north * axes[1][:, d] + height * axes[2][:, d]
    return way
