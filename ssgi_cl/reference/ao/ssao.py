"""SSAO in float64, sample by sample as defined in `ssgi_cl.techniques.ao.ssao`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.facets import tilted
from ssgi_cl.reference.ao.occlusion import RESOLUTIONS, finished
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.patterns import reflected_points

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.ssao import SsaoParams

DEPTH_BIAS = 2e-6
"""Height of a surface that counts as none, relative to depth: 34 * 2^-24."""
ONSET = 0.02  # radii
NEAREST_SAMPLE = 1e-3
"""Samples nearer to the eye than this share of the pixel's depth are not counted."""


def ssao_reference(gbuffer: GBuffer, params: SsaoParams) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same points as the kernel, blurred and upsampled alike."""
    full = SurfaceView.of(gbuffer)
    step = RESOLUTIONS[params.resolution]
    view = full.reduced(step) if step > 1 else full
    return finished(visibility(view, params) * planes(view, params)[1], view, full, params)


def planes(view: SurfaceView, params: SsaoParams) -> tuple[Doubles, Doubles]:
    """Return normals of tangent planes [rows, columns, 3], and what to multiply A by after contrast.

    Where a triangle's plane is known and not across the given normal, it is the tangent plane, and the
    share by cosine of the normal's hemisphere that lies above it is what can be open.
    """
    normal = view.inner(view.normal)
    known, facet = tilted(view)
    known, facet = view.inner(known), view.inner(facet)
    depth = view.inner(view.depth)
    reach_px = max(params.radius) * view.pixels_per_unit(depth)  # type: ignore[arg-type]
    known = known & (np.minimum(reach_px, params.max_radius_px / view.step) >= 1.0) & params.hemisphere
    share = np.where(known, 0.5 * (1.0 + np.sum(facet * normal, axis=-1)), 1.0)
    return np.where(known[..., None], facet, normal), share


def falloff(d: Doubles, params: SsaoParams) -> Doubles:
    """Return the occlusion by a surface d radii in front of a sample."""
    if params.falloff == "exponential":
        return np.exp(-params.falloff_rate * d)
    if params.falloff == "ramp":
        ramp = np.clip((params.ramp_end - d) / (params.ramp_end - params.ramp_start), 0.0, 1.0)
        return ramp**params.power
    values = np.asarray(params.falloff, np.float64)
    return np.interp(d, np.linspace(0.0, params.falloff_end, len(values)), values, right=0.0)


def visibility(view: SurfaceView, params: SsaoParams, points: Doubles | None = None) -> Doubles:
    """Return A before blur and `planes`: 1 - the greatest occlusion of all radii, to the power of contrast.

    Args:
        view: what is seen.
        params: the occlusion model, and how many points a pixel takes.
        points: [points, 3] in the unit ball, of which every pixel takes all, instead of the
            kernel's.
    """
    rows, columns = view.size
    there = np.isfinite(view.inner(view.depth))
    depth = np.where(there, view.inner(view.depth), 1.0)
    normal, _ = planes(view, params)
    centre_row, centre_column = view.centres()
    position = view.position(view.inner(centre_row), view.inner(centre_column), depth)
    y, x = np.indices((rows, columns))
    if points is None:
        fewest, most = params.samples, max(params.samples, params.max_samples)
        table = reflected_points(most, params.length_power)[y % 8, x % 8]
    else:
        fewest = most = len(points)
        table = points[None, None]  # row, column, point, axis
    result = np.ones((rows, columns))
    for wanted in params.radius:  # type: ignore[union-attr]
        wanted_px = wanted * view.pixels_per_unit(depth)
        limit_px = params.max_radius_px / view.step
        radius_px = np.minimum(wanted_px, limit_px)
        radius = np.where(wanted_px > limit_px, wanted * limit_px / wanted_px, wanted)
        count = np.clip(radius_px * view.step * params.samples / params.near_px, fewest, most).astype(int)
        count[radius_px < 1.0] = 0
        occlusion = np.zeros((rows, columns))
        known = np.zeros((rows, columns))
        for i in range(most):
            counted, amount = _sample(view, params, position, normal, radius, table[:, :, i])
            counted &= there & (i < count)
            known += counted
            occlusion += np.where(counted, amount, 0.0)
        result = np.minimum(result, 1.0 - occlusion / np.maximum(known, 1.0))
    contrasted: Doubles = np.clip(result, 0.0, 1.0) ** params.contrast
    return contrasted


def _sample(
    view: SurfaceView, params: SsaoParams, position: Doubles, normal: Doubles, radius: Doubles, point: Doubles
) -> tuple[NDArray[np.bool_], Doubles]:
    """Return whether one sample of every pixel counts, and how much it is occluded."""
    if params.hemisphere:
        beneath = np.sum(point * normal, axis=-1) < 0.0
        point = np.where(beneath[..., None], -point, point)
    at = position + radius[..., None] * point
    depth = -position[..., 2]
    counted = -at[..., 2] > NEAREST_SAMPLE * depth
    row, column = view.pixel(np.where(counted[..., None], at, position))
    rows, columns = view.depth.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    tap = (np.clip(np.floor(row), 0, rows - 1).astype(int), np.clip(np.floor(column), 0, columns - 1).astype(int))
    seen = view.depth[tap]
    if params.outside == "unknown":
        counted = counted & inside
    else:
        border = np.inf if params.outside == "open" else float(params.outside)
        seen = np.where(inside, seen, border)
    occludes = counted & (-at[..., 2] > seen)
    finite = np.where(np.isfinite(seen), seen, 0.0)
    onset = np.ones(depth.shape)
    if params.hemisphere:
        # Only what rises above the tangent plane occludes; of a border the place is not known.
        # Both tests set in over a fiftieth of a radius.
        surface = view.position(tap[0] + 0.5, tap[1] + 0.5, finite)
        height = np.sum((surface - position) * normal, axis=-1)
        above = height - params.bias * radius - DEPTH_BIAS * depth
        excess = np.where(inside, np.minimum(-at[..., 2] - finite, above), -at[..., 2] - finite)
        onset = np.clip(excess / (ONSET * radius), 0.0, 1.0)
    behind = np.where(occludes, (-at[..., 2] - finite) / radius, 0.0)
    return counted, np.where(occludes, falloff(behind, params) * onset, 0.0)
