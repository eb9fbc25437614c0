"""GTAO in float64, slice by slice as defined in `ssgi_cl.techniques.gtao`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles
from ssgi_cl.reference.slices import Scan, Slice, finished
from ssgi_cl.techniques.gtao import GtaoParams


def gtao_reference(gbuffer: GBuffer, params: GtaoParams | None = None) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same taps as the kernel, blurred and upsampled alike."""
    params = params or GtaoParams()
    return finished(gbuffer, params, lambda scan: openness(scan, params))


def openness(scan: Scan, params: GtaoParams) -> Doubles:
    """Return A before blur: 1 - what the horizons hide, over what slices see without them."""
    hidden, whole = np.zeros(scan.depth.shape), np.full(scan.depth.shape, 1e-30)
    for plane in scan.slices():
        weight = plane.weight * plane.length
        for side in (1, -1):
            edge = np.arctan2(1.0, side * plane.edge)
            cosine = np.cos(edge)
            for index in range(params.taps):
                for tap in scan.taps(plane, side, index):
                    top = tap.cot / np.hypot(1.0, tap.cot)
                    if params.falloff > 0.0:
                        thin = (1.0 + params.thin_occluder) ** 2 - 1.0
                        distance = np.sqrt(tap.distance**2 + thin * tap.depth**2)
                        fade = np.clip((1.0 - distance) / params.falloff, 0.0, 1.0)
                        top = np.cos(edge) + fade * (top - np.cos(edge))
                    cosine = np.where(tap.counts, np.maximum(cosine, top), cosine)
            open_ = arc_integral(edge, plane, side)
            hidden += weight * (open_ - arc_integral(np.arccos(cosine), plane, side))
            whole += weight * open_
    a: Doubles = 1.0 - hidden / whole
    return a


def arc_integral(angle: Doubles, plane: Slice, side: int) -> Doubles:
    """Return what is seen between the line of sight and an angle from it (Jimenez et al., eq. 7).

    (cos g + 2 h sin g - cos(2 h - g)) / 4, the normal's angle g counted towards the side.
    """
    g = np.arctan2(side * plane.sin_normal, plane.cos_normal)
    result: Doubles = 0.25 * (np.cos(g) + 2.0 * angle * np.sin(g) - np.cos(2.0 * angle - g))
    return result
