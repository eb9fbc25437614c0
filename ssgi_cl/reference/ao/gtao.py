"""GTAO in float64, slice by slice as defined in `ssgi_cl.techniques.ao.gtao`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.occlusion import finished as complete
from ssgi_cl.reference.ao.slices import Scan, Slice, finished, scanned
from ssgi_cl.reference.gbuffer import Doubles

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.gtao import GtaoParams

LEAST_OPEN = 0.02
"""Least component of a bent normal along the normal; unoccluded, it is 1."""


def gtao_reference(gbuffer: GBuffer, params: GtaoParams) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same taps as the kernel, blurred and upsampled alike."""
    return finished(gbuffer, params, lambda scan: visibility(scan, params))


def bent_reference(gbuffer: GBuffer, params: GtaoParams) -> NDArray[np.float64]:
    """Return bent normals [rows, columns, 3], world space; 0 where nothing is."""
    scan, full = scanned(gbuffer, params)
    bend = complete(np.where(scan.active[..., None], bends(scan, params), 0.0), scan.view, full, params)
    normal = full.inner(full.normal)
    there = np.isfinite(full.inner(full.depth))[..., None]
    bent = normal + np.where(there, bend, 0.0)
    n_dot_v = np.sum(bent * normal, axis=-1, keepdims=True)
    bent = bent + normal * np.maximum(LEAST_OPEN - n_dot_v, 0.0)
    bent = bent / np.where(there, np.linalg.norm(bent, axis=-1, keepdims=True), 1.0)
    world: Doubles = bent @ gbuffer.camera.view[:3, :3]
    return world


def visibility(scan: Scan, params: GtaoParams) -> Doubles:
    """Return A before blur: 1 - what the horizons hide, over what slices see without them."""
    hidden, whole = np.zeros(scan.depth.shape), np.full(scan.depth.shape, 1e-30)
    for plane in scan.slices():
        weight = plane.weight * plane.length
        for side in (1, -1):
            edge, horizon = horizons(scan, params, plane, side)
            # A triangle's own plane, where it is not across the normal, ends what could be seen.
            own = np.minimum(np.arctan2(1.0, side * plane.edge), edge)
            open_ = arc_integral(np.where(scan.tilted, own, edge), plane, side)
            hidden += weight * (open_ - arc_integral(horizon, plane, side))
            whole += weight * open_
    a: Doubles = 1.0 - hidden / whole
    return a


def bends(scan: Scan, params: GtaoParams) -> Doubles:
    """Return the bend of each normal [rows, columns, 3] in view space, before blur.

    The mean of all directions over a surface, weighted by their cosines, is 2/3 of its normal n.
    The hidden directions are subtracted from it: n - 3/2 hidden / whole.
    """
    slope = (*scan.slope, np.full(scan.depth.shape, -1.0))
    view_ray = np.stack(np.broadcast_arrays(*slope), axis=-1) / np.sqrt(scan.ray_squared)[..., None]
    hidden, whole = np.zeros(view_ray.shape), np.full(scan.depth.shape, 1e-30)
    for plane in scan.slices():
        offset = np.stack([plane.cosine * scan.to_x, plane.sine * scan.to_y, np.zeros(scan.depth.shape)], axis=-1)
        across = offset - np.sum(offset * view_ray, axis=-1, keepdims=True) * view_ray
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        weight = plane.weight * plane.length
        for side in (1, -1):
            edge, horizon = horizons(scan, params, plane, side)
            all_, seen = (arc_directions(angle, plane, side) for angle in (edge, horizon))
            up, along = ((weight * (a - b))[..., None] for a, b in zip(all_, seen, strict=True))
            hidden += -up * view_ray + side * along * across
            whole += weight * arc_integral(edge, plane, side)
    bend: Doubles = -1.5 * hidden / whole[..., None]
    return bend


def horizons(scan: Scan, params: GtaoParams, plane: Slice, side: int) -> tuple[Doubles, Doubles]:
    """Return the angles from the view ray of the plane across the normal and of the horizon.

    That is measured from the tangent plane, and no lower than either.
    """
    edge = np.arctan2(1.0, side * plane.edge)
    cosine = low = np.cos(edge)
    for taps in scan.taps_of_all_layers(plane, side):
        found = low
        for tap in taps:
            top = tap.cot / np.hypot(1.0, tap.cot)
            if params.falloff > 0.0:
                thin = (1.0 + params.thin_occluder) ** 2 - 1.0
                distance = np.sqrt(tap.distance**2 + thin * tap.depth**2)
                fade = np.clip((1.0 - distance) / params.falloff, 0.0, 1.0)
                top = low + fade * (top - low)
            found = np.where(tap.counts, np.maximum(found, top), found)
        # A lower tap draws the horizon down.
        cosine = np.where(found >= cosine, found, cosine + params.horizon_decay * (found - cosine))
    end = np.arctan2(1.0, side * plane.lean)
    return end, np.minimum(np.arccos(cosine), end)


def arc_integral(angle: Doubles, plane: Slice, side: int) -> Doubles:
    """Return the visibility between the view ray and an angle from it (Jimenez et al., eq. 7).

    (cos g + 2 h sin g - cos(2 h - g)) / 4, the normal's angle g counted towards the side.
    """
    g = np.arctan2(side * plane.sin_normal, plane.cos_normal)
    result: Doubles = 0.25 * (np.cos(g) + 2.0 * angle * np.sin(g) - np.cos(2.0 * angle - g))
    return result


def arc_directions(angle: Doubles, plane: Slice, side: int) -> tuple[Doubles, Doubles]:
    """Return the sum of the directions between the view ray and an angle h from it.

    The integral of (cos t, sin t) cos(t - g) sin t over t from 0 to h: its parts towards the eye
    and, across the view ray, towards the side.
    """
    sin_g, cos_g = side * plane.sin_normal, plane.cos_normal
    c, s = np.cos(angle), np.sin(angle)
    up = (cos_g * (1.0 - c**3) + sin_g * s**3) / 3.0
    along = (cos_g * s**3 + sin_g * (2.0 - 3.0 * c + c**3)) / 3.0
    return up, along
