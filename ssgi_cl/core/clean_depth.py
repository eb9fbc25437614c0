"""Cleaning of measured depth: noise is averaged along surfaces, holes are filled from their borders.

A plane that a perspective camera sees is linear in inverse depth, and the noise of stereo and
structured-light cameras is constant there. So each pixel gets the value of a plane fitted to the
inverse depths round it, of which those count that lie near the plane: local linear regression
(Cleveland 1979) with the range weights of the bilateral filter (Tomasi and Manduchi 1998).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import array_kind, of_kind
from ssgi_cl.core.keywords import checked_keywords

INVALID = (0.0, float("nan"), float("inf"))
"""Numbers that stand for no surface, by default."""
WIDTH = 0.6
"""Standard deviation of the weights by distance, as a share of the reach."""
NEAR = 3.0
"""Standard deviation of the weights by inverse depth, as a multiple of the noise."""
FAR = 4.0
"""Multiples of the noise by which no value may change: beyond it lies another surface."""
ALONE = 1.5
"""Least sum of weights to fit a plane by."""

Floats = NDArray[np.float32]


class _Planes(NamedTuple):
    """Inverse depth of each pixel, and how it grows by column and by row."""

    value: Floats
    across: Floats
    down: Floats


@checked_keywords
def clean_depth(
    depth: Any,
    *,
    noise: float | None = None,
    reach: int = 5,
    passes: int = 2,
    fill: int = 8,
    invalid: Iterable[float] = INVALID,
) -> Any:
    """Return a depth map without noise and small holes.

    Args:
        depth: [rows, columns] or [images, rows, columns], planar depth of a perspective camera in scene units.
        noise: standard deviation of 1 / depth; by default estimated from second differences along rows.
        reach: pixels round each that its plane is fitted to, 1 to 32.
        passes: how often planes are fitted, 1 to 8; the next uses the slopes of the one before.
        fill: holes are filled up to so many pixels from a surface, 0 to 1024.
        invalid: numbers that stand for no surface.

    Returns:
        float32 of the shape and the kind of `depth`; +inf where no surface is near.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    given = checks.as_array("depth", depth)
    if given.ndim not in (2, 3) or 0 in given.shape or given.dtype.kind not in "fiu":
        raise ValueError(f"depth has shape {given.shape} of {given.dtype}: expected (rows, columns) of real numbers")
    checks.integer("reach", reach, low=1, high=32, unit="px")
    checks.integer("passes", passes, low=1, high=8)
    checks.integer("fill", fill, low=0, high=1024, unit="px")
    if noise is not None:
        noise = checks.number("noise", noise, low=0.0, above=True, unit="1 / scene units")
    numbers = tuple(float(number) for number in invalid)
    images = given if given.ndim == 3 else given[None]
    cleaned = np.stack([_cleaned(image, noise, reach, passes, fill, numbers) for image in images])
    return of_kind(cleaned if given.ndim == 3 else cleaned[0], array_kind(depth))


def _cleaned(
    depth: NDArray[Any], noise: float | None, reach: int, passes: int, fill: int, invalid: tuple[float, ...]
) -> Floats:
    """Return a depth map [rows, columns] cleaned."""
    missing = np.isnan(depth) | np.isin(depth, [number for number in invalid if number == number])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(missing | ~(depth > 0), 0.0, 1.0 / depth.astype(np.float64)).astype(np.float32)
    there = inverse > 0.0
    if not there.any():
        return np.full(depth.shape, np.inf, np.float32)
    sigma = _noise_of(inverse, there) if noise is None else noise
    planes = _start(inverse, there, sigma)
    for _ in range(passes if sigma > 0.0 else 0):
        planes = _fitted(inverse, there, planes, sigma, reach)
    value = np.where(there, planes.value, 0.0)
    if fill and not there.all():
        value = _filled(value, planes, there, fill)
    with np.errstate(divide="ignore"):
        result: Floats = np.where(value > 0.0, 1.0 / value, np.inf).astype(np.float32)
    return result


def _noise_of(inverse: Floats, there: NDArray[np.bool_]) -> float:
    """Return the standard deviation of noise: 0 on planes, whose second differences are 0."""
    bend = inverse[:, 2:] - 2.0 * inverse[:, 1:-1] + inverse[:, :-2]
    known = bend[there[:, 2:] & there[:, 1:-1] & there[:, :-2]]
    # The median of a normal distribution's absolute value is .6745; three values make 1 + 4 + 1 times the variance.
    return float(np.median(np.abs(known)) / (0.6745 * 6.0**0.5)) if known.size else 0.0


def _start(inverse: Floats, there: NDArray[np.bool_], sigma: float) -> _Planes:
    """Return medians of 3 x 3 pixels where they are of the same surface, without slopes."""
    median = ndimage.median_filter(inverse, 3)
    same = there & (np.abs(median - inverse) < FAR * sigma)
    flat = np.zeros_like(inverse)
    return _Planes(np.where(same, median, inverse), flat, flat)


def _fitted(inverse: Floats, there: NDArray[np.bool_], planes: _Planes, sigma: float, reach: int) -> _Planes:
    """Return the planes through the pixels near those of the last pass."""
    rows, columns = inverse.shape
    padded = np.pad(inverse, reach)
    moments = np.zeros((6, rows, columns), np.float32)  # of weights: 1, x, y, x x, x y, y y
    sums = np.zeros((3, rows, columns), np.float32)  # of weighted values: 1, x, y
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            other = padded[reach + y : reach + y + rows, reach + x : reach + x + columns]
            off = (other - planes.value - x * planes.across - y * planes.down) * (1.0 / (NEAR * sigma))
            weight = np.exp(-0.5 * off**2, dtype=np.float32) * (other > 0.0)
            weight *= np.float32(np.exp(-0.5 * (x * x + y * y) / (WIDTH * reach) ** 2))
            for moment, factor in zip(moments, (1, x, y, x * x, x * y, y * y), strict=True):
                moment += weight * factor
            weight *= other
            for each, factor in zip(sums, (1, x, y), strict=True):
                each += weight * factor
    one, x1, y1, xx, xy, yy = moments.astype(np.float64)
    matrix = np.stack([one, x1, y1, x1, xx, xy, y1, xy, yy], axis=-1).reshape(rows, columns, 3, 3)
    matrix += np.diag([1e-9, 1e-2, 1e-2])  # a lone pixel has no slope
    found = np.linalg.solve(matrix, np.moveaxis(sums, 0, -1)[..., None].astype(np.float64))[..., 0]
    value, across, down = np.moveaxis(found, -1, 0).astype(np.float32)
    good = there & (one > ALONE) & (np.abs(value - inverse) < FAR * sigma)
    return _Planes(*(np.where(good, new, old) for new, old in zip((value, across, down), planes, strict=True)))


def _filled(value: Floats, planes: _Planes, there: NDArray[np.bool_], fill: int) -> Floats:
    """Return inverse depths with holes filled by the plane of the nearest pixel, farther of it and its value."""
    distance, (rows, columns) = ndimage.distance_transform_edt(~there, return_indices=True)
    y, x = (index - np.arange(n).reshape(shape) for index, n, shape in (
        (rows, there.shape[0], (-1, 1)), (columns, there.shape[1], (1, -1)),
    ))  # fmt: skip
    near = value[rows, columns]
    continued = near - x * planes.across[rows, columns] - y * planes.down[rows, columns]
    within = ~there & (distance <= fill)
    result: Floats = np.where(within, np.clip(continued, 0.5 * near, 2.0 * near), value)
    return result
