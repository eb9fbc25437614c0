"""Directional occlusion and a bounce from a visibility bitmask in float64, sector by sector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.bitmask_ao import (
    SECTORS,
    hidden_by,
    sector_of,
    sorted_pair,
    whole_of,
)
from ssgi_cl.reference.gbuffer import Doubles
from ssgi_cl.reference.sky import looked_up
from ssgi_cl.reference.slices import Scan, Slice, scanned
from ssgi_cl.techniques.ssdo_bitmask import SsdoBitmaskParams


def ssdo_bitmask_reference(
    gbuffer: GBuffer,
    params: SsdoBitmaskParams,
    radiance: Doubles | None = None,
    sky: Doubles | None = None,
    *,
    sectors: int = SECTORS,
) -> Doubles:
    """Return images [1, 4 or 7, rows, columns] as `SsdoBitmask.gather` does, from the same taps.

    Args:
        radiance: [layers, rows, columns, 3] of the G-buffer's arrays, or of twice the layers, those
            of their backs behind those of their fronts.
        sky: map [size, size, 3], as `ssgi_cl.techniques.sky.filtered` returns it.
        sectors: of a slice; the kernel has 32, many are what it is right for on average.
    """
    scan, full = scanned(gbuffer, params, params.thickness, params.end, within=True)
    rows, columns = (
        scan.view.origin[i] - full.origin[i] + scan.view.step * np.arange(scan.view.depth.shape[i])
        for i in (0, 1)
    )
    sent = None if radiance is None else np.asarray(radiance)[:, rows[:, None], columns]
    layers = len(scan.depths)
    fronts = None if sent is None else sent[:layers]
    backs = None if sent is None else sent[layers:] if len(sent) > layers else params.back * sent
    shape = scan.depth.shape
    hidden, whole = np.zeros(shape), np.full(shape, 1e-30)
    skylight, bounce = np.zeros((*shape, 3)), np.zeros((*shape, 3))
    number = np.arange(sectors)
    for plane in scan.slices():
        covered = np.zeros((*shape, sectors), bool)
        light = np.zeros((*shape, 3))
        for side in (1, -1):
            for layer in range(layers):
                for found in hidden_by(scan, plane, side, layer, params, ends=True):
                    ends = [
                        sector_of(cot, plane, side, count=sectors)[..., None]
                        for cot in (found.nearer, found.farther)
                    ]
                    least, most = sorted_pair(*ends)
                    now = found.where[..., None] & (number >= least) & (number < most)
                    fresh = (now & ~covered).mean(axis=-1)
                    covered |= now
                    if fronts is None or backs is None:
                        continue
                    rises = side * (ends[1] - ends[0])[..., 0] < 0
                    faces = rises if found.faces is None else found.faces
                    sides = [
                        0.5 * sum(
                            _at_tap(radiance_of_side[layer], scan, plane, side, tap)
                            for tap in (found.first, found.last)
                        )
                        for radiance_of_side in (fronts, backs)
                    ]
                    light += fresh[..., None] * np.where(faces[..., None], *sides)
        share = plane.weight * plane.length * whole_of(plane)
        hidden += share * covered.mean(axis=-1)
        whole += share
        bounce += share[..., None] * light
        if sky is not None:
            free = ~(covered & scan.active[..., None])
            skylight += share[..., None] * looked_up(sky, scan, plane, free, params.cones)
    there = np.isfinite(scan.view.inner(scan.view.depth))
    a = np.where(scan.active, np.clip(1.0 - hidden / whole, 0.0, 1.0), 1.0) ** params.contrast
    images = [a[None]]
    if sky is not None:
        images.append(_irradiance(skylight, whole, there))
    if sent is not None:
        images.append(_irradiance(bounce, whole, scan.active))
    result: Doubles = np.concatenate(images)
    return result


def _irradiance(total: Doubles, whole: Doubles, there: NDArray[np.bool_]) -> Doubles:
    mean = np.pi * total / whole[..., None]
    result: Doubles = np.moveaxis(np.where(there[..., None], mean, 0.0), -1, 0)
    return result


def _at_tap(sent: Doubles, scan: Scan, plane: Slice, side: int, tap: int) -> Doubles:
    """Return radiance [rows, columns, 3] at the place of a tap, numbered as in `Hidden`."""
    rows, columns = sent.shape[:2]
    dx, dy = plane.offset[side][tap - 1] if tap else (np.zeros_like(plane.dither),) * 2
    row, column = (
        np.floor(at).astype(int) for at in (scan.row + dy, scan.column + dx)
    )
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    seen = sent[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    result: Doubles = np.where(inside[..., None], seen, 0.0)
    return result
