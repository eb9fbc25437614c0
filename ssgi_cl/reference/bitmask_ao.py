"""Bitmask AO in float64, sector by sector as defined in `ssgi_cl.techniques.bitmask_ao`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles
from ssgi_cl.reference.slices import Scan, Slice, finished
from ssgi_cl.techniques.bitmask_ao import BitmaskParams

SECTORS = 32


def bitmask_reference(
    gbuffer: GBuffer, params: BitmaskParams | None = None
) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same taps as the kernel, blurred and upsampled alike."""
    params = params or BitmaskParams()
    return finished(gbuffer, params, lambda scan: openness(scan, params), params.thickness)


def openness(scan: Scan, params: BitmaskParams) -> Doubles:
    """Return A before blur: the share of sectors that no tap covers."""
    hidden, whole = np.zeros(scan.depth.shape), np.full(scan.depth.shape, 1e-30)
    number = np.arange(SECTORS)
    for plane in scan.slices():
        covered = np.zeros((*scan.depth.shape, SECTORS), bool)
        for side in (1, -1):
            for index in range(params.taps):
                for tap in scan.taps(plane, side, index):
                    front, back = (
                        _sector(cot, plane, side, params.sectors)[..., None]
                        for cot in (tap.cot, tap.back)
                    )
                    first, last = (front, back) if side == 1 else (back, front)
                    covered |= tap.counts[..., None] & (number >= first) & (number < last)
        weight = plane.weight
        if params.sectors == "cosine":
            weight = weight * plane.length * _whole(plane)
        hidden += weight * covered.mean(axis=-1)
        whole += weight
    a: Doubles = 1.0 - hidden / whole
    return a


def turn(c: Doubles) -> Doubles:
    """Return c sqrt(1 - c^2) + arcsin c as the kernel has it: a polynomial, within 1.1e-3."""
    c2 = c * c
    result: Doubles = c * (
        2.00826063 + c2 * (-0.41591462 + c2 * (0.16016449 - c2 * 0.18065745))
    )
    return result


def _seen(cot: Doubles, plane: Slice, side: int) -> Doubles:
    """Return the cosine-weighted measure from the line of sight to a cotangent on a side."""
    sine = 1.0 / np.hypot(1.0, cot)
    bent = (0.5 * np.pi - turn(cot * sine)) * plane.sin_normal
    result: Doubles = 0.5 * (sine**2 * plane.cos_normal + side * bent)
    return result


def _whole(plane: Slice) -> Doubles:
    return _seen(plane.edge, plane, 1) + _seen(-plane.edge, plane, -1)


def _sector(cot: Doubles, plane: Slice, side: int, sectors: str) -> NDArray[np.int64]:
    """Return the first sector beyond a cotangent on a side, 0 to 32, dithered."""
    if sectors == "angle":
        g = np.arctan2(plane.sin_normal, plane.cos_normal)
        share = 0.5 + (side * np.arctan2(1.0, cot) - g) / np.pi
    else:
        share = (_seen(-plane.edge, plane, -1) + side * _seen(cot, plane, side)) / _whole(plane)
    at = SECTORS * share + plane.dither
    return np.clip(at, 0, SECTORS).astype(np.int64)
