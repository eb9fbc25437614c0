"""Shapes of generated scenes: closed surfaces with outward normals, sheets, the ground; metres."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ...parts import Part
from ..scatter import Doubles, noise
from ..shapes import grid, lathe, mesh

Height = Callable[[Doubles, Doubles], Doubles]
"""Maps x and z to the height of the ground there, metres."""


def cylinder(sides: int) -> Part:
    """Return the cylinder of radius 1 round the y axis from y = 0 to y = 1, with both caps."""
    return lathe([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], sides)


def cone(sides: int) -> Part:
    """Return the cone over the disc of radius 1 at y = 0 with its apex at y = 1."""
    return lathe([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], sides)


def sphere(segments: int) -> Part:
    """Return the ball of radius 1 round the origin; its poles are single points."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, segments // 2 + 1)[1:-1]
    inner = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return lathe([(0.0, -1.0), *inner, (0.0, 1.0)], segments)


def cushion(roundness: float = 0.45, segments: int = 20) -> Part:
    """Return a rounded box from -1 to 1 along each axis (a superellipsoid).

    Args:
        roundness: 1 for a ball, towards 0 for a box.
        segments: round the y axis; half as many from bottom to top.
    """

    def power(values: Doubles) -> Doubles:
        rounded: Doubles = np.sign(values) * np.abs(values) ** roundness
        return rounded

    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, segments // 2 + 1)[:, None]
    along = np.arange(segments)[None, :] * (2.0 * np.pi / segments)
    ring = power(np.where(np.abs(np.cos(up)) < 1e-9, 0.0, np.cos(up)))
    x, z = ring * power(np.cos(along)), -ring * power(np.sin(along))
    points = np.stack([x, power(np.sin(up)) + 0.0 * along, z], axis=-1)
    return grid(points, closed=True, name="cushion")


def torus(major: float, minor: float, around: int = 28, sides: int = 8) -> Part:
    """Return a torus about the y axis; `major` is the radius of the circle of its middle."""
    turn = np.arange(around + 1)[None, :] * (2.0 * np.pi / around)
    side = np.arange(sides + 1)[:, None] * (2.0 * np.pi / sides)
    away = major + minor * np.cos(side)
    points = np.stack([away * np.cos(turn), minor * np.sin(side) + 0.0 * turn, -away * np.sin(turn)], axis=-1)
    points[-1], points[:, -1] = points[0], points[:, 0]  # the seams meet exactly
    return grid(points[:, :-1], closed=True, name="torus")


def prism(outline: ArrayLike, height: float) -> Part:
    """Return the prism over a polygon from y = 0 to `height`.

    Args:
        outline: [corners, 2] x and -z, counter-clockwise, star-shaped round the origin.
        height: > 0.
    """
    flat = np.asarray(outline, dtype=np.float64)
    count = len(flat)
    corners = np.stack([flat[:, 0], np.zeros(count), -flat[:, 1]], axis=1)
    above = corners + np.array((0.0, height, 0.0))
    points = np.concatenate([corners, above, [[0, 0, 0], [0, height, 0]]])
    here = np.arange(count)
    after = np.roll(here, -1)
    bottom, top = 2 * count, 2 * count + 1
    triangles = np.concatenate([
        np.stack([here, after, after + count], axis=1),
        np.stack([here, after + count, here + count], axis=1),
        np.stack([after, here, np.full(count, bottom)], axis=1),
        np.stack([here + count, after + count, np.full(count, top)], axis=1),
    ])  # fmt: skip
    return mesh(points, triangles, name="prism")


def gear(radius: float, teeth: int, height: float, depth: float) -> Part:
    """Return a spur gear about the y axis; `depth` is that of its teeth."""
    angle = np.arange(4 * teeth) * (2.0 * np.pi / (4 * teeth))
    away = np.where(np.isin(np.arange(4 * teeth) % 4, (0, 1)), radius, radius - depth)
    return prism(np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1), height)


def sheet(points: Doubles, thickness: float) -> Part:
    """Return the grid of `points` [rows, columns, 3] as a slab; with thickness 0 an open sheet.

    The front is as in `shapes.grid`; the slab reaches behind it, along the mean normals.
    """
    if thickness == 0.0:
        return grid(points, name="sheet")
    down, right = np.gradient(points, axis=0), np.gradient(points, axis=1)
    normal = np.cross(right, down)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    rows, columns = points.shape[:2]
    both = np.concatenate([points.reshape(-1, 3), (points - thickness * normal).reshape(-1, 3)])
    number = np.arange(rows * columns).reshape(rows, columns)
    front = grid(points).triangles
    rim = np.concatenate([number[0, :], number[1:, -1], number[-1, -2::-1], number[-2:0:-1, 0]])
    after = np.roll(rim, -1)
    behind = rows * columns
    border = np.concatenate([
        np.stack([after, rim, rim + behind], axis=1),
        np.stack([after, rim + behind, after + behind], axis=1),
    ])  # fmt: skip
    return mesh(both, np.concatenate([front, front[:, ::-1] + behind, border]), name="sheet")


def arch(span: float, thick: float, deep: float, pieces: int = 14) -> Part:
    """Return a half ring in the plane of x and y over `span`, its feet at y = 0.

    Args:
        span: inner diameter; thick: of the ring; deep: along z, round 0.
    """
    turn = np.linspace(0.0, np.pi, pieces + 1)
    way = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    way[-1, 1] = 0.0
    inner, outer = 0.5 * span * way, (0.5 * span + thick) * way
    ring = np.stack([inner, inner, outer, outer], axis=1)  # [pieces + 1, 4, 2]
    z = np.broadcast_to([0.5 * deep, -0.5 * deep, -0.5 * deep, 0.5 * deep], ring.shape[:2])
    points = np.concatenate([ring, z[..., None]], axis=-1)
    around = grid(points[::-1], closed=True)
    last = 4 * pieces
    caps = [(0, 2, 1), (0, 3, 2), (last, last + 1, last + 2), (last, last + 2, last + 3)]
    triangles = np.concatenate([around.triangles, np.array(caps)])
    return mesh(around.positions, triangles, name="arch")


def rock(seed: int, segments: int = 20, roughness: float = 0.5) -> Part:
    """Return a stone of radius about 1 round the origin: a ball pushed in and out by noise."""
    part = sphere(segments)
    x, y, z = part.positions.T
    bump = noise(seed, 1.7 * x + 20.0, 1.7 * y + 1.3 * z + 20.0) - 0.5
    bump += 0.45 * (noise(seed + 1, 4.3 * x + 31.0 + z, 4.3 * y + 20.0 - 2.1 * z) - 0.5)
    return mesh(part.positions * (1.0 + roughness * bump)[:, None], part.triangles, name="rock")


def height_field(side: Doubles, height: Height, across: Doubles | None = None) -> Part:
    """Return the open surface y = height(x, z) over x in `side` and z in `across`, facing up."""
    depth = side if across is None else across
    x, z = np.meshgrid(side, depth[::-1])
    return grid(np.stack([x, height(x, z), z], axis=-1), name="ground")


def on_ground(height: Height, x: float, z: float) -> tuple[float, float, float]:
    """Return the point of the ground at (x, z)."""
    return float(x), float(height(np.array(x), np.array(z))), float(z)


def all_on_ground(height: Height, spots: Doubles, above: float | Doubles = 0.0) -> Doubles:
    """Return [n, 3] points over `spots` [n, 2], x and z, at a distance above the ground."""
    x, z = spots.T
    return np.stack([x, height(x, z) + above, z], axis=1)
