"""Choice of the virtual point lights that surfels trace shadow rays to, out of many."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.device.constants import FIRST_GROUP

Floats = NDArray[np.float32]

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SETTLED = 4
"""Steps after which the share of a ray is known well enough: more or fewer rays, the same mean."""
TINY = np.float32(1e-30)
MOST_PAIRS = 1 << 21
"""Pairs of a group and a light that are considered at once, which bounds memory."""


def traced_lights(positions: Floats, normals: Floats, lights: Floats, rays: int) -> tuple[NDArray[np.int32], Floats]:
    """Return the lights that groups of receivers trace rays to, and what each counts.

    Groups of `FIRST_GROUP` receivers share them. A light is taken with a probability in proportion
    to the most irradiance that it may give to any of the group, at most 1, so that bright and near
    ones are all there, and counts by the inverse: means are those of all lights. Along the list of
    lights, which follows a curve through space, those taken are spread evenly (systematic
    sampling).

    Args:
        positions, normals: [n, 3] of receivers, neighbours one after the other; n > 0.
        lights: [count, VPL_LIGHT] records of kernels/vpl/light.clh, in the space of the receivers.
        rays: to trace for a receiver, about; with no more lights than that all are taken.

    Returns:
        Numbers of lights [groups, most], -1 past the last one of a group, and weights likewise.
    """
    groups, count = -(-len(positions) // FIRST_GROUP), len(lights)
    if count <= rays:
        numbers = np.tile(np.arange(count, dtype=np.int32), (groups, 1))
        return numbers, np.ones(numbers.shape, np.float32)
    step = max(MOST_PAIRS // count, 1)
    found = [
        _taken(positions, normals, lights, rays, np.arange(first, min(first + step, groups)))
        for first in range(0, groups, step)
    ]
    row, light, weight = (np.concatenate(parts) for parts in zip(*found, strict=True))
    counts = np.bincount(row, minlength=groups)
    place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    numbers = np.full((groups, max(int(counts.max()), 1)), -1, np.int32)
    weights = np.zeros(numbers.shape, np.float32)
    numbers[row, place], weights[row, place] = light, weight
    return numbers, weights


def _taken(
    positions: Floats, normals: Floats, lights: Floats, rays: int, groups: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Return groups, their lights and the weights of these, [n] each."""
    member = np.add.outer(groups * FIRST_GROUP, np.arange(FIRST_GROUP)).ravel()
    member = np.minimum(member, len(positions) - 1)
    share = _shares(_most(positions[member], normals[member], lights), rays)
    turns = np.cumsum(share, axis=1, dtype=np.float64)
    turns += (GOLDEN * groups % 1.0)[:, None]
    whole = turns.astype(np.int32)
    taken = whole > 0
    taken[:, 1:] = whole[:, 1:] > whole[:, :-1]
    row, light = np.nonzero(taken)
    return groups[row], light, 1.0 / share[row, light]


def _shares(most: Floats, rays: int) -> Floats:
    """Return probabilities [groups, count] in proportion to `most`, at most 1, of sum `rays`."""
    unit = most.sum(axis=1, keepdims=True) / rays
    for _ in range(SETTLED):
        rest = most < unit
        left = rays - most.shape[1] + np.count_nonzero(rest, axis=1, keepdims=True)
        some = np.multiply(most, rest).sum(axis=1, keepdims=True) / np.maximum(left, 1)
        unit = np.where(left > 0, some, unit)
    share: Floats = np.minimum(most / np.maximum(unit, TINY), np.float32(1.0))
    return share


def _most(positions: Floats, normals: Floats, lights: Floats) -> Floats:
    """Return what no receiver of a group gets more of from a light: [groups, count].

    Ways to a light lie in a box, and normals in another: a product of the two is at most that of
    their middles, and what either may differ by times the other's size.
    """
    at, facing = (a.reshape(-1, FIRST_GROUP, 3).astype(np.float32) for a in (positions, normals))
    (middle, half), (normal, bend) = (_box(a) for a in (at, facing))
    # Element by element, so that the result does not depend on which groups are looked at together.
    size = len(middle), len(lights)
    received, emitted, nearest, way, term = (np.zeros(size, np.float32) for _ in range(5))
    rows = np.ascontiguousarray(lights[:, :7].T)
    for axis in range(3):
        place, turned = rows[axis], rows[4 + axis]
        own, turn, side, least = (a[:, axis, None] for a in (middle, normal, half, bend))
        np.subtract(place, own, out=way)
        received += np.multiply(way, turn, out=term)
        emitted += np.multiply(way, turned, out=term)
        emitted += np.multiply(side, np.abs(turned), out=term)
        np.abs(way, out=way)
        received += np.multiply(way, least, out=term)
        received += (np.abs(turn) + least) * side
        way -= side
        np.maximum(way, 0.0, out=way)
        nearest += np.multiply(way, way, out=term)
    np.maximum(nearest, TINY, out=nearest)
    distance = np.sqrt(nearest, out=way)
    found: Floats = np.clip(received / distance, 0.0, 1.0)
    emitted /= distance
    found *= np.clip(emitted, 0.0, 1.0, out=emitted)
    found *= lights[:, 8:11] @ LUMINANCE.astype(np.float32)
    nearest *= np.float32(math.pi)
    nearest += lights[:, 3]
    found /= nearest
    return found


def _box(points: Floats) -> tuple[Floats, Floats]:
    """Return middle and half size [groups, 3] of the boxes round points [groups, n, 3]."""
    low, high = points.min(axis=1), points.max(axis=1)
    return 0.5 * (low + high), 0.5 * (high - low)
