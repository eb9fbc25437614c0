"""Copies of one part at many places, and numbers for them that are the same on every machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..parts import Part

Doubles = NDArray[np.float64]


def shares(seed: int, *shape: int) -> Doubles:
    """Return [*shape] numbers in [0, 1) that depend on `seed` alone."""
    return unit_numbers(np.random.PCG64(seed), *shape)


def unit_numbers(bits: np.random.PCG64, *shape: int) -> Doubles:
    """Return the next [*shape] numbers in [0, 1) of a stream.

    They are made of raw bits, which numpy fixes for good; its distributions may change.
    """
    raw = bits.random_raw(int(np.prod(shape)))
    values: Doubles = (raw >> np.uint64(11)).astype(np.float64).reshape(shape) * 2.0**-53
    return values


def between(seed: int, low: float, high: float, *shape: int) -> Doubles:
    """Return numbers in [low, high)."""
    return low + (high - low) * shares(seed, *shape)


def rotation(axis: ArrayLike, angle: ArrayLike) -> Doubles:
    """Return [n, 3, 3] turns about axes [n, 3] or [3], of any length, by angles [n] in radians."""
    turn = np.atleast_1d(np.asarray(angle, np.float64))
    about = np.broadcast_to(np.asarray(axis, np.float64), (len(turn), 3))
    x, y, z = (about / np.linalg.norm(about, axis=1, keepdims=True)).T
    nothing = np.zeros_like(x)
    cross = np.stack([nothing, -z, y, z, nothing, -x, -y, x, nothing], axis=-1).reshape(-1, 3, 3)
    sine, cosine = np.sin(turn)[:, None, None], np.cos(turn)[:, None, None]
    result: Doubles = np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross
    return result


def about_x(angle: float) -> Doubles:
    """Return the [3, 3] rotation about the x axis by an angle in radians, +y towards +z."""
    (turn,) = rotation((1.0, 0.0, 0.0), angle)
    return np.asarray(turn)


def about_y(angle: float) -> Doubles:
    """Return the [3, 3] rotation about the y axis by an angle in radians, +z towards +x."""
    (turn,) = rotation((0.0, 1.0, 0.0), angle)
    return np.asarray(turn)


def copies(
    part: Part,
    places: ArrayLike,
    *,
    turns: Doubles | None = None,
    scales: ArrayLike = 1.0,
    tints: Doubles | None = None,
) -> Part:
    """Return one part with a copy of `part` for each place.

    Args:
        part: with unit normals, see `complete`.
        places: [n, 3] where its origin goes, metres.
        turns: [n, 3, 3] rotations.
        scales: > 0, a number, [n] or, along the part's own axes, [n, 3].
        tints: [n, 3] linear vertex colours.
    """
    at = np.asarray(places, np.float64)
    count, vertices = len(at), len(part.positions)
    turn = np.broadcast_to(np.eye(3), (count, 3, 3)) if turns is None else turns
    scale = np.asarray(scales, np.float64)
    scale = np.broadcast_to(scale[:, None] if scale.ndim == 1 else scale, (count, 3))
    if part.normals is None:
        raise ValueError(f"{part.name} has no normals: expected a completed part")
    positions = np.einsum("nij,nj,vj->nvi", turn, scale, part.positions) + at[:, None, :]
    normals = np.einsum("nij,nj,vj->nvi", turn, 1.0 / scale, part.normals)
    first = vertices * np.arange(count)[:, None, None]
    return replace(
        part,
        positions=positions.reshape(-1, 3),
        normals=normals.reshape(-1, 3),
        triangles=(part.triangles + first).reshape(-1, 3),
        material_ids=np.tile(part.material_ids, count),
        colors=None if tints is None else np.repeat(tints, vertices, axis=0),
        uvs=None,
    )


def noise(seed: int, x: Doubles, y: Doubles) -> Doubles:
    """Return smooth values in [0, 1) at (x, y), one independent value for each unit square."""
    column, row = np.floor(x), np.floor(y)
    u, v = x - column, y - row
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    table = shares(seed, 64, 64)

    def at(i: int, j: int) -> Doubles:
        values: Doubles = table[(row.astype(int) + j) % 64, (column.astype(int) + i) % 64]
        return values

    below = at(0, 0) * (1.0 - u) + at(1, 0) * u
    above = at(0, 1) * (1.0 - u) + at(1, 1) * u
    return below * (1.0 - v) + above * v
