"""Environments as directions of equal flux: stratified importance samples.

The sphere is divided into rectangles of an equal-area octahedral map (Clarberg 2008, "Fast
Equal-Area Mapping of the (Hemi)Sphere using SIMD"), each cut in two at its flux's median until
there are enough (median cut: Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling"). A
rectangle becomes the direction of its vector flux and carries all its flux, so that the mean over
all normals is exact.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment

Doubles = NDArray[np.float64]

CELLS = 256
"""Rows and columns of the map of the sphere."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
BRIGHTEST = 1e30
"""W m^-2 sr^-1: brighter texels count as this, so that float32 holds all sums."""

POINTS = 64
"""Directions that stand for a part of the sphere, a quarter of them for each quarter of the part."""

MOST_TEXELS = 1 << 25
"""Of an image in which others are summed texel by texel; larger ones are resized first."""

_MOST_ROWS, _MOST_COLUMNS = 1024, 2048  # texels of larger images are summed in blocks
_LEAST_ROWS, _LEAST_COLUMNS = 256, 512  # texels of smaller images are divided


def sample_environments(
    environments: Sequence[Environment], count: int, seen: Doubles | None = None
) -> tuple[Doubles, Doubles]:
    """Return directions that stand for the sum of environments.

    Args:
        environments: any number of them.
        count: directions, at least 1.
        seen: [n, n] > 0, how much light counts that comes from each part of the map, n a divisor of `CELLS`: what
            counts more has more directions; None for all alike.

    Returns:
        Directions to the light [count, 3], unit length, world space, and the irradiance
        [count, 3] that each carries, W/m^2 of a surface that faces it. Neighbours in the list are
        neighbours on the sphere. Both have 0 rows where the environments send no light.
    """
    cells = sum((_cells(each) for each in environments), np.zeros((CELLS * CELLS, 7)))
    if not cells[:, 0].any():
        return np.zeros((0, 3)), np.zeros((0, 3))
    power = cells[:, 0].reshape(CELLS, CELLS)
    if seen is not None:
        power = power * np.kron(seen, np.ones((CELLS // len(seen), CELLS // len(seen))))
    regions = _regions(power, count)
    flux = np.array([_sum(cells.reshape(CELLS, CELLS, 7), region) for region, _ in regions])
    flux *= np.array([share for _, share in regions])[:, None]
    length = np.linalg.norm(flux[:, 4:], axis=1)
    # A region that is all the sphere may have no vector flux; it is then looked at from above.
    towards = np.where(length[:, None] > 0.0, flux[:, 4:], (0.0, 1.0, 0.0))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    return towards, flux[:, 1:4]


@dataclass(frozen=True, eq=False)
class Strata:
    """Parts of the sphere of about equal flux that stand for environments.

    Attributes:
        vectors: [n, 3] integral of direction times radiance, over that of radiance; what is above a surface's
            horizon gives it n . vector of its flux.
        flux: [n, 3] W/m^2.
        spread: [n] half the width of a part, as the sine of an angle.
        reach: [n] greatest distance of its points from its middle, likewise.
        solid_angle: [n] sr, of what sends light.
        points: [n, POINTS, 3] unit vectors, spread as the part's light.
    """

    vectors: Doubles
    flux: Doubles
    spread: Doubles
    reach: Doubles
    solid_angle: Doubles
    points: Doubles


def environment_strata(environments: Sequence[Environment], count: int) -> Strata:
    """Return `count` parts of the sphere, none where the environments send no light. Neighbours in the list are
    neighbours on the sphere."""
    cells = sum((_cells(each) for each in environments), np.zeros((CELLS * CELLS, 7)))
    if not cells[:, 0].any():
        none = np.zeros((0, 3))
        empty = np.zeros(0)
        return Strata(none, none, empty, empty, empty, np.zeros((0, POINTS, 3)))
    power = cells[:, 0].reshape(CELLS, CELLS)
    regions = _regions(power, count)
    sums = np.array([_sum(cells.reshape(CELLS, CELLS, 7), region) for region, _ in regions])
    shares = np.array([share for _, share in regions])
    side = math.isqrt(POINTS)
    row, column = (
        np.array([sum((n >> 2 * k + first & 1) << k for k in range(3)) for n in range(POINTS)]) for first in (1, 0)
    )
    u, v = (column + 0.5) / side, (row + 0.5) / side
    places = np.empty((count, POINTS, 2))
    for number, ((top, bottom, left, right), _) in enumerate(regions):
        some = power[top:bottom, left:right]
        rows, inside = _drawn(some.sum(axis=1)[None], v)
        places[number, :, 0] = top + rows + inside
        columns, inside = _drawn(some[rows], u)
        places[number, :, 1] = left + columns + inside
    points = map_directions(*np.moveaxis(places / CELLS * 2.0 - 1.0, -1, 0))
    vectors = sums[:, 4:] / sums[:, :1]
    # Of an even disc or strip: its half width is the deviation along an axis times the root of 3.
    off = points - np.einsum("nk,npk->np", _unit(vectors), points)[..., None] * _unit(vectors)[:, None]
    squared = (off**2).sum(axis=2)
    spread, reach = np.sqrt(1.5 * squared.mean(axis=1)), np.sqrt(squared.max(axis=1))
    lit = np.array([np.count_nonzero(power[t:b, x:y]) for (t, b, x, y), _ in regions])
    return Strata(
        vectors, sums[:, 1:4] * shares[:, None], spread, reach, lit * shares * (4.0 * math.pi / CELLS**2), points
    )


def _drawn(weights: Doubles, at: Doubles) -> tuple[NDArray[np.intp], Doubles]:
    """Return the elements of rows of weights [1 or n, m] at the quantiles `at` [n], and the parts of them before."""
    ends = np.cumsum(weights, axis=1)
    sought = at * ends[:, -1]
    found = np.minimum((ends <= sought[:, None]).sum(axis=1), weights.shape[1] - 1)
    row = np.arange(len(at)) if len(weights) > 1 else 0
    part = (sought - (ends - weights)[row, found]) / np.maximum(weights[row, found], 1e-300)
    return found, np.clip(part, 0.0, 1.0)


def _unit(vectors: Doubles) -> Doubles:
    unit: Doubles = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)
    return unit


def solid_angles(rows: int, columns: int) -> Doubles:
    """Return the solid angle of a texel in each row of an image, [rows] in sr."""
    edges = np.cos(np.linspace(0.0, math.pi, rows + 1))
    angles: Doubles = (edges[:-1] - edges[1:]) * (2.0 * math.pi / columns)
    return angles


def texels(rows: int, columns: int, some: slice = slice(None)) -> tuple[Doubles, Doubles]:
    """Return direction [rows, columns, 3] and solid angle [rows, columns] of an image's texels, or
    of some of its rows."""
    edges = np.cos(np.linspace(0.0, math.pi, rows + 1))
    # The cosine in the middle of a row's solid angle, not of its angle.
    cosine = 0.5 * (edges[:-1] + edges[1:])[some, None]
    sine = np.sqrt(1.0 - cosine**2)
    azimuth = ((np.arange(columns) + 0.5) / columns - 0.5) * 2.0 * math.pi
    upward = np.broadcast_to(cosine, (len(cosine), columns))
    towards = np.stack([sine * np.sin(azimuth), upward, -sine * np.cos(azimuth)], axis=-1)
    return towards, np.repeat(solid_angles(rows, columns)[some, None], columns, 1)


def cell_directions() -> Doubles:
    """Return the middle of each cell of the map, [CELLS * CELLS, 3]."""
    middle = (np.arange(CELLS) + 0.5) / CELLS * 2.0 - 1.0
    v, u = np.meshgrid(middle, middle, indexing="ij")
    return map_directions(v, u).reshape(-1, 3)


def map_directions(v: Doubles, u: Doubles) -> Doubles:
    """Return unit vectors [..., 3] at places of the map, rows v and columns u in [-1, 1]."""
    distance = 1.0 - (np.abs(u) + np.abs(v))
    radius = 1.0 - np.abs(distance)
    safe = np.maximum(radius, 1e-300)
    angle = (np.where(radius > 0.0, (np.abs(v) - np.abs(u)) / safe, 0.0) + 1.0) * (math.pi / 4.0)
    y = np.copysign(1.0 - radius**2, distance)
    across = radius * np.sqrt(2.0 - radius**2)
    x = np.copysign(np.cos(angle), u) * across
    z = np.copysign(np.sin(angle), v) * across
    unit: Doubles = np.stack([x, y, z], axis=-1)
    return unit


def _cell_numbers(towards: Doubles) -> NDArray[np.int64]:
    """Return the cell of each texel whose directions are `texels`, the inverse of
    `cell_directions`."""
    # Rows have one height, columns one azimuth.
    y, (x, _, z) = towards[:, :1, 1], towards[len(towards) // 2].T
    radius = np.sqrt(np.maximum(1.0 - np.abs(y), 0.0))
    angle = np.arctan2(np.abs(z), np.abs(x)) * (2.0 / math.pi)
    v = angle * radius
    u = radius - v
    below = np.flatnonzero(y < 0.0)
    u[below], v[below] = 1.0 - v[below], 1.0 - u[below]
    for w, side in ((u, x), (v, z)):
        np.copysign(w, side, out=w)
        w *= 0.5 * CELLS
        w += 0.5 * CELLS
        np.clip(w, 0, CELLS - 1, out=w)
    numbers: NDArray[np.int64] = v.astype(np.int64) * CELLS + u.astype(np.int64)
    return numbers


def _cells(environment: Environment) -> Doubles:
    """Return [cells, 7]: flux in luminance and in RGB, and vector flux in luminance."""
    image = np.minimum(np.asarray(environment.radiance, np.float64), BRIGHTEST)
    if image.ndim == 1:
        area = 4.0 * math.pi / CELLS**2
        flux = np.append(image @ LUMINANCE, image) * area
        vector = cell_directions() * flux[0]
        return np.column_stack([np.tile(flux, (len(vector), 1)), vector])
    image = resized(image)
    towards, omega = texels(*image.shape[:2])
    numbers = _cell_numbers(towards)
    flux = (image * omega[..., None]).reshape(-1, 3)
    power = flux @ LUMINANCE
    values = [power, *flux.T, *(towards.reshape(-1, 3) * power[:, None]).T]
    cells = [np.bincount(numbers.ravel(), v, CELLS * CELLS) for v in values]
    return np.stack(cells, axis=-1)


def resized(image: Doubles) -> Doubles:
    """Return an image whose texels suit the cells: of a mean of several, or each several times."""
    limits = (_LEAST_ROWS, _MOST_ROWS), (_LEAST_COLUMNS, _MOST_COLUMNS)
    # The longer side first: it gets smaller before the other one may get larger.
    for axis in np.argsort(image.shape[:2])[::-1]:
        (least, most), size = limits[axis], image.shape[axis]
        if size < least:
            image = np.repeat(image, math.ceil(least / size), axis)
        elif size > most:
            # A texel is divided between the two blocks that it may belong to.
            sums = np.insert(np.cumsum(image, axis), 0, 0.0, axis)
            edges = np.linspace(0.0, size, most + 1)
            low = np.minimum(edges.astype(np.int64), size - 1)
            part = (edges - low).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
            at = np.take(sums, low, axis) * (1.0 - part) + np.take(sums, low + 1, axis) * part
            image = np.diff(at, axis=axis) * (most / size)
            image = np.maximum(image, 0.0)
    return image


def summed(images: Sequence[Doubles], least: tuple[int, int] = (1, 1), start: Doubles | None = None) -> Doubles:
    """Return the sum of latitude-longitude images, of the size of the largest.

    The texels of smaller images are repeated. If several images have more than `MOST_TEXELS` in
    common, they are resized first.

    Args:
        images: [rows, columns, 3] each, any number.
        least: rows and columns of the sum.
        start: [3], what the images are added to; 0 by default.
    """
    rows, columns = np.max([least, *(image.shape[:2] for image in images)], axis=0).tolist()
    if len(images) > 1 and rows * columns > MOST_TEXELS:
        images = [resized(image) for image in images]
        rows, columns = np.max([image.shape[:2] for image in images], axis=0).tolist()
    total = np.tile(np.zeros(3) if start is None else start, (rows, columns, 1))
    for image in images:
        row = np.arange(rows) * image.shape[0] // rows
        column = np.arange(columns) * image.shape[1] // columns
        total += image[row[:, None], column]
    return total


Region = tuple[int, int, int, int]
"""First and last-plus-one row, then column, of cells."""


def _regions(flux: Doubles, count: int) -> list[tuple[Region, float]]:
    """Return `count` rectangles of cells in their order along the cuts, each with its share.

    The share is 1, but for a single cell that had to be counted more than once.
    """
    first = _trimmed(flux, (0, CELLS, 0, CELLS))
    # A leaf of the tree of cuts: its flux, its number, the way to it, region and share.
    heap: list[tuple[float, int, tuple[int, ...], Region, float]] = [(-float(_sum(flux, first)), 0, (), first, 1.0)]
    for cut in range(count - 1):
        _, _, way, region, share = heapq.heappop(heap)
        for side, (child, part) in enumerate(_halves(flux, region, share)):
            found = (-float(_sum(flux, child)) * part, 2 * cut + side + 1, (*way, side), child, part)
            heapq.heappush(heap, found)
    return [(region, share) for _, _, _, region, share in sorted(heap, key=lambda leaf: leaf[2])]


def _halves(flux: Doubles, region: Region, share: float) -> list[tuple[Region, float]]:
    """Return a rectangle in two of about the same flux, cut across its longer side."""
    top, bottom, left, right = region
    if bottom - top == 1 and right - left == 1:
        return [(region, share / 2)] * 2
    rows = bottom - top >= right - left
    along = flux[top:bottom, left:right].sum(axis=1 if rows else 0)
    so_far = np.cumsum(along)
    cut = int(np.abs(so_far[:-1] - 0.5 * so_far[-1]).argmin()) + 1
    if rows:
        both = (top, top + cut, left, right), (top + cut, bottom, left, right)
    else:
        both = (top, bottom, left, left + cut), (top, bottom, left + cut, right)
    return [(_trimmed(flux, each), share) for each in both]


def _trimmed(flux: Doubles, region: Region) -> Region:
    """Return the least rectangle with all the light of one that has some."""
    top, bottom, left, right = region
    lit = flux[top:bottom, left:right] > 0.0
    if lit.all():
        return region
    rows, columns = np.flatnonzero(lit.any(axis=1)), np.flatnonzero(lit.any(axis=0))
    return (top + int(rows[0]), top + int(rows[-1]) + 1, left + int(columns[0]), left + int(columns[-1]) + 1)


def _sum(cells: Doubles, region: Region) -> Doubles:
    top, bottom, left, right = region
    total: Doubles = cells[top:bottom, left:right].sum(axis=(0, 1))
    return total
