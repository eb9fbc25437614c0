"""Scenes of parallelograms whose light is known, and how a truth of light is held to it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.truth.store import Truth

Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""A corner and the two edges that leave it."""

STANDARD_ERRORS = 3.0
"""The mean over an image is that many of its standard errors from what is expected, at most."""
ROUNDING = 2e-5
"""Relative: positions in float32 a few hundred roundings from the eye, and 1 / d^2 of them."""
FAR = 1e3
"""Extent of planes that stand for infinite ones; the rest is seen under about 1 / FAR."""

FLOOR: Quad = ((-5, 0, -5), (0, 0, 10), (10, 0, 0))
WALL: Quad = ((0, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
"""The plane x = 0 above the floor."""
PANEL: Quad = ((-1, 1, -1), (0, 0, 2), (2, 0, 0))
BOX: tuple[Quad, ...] = (
    ((0, 0, 0), (1, 0, 0), (0, 1, 0)), ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, 0), (0, 1, 0), (0, 0, 1)), ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 0, 0), (1, 0, 0), (0, 0, 1)), ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
)  # fmt: skip
PATCH: Quad = ((0.4, 0.9, 0.4), (0, 0, 0.2), (0.2, 0, 0))
"""Below the ceiling of the box."""
INSIDE = Camera.look_at((0.3, 0.6, 0.8), (0.7, 0.2, 0.1), width=24, height=16, yfov=1.2)
"""A view of the box from within."""


def grey(albedo: float, emission: float = 0.0) -> Material:
    return Material(albedo=(albedo,) * 3, emission=(emission,) * 3)


def tinted(*albedos: float) -> list[Material]:
    """Return a material of each albedo, with less of it in each channel."""
    return [Material(albedo=(a, 0.5 * a, 0.25 * a)) for a in albedos]


def quads(*parts: Quad, materials: Sequence[Material], **rest: Any) -> Scene:
    """Return a scene of parallelograms, the material of each in turn; v grows along the first edge."""
    corners = []
    for part in parts:
        corner, first, second = (np.asarray(p, np.float64) for p in part)
        corners += [corner, corner + first, corner + first + second, corner + second]
    faces = [[4 * i + k for k in t] for i in range(len(parts)) for t in ((0, 1, 2), (0, 2, 3))]
    points = np.asarray(corners, np.float32)
    uvs = np.tile(np.float32([[0, 0], [0, 1], [1, 1], [1, 0]]), (len(parts), 1))
    return Scene(**{
        "positions": points, "normals": np.zeros_like(points), "uvs": uvs,
        "colors": np.ones_like(points), "triangles": np.asarray(faces, np.int32),
        "material_ids": np.repeat(np.arange(len(parts)) % len(materials), 2),
        "materials": tuple(materials), **rest,
    })  # fmt: skip


def above(width: int = 32, height: int = 24, **options: Any) -> Camera:
    """Return a camera that sees a part of FLOOR."""
    return Camera.look_at((0.5, 3.0, 1.5), (0.2, 0.0, -0.3), width=width, height=height, **options)


def down(width: int, height: int) -> Camera:
    """Return a camera that sees a spot of the floor from straight above."""
    return Camera.look_at((0.1, 4, 0), (0.1, 0, 0), up=(0, 0, 1), width=width, height=height, yfov=0.01)


def spot_of(x: float, size: int = 64) -> Camera:
    """Return a camera that sees a spot of the floor, as small as a point, from 1 cm above."""
    return Camera.orthographic((x, 0.01, 0), (x, 0, 0), (0, 0, 1), view_height=1e-6, width=size, height=size, far=1.0)


def closely(truth: Truth, expected: ArrayLike, expected_error: ArrayLike = 0.0, other: float | None = None) -> None:
    """Assert that the mean of each channel is as expected.

    Args:
        truth: with many pixels, of which few paths each are enough.
        expected: one value, or one of each channel or pixel.
        expected_error: its standard error.
        other: how far off it may be beside standard errors; that of rounding unless told.
    """
    wanted = np.broadcast_to(np.asarray(expected, np.float64), truth.mean.shape)
    off = np.mean(truth.mean - wanted, axis=(0, 1))
    squares = truth.error.astype(np.float64) ** 2 + np.asarray(expected_error, np.float64) ** 2
    own = np.sqrt(np.sum(squares, axis=(0, 1))) / np.prod(truth.mean.shape[:2])
    rest = ROUNDING * wanted.mean() if other is None else other
    assert (np.abs(off) <= STANDARD_ERRORS * own + rest).all(), (off, own)
    assert (own < 0.02 * wanted.mean()).all(), "the test would notice nothing"
