"""Shapes of the built-in and generated scenes, each a part with outward normals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..parts import Part, complete


def grid(points: NDArray[np.float64], *, closed: bool = False, name: str = "grid") -> Part:
    """Join neighbours of `points` [rows, columns, 3]; the front is columns' way x rows' way.

    With `closed` the last column is joined to the first.
    """
    rows, columns = points.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    beside = np.roll(number, -1, axis=1)
    if not closed:
        number, beside = number[:, :-1], beside[:, :-1]
    a, b, c, d = number[:-1], beside[:-1], beside[1:], number[1:]
    triangles = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2)
    return mesh(points.reshape(-1, 3), triangles.reshape(-1, 3), name=name)


def mesh(positions: ArrayLike, triangles: ArrayLike, *, name: str = "mesh") -> Part:
    """Return a part of material 0."""
    corners = np.asarray(triangles, dtype=np.int64)
    return Part(
        name=name,
        positions=np.asarray(positions, dtype=np.float64),
        triangles=corners,
        material_ids=np.zeros(len(corners), dtype=np.int64),
    )


def quad(corners: ArrayLike) -> Part:
    """Return two triangles of [4, 3] corners, counter-clockwise seen from the front."""
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], name="quad")


def box(least: Sequence[float], greatest: Sequence[float]) -> Part:
    """Return the box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = least, greatest
    corners = [
        (x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0),
        (x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1),
    ]  # fmt: skip
    sides = [(4, 5, 6, 7), (1, 0, 3, 2), (5, 1, 2, 6), (0, 4, 7, 3), (7, 6, 2, 3), (0, 1, 5, 4)]
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    return mesh(corners, triangles, name="box")


def beam(least: Sequence[float], greatest: Sequence[float]) -> Part:
    """Return the box between two corners with its normals, to be copied many times."""
    return complete(box(least, greatest))


def lathe(
    profile: ArrayLike,
    segments: int,
    *,
    shape: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> Part:
    """Turn a profile, [points, 2] of radius and height from bottom to top, round the y axis.

    `shape`, if given, maps angles [1, segments] and heights [points, 1] to factors of the radius.
    """
    table = np.asarray(profile, dtype=np.float64)
    radius, height = table[:, :1], table[:, 1:]
    angle = np.arange(segments, dtype=np.float64)[None, :] * (2.0 * np.pi / segments)
    if shape is not None:
        radius = radius * shape(angle, height)
    points = np.stack([radius * np.cos(angle), height + 0.0 * angle, -radius * np.sin(angle)], axis=-1)
    return grid(points, closed=True, name="lathe")


def tube(path: NDArray[np.float64], across: ArrayLike, radius: float, sides: int) -> Part:
    """Return a round bar along `path` [points, 3]; `across` is a direction normal to all of it."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    first = np.asarray(across, dtype=np.float64)
    second = np.cross(along, first)
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    ring = np.cos(angle)[None, :, None] * first + np.sin(angle)[None, :, None] * second[:, None, :]
    return grid(path[:, None, :] + radius * ring, closed=True, name="tube")


def pole(start: ArrayLike, end: ArrayLike, radius: float, sides: int = 8) -> Part:
    """Return a round bar from `start` to `end` [3], open at its ends."""
    path = np.array([start, end], dtype=np.float64)
    along = path[1] - path[0]
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    return tube(path, across / np.linalg.norm(across), radius, sides)


def circle(segments: int) -> NDArray[np.float64]:
    """Return points [segments + 1, 3] of the unit circle in the plane z = 0; the last is the first."""
    turn = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    return np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)


def ball(radius: float, segments: int) -> Part:
    """Return a sphere round the origin."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, segments // 2 + 1)
    return lathe(radius * np.stack([np.cos(turn), np.sin(turn)], axis=1), segments)


def rounded(points: Sequence[tuple[float, float]], steps: int) -> NDArray[np.float64]:
    """Return a smooth profile through [points, 2] (Catmull-Rom), `steps` pieces for each gap."""
    given = np.array(points, dtype=np.float64)
    padded = np.concatenate([[2 * given[0] - given[1]], given, [2 * given[-1] - given[-2]]])
    t = (np.arange(steps) / steps)[:, None]
    pieces = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        pieces.append(
            0.5 * (2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2 + (3 * p1 - p0 - 3 * p2 + p3) * t**3)
        )
    profile = np.concatenate([*pieces, given[-1:]])
    profile[:, 0] = np.maximum(profile[:, 0], 0.0)
    return profile


def joined(parts: Sequence[Part]) -> Part:
    """Return one part of several, keeping their materials, normals and colours."""
    starts = np.cumsum([0] + [len(part.positions) for part in parts])[:-1]

    def rows(name: str, otherwise: float) -> NDArray[np.float64]:
        given = [(getattr(part, name), len(part.positions)) for part in parts]
        return np.concatenate([np.full((n, 3), otherwise) if values is None else values for values, n in given])

    return Part(
        name=parts[0].name,
        positions=np.concatenate([part.positions for part in parts]),
        triangles=np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)]),
        material_ids=np.concatenate([part.material_ids for part in parts]),
        normals=rows("normals", 0.0),
        colors=rows("colors", 1.0),
    )


def of_material(part: Part, material: int) -> Part:
    """Return `part` all of one material."""
    return replace(part, material_ids=np.full(len(part.triangles), material))


def of_materials(*groups: tuple[Iterable[Part], int]) -> list[Part]:
    """Return the parts of all groups, those of a group all of one material."""
    return [of_material(part, material) for parts, material in groups for part in parts]


def moved(part: Part, x: float, y: float, z: float) -> Part:
    """Return `part` shifted."""
    return replace(part, positions=part.positions + np.array([x, y, z]))


def turned(part: Part, angle: float) -> Part:
    """Return `part` turned about the y axis by `angle` radians, +z towards +x."""
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(angle)
    matrix[0, 2], matrix[2, 0] = np.sin(angle), -np.sin(angle)
    return part.transformed(matrix)


def mirrored_x(part: Part) -> Part:
    """Return `part` seen in a mirror in the plane x = 0."""
    return part.transformed(np.diag([-1.0, 1.0, 1.0, 1.0]))
