"""Bitmask AO in float64, sector by sector as defined in `ssgi_cl.techniques.ao.bitmask_ao`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.slices import Scan, Slice, Tap, finished
from ssgi_cl.reference.gbuffer import Doubles

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.bitmask import BitmaskParams

SECTORS = 32
MOST_TAPS = 64
"""Of a side of a slice."""


def bitmask_reference(gbuffer: GBuffer, params: BitmaskParams) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same taps as the kernel, blurred and upsampled alike."""
    if gbuffer.thickness is not None and np.ndim(gbuffer.thickness) == 3 and len(np.asarray(gbuffer.thickness)) > 1:
        # What is known needs no slack to be joined.
        params = replace(params, slack=params.slack / 2.0)
    first = replace(params, taps=taps_of(params, gbuffer.layers)[0])
    return finished(gbuffer, first, lambda scan: visibility(scan, params), params.thickness, params.end)


def taps_of(params: BitmaskParams, layers: int) -> tuple[int, int]:
    """Return the taps of a side in the first of so many layers, and in each of the others.

    Joined, as many as in a single layer times (10 + layers) / 7, rounded to even, and a third of
    those, rounded up; otherwise the same everywhere.
    """
    if not params.joined or layers == 1:
        return params.taps, params.taps
    first = min(round(params.taps * (10 + layers) / 7), MOST_TAPS)
    return first, (first + 2) // 3


def visibility(scan: Scan, params: BitmaskParams) -> Doubles:
    """Return A before blur: the share of sectors that no tap covers."""
    hidden, whole = np.zeros(scan.depth.shape), np.full(scan.depth.shape, 1e-30)
    number = np.arange(SECTORS)
    for plane in scan.slices():
        covered, below = (np.zeros((*scan.depth.shape, SECTORS), bool) for _ in range(2))
        for side in (1, -1):
            # No sector lies below the plane across the normal; those below the receiver's own don't count.
            own = sector_of(np.maximum(side * plane.edge, side * plane.lean), plane, side, params.sectors)[..., None]
            below |= scan.tilted[..., None] & ((number >= own) if side == 1 else (number < own))
            for layer in range(len(scan.depths)):
                for where, *between in hidden_by(scan, plane, side, layer, params):
                    above = (np.maximum(cot, side * plane.lean) for cot in between)
                    ends = (sector_of(cot, plane, side, params.sectors)[..., None] for cot in above)
                    first, last = sorted_pair(*ends)
                    covered |= where[..., None] & (number >= first) & (number < last)
        weight = plane.weight
        if params.sectors == "cosine":
            weight = weight * plane.length * whole_of(plane)
        hidden += weight * (covered & ~below).mean(axis=-1)
        whole += weight * (~below).mean(axis=-1)
    a: Doubles = 1.0 - hidden / whole
    return a


def hidden_by(
    scan: Scan, plane: Slice, side: int, layer: int, params: BitmaskParams
) -> Iterator[tuple[NDArray[np.bool_], Doubles, Doubles]]:
    """Yield the arcs that one layer hides on a side, from near to far: mask and two cotangents."""
    taps = scan.distinct_taps(plane, side, layer, taps_of(params, len(scan.depths))[1])
    for tap in taps:
        begin, end = tap.solid
        first, last = (scan.cotangent(plane, side, f, tap.x, tap.y) for f in tap.solid)
        # Of joined taps the front's own angle counts, which is measured along the slice.
        own = params.joined & (begin == tap.f)
        yield begin < end, np.where(own, tap.cot, first), last
    if not params.joined:
        for tap in taps:
            yield tap.counts & ~tap.known, tap.back, tap.cot
        return
    zero = np.zeros(scan.depth.shape)
    receiver = Tap(
        there=scan.active if layer == 0 else zero > 1.0,
        counts=zero > 1.0,
        cot=side * plane.edge,
        back=zero,
        distance=zero,
        depth=zero,
        f=zero,
        behind=zero,
        known=zero > 1.0,
        solid=(zero, zero),
        x=zero,
        y=zero,
        px=zero,
    )
    points = [receiver, *taps]
    slopes = [_slope(one, other) for one, other in pairwise(points)]
    tangent = np.where(receiver.there, side * plane.rise, np.nan)
    around = [tangent, *slopes, np.full_like(zero, np.nan)]
    for index, (one, other) in enumerate(pairwise(points)):
        link = slopes[index]
        before, behind = around[index], around[index + 2]
        slack = params.slack * scan.radius * scan.scale(one.f) * scan.scale(other.f)
        slack = slack / np.maximum(other.px - one.px, 0.5)
        least, most = np.fmin(before, behind) - slack, np.fmax(before, behind) + slack
        joined = (link >= least) & (link <= most)
        inside = [scan.outside(end.f, end.x, end.y) <= 0.0 for end in (one, other)]
        yield joined & inside[0] & inside[1], one.cot, other.cot
        cut, at = joined & (inside[0] ^ inside[1]), _cut(scan, plane, side, one, other)
        yield cut, np.where(inside[0], one.cot, at), np.where(inside[0], at, other.cot)
        back = scan.cotangent(plane, side, other.behind, other.x, other.y)
        yield other.there & inside[1] & ~joined & ~other.known, back, other.cot


def _slope(one: Tap, other: Tap) -> Doubles:
    """Return the change of f per px between two taps; NaN where either is missing."""
    slope = (other.f - one.f) / np.maximum(other.px - one.px, 0.5)
    return np.where(one.there & other.there, slope, np.nan)


def _cut(scan: Scan, plane: Slice, side: int, one: Tap, other: Tap) -> Doubles:
    """Return the cotangent where the line between two taps leaves or enters the radius."""
    x, y, f = other.x - one.x, other.y - one.y, other.f - one.f
    start, end = (scan.outside(tap.f, tap.x, tap.y) for tap in (one, other))
    half = scan.outside(one.f + 0.5 * f, one.x + 0.5 * x, one.y + 0.5 * y)
    second = 2.0 * (start + end - 2.0 * half)  # of the parabola through the three
    first = end - start - second
    root = np.sqrt(np.maximum(first**2 - 4.0 * second * start, 0.0))
    below = np.where(end > 0.0, -root, root) - first
    t = np.clip(2.0 * start / np.where(below == 0.0, -1e-30, below), 0.0, 1.0)
    return scan.cotangent(plane, side, one.f + t * f, one.x + t * x, one.y + t * y)


def turn(c: Doubles) -> Doubles:
    """Return c sqrt(1 - c^2) + arcsin c as the kernel has it: a polynomial, within 1e-4."""
    s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
    p = -0.42441899 + s * 0.12509356
    result: Doubles = c * (1.57070303 + s * (0.00594118 + s * (0.72337961 + s * p)))
    return result


def _seen(cot: Doubles, plane: Slice, side: int) -> Doubles:
    """Return the cosine-weighted measure from the view ray to a cotangent on a side."""
    sine = 1.0 / np.hypot(1.0, cot)
    bent = (0.5 * np.pi - turn(cot * sine)) * plane.sin_normal
    result: Doubles = 0.5 * (sine**2 * plane.cos_normal + side * bent)
    return result


def whole_of(plane: Slice) -> Doubles:
    """Return the measure of a slice between its tangent planes."""
    return _seen(plane.lean, plane, 1) + _seen(-plane.lean, plane, -1)


def sorted_pair(one: NDArray[np.int64], other: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the lesser and the greater of two sectors."""
    return np.minimum(one, other), np.maximum(one, other)


def sector_of(
    cot: Doubles, plane: Slice, side: int, sectors: str = "cosine", count: int = SECTORS
) -> NDArray[np.int64]:
    """Return the first sector beyond a cotangent on a side, 0 to `count`, dithered."""
    if sectors == "angle":
        g = np.arctan2(plane.sin_normal, plane.cos_normal)
        share = 0.5 + (side * np.arctan2(1.0, cot) - g) / np.pi
    else:
        share = (_seen(-plane.lean, plane, -1) + side * _seen(cot, plane, side)) / whole_of(plane)
    at = count * share + plane.dither
    return np.clip(at, 0, count).astype(np.int64)
