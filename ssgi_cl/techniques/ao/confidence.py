"""Where ambient occlusion of a G-buffer may be trusted: what its layers do not tell, and what taps may miss."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.view import downloaded
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique, prepared_for, surfaces_on_device
from ssgi_cl.techniques.ao.occlusion_bands import Reach, occlusion_plan, pixels_per_depth
from ssgi_cl.techniques.ao.slices import slice_reach
from ssgi_cl.techniques.bands import Plan, Planner, in_bands

WINDOW = 9
"""Columns and rows over which the spread of single pixels' occlusion is taken; beyond the border the image goes on as
there."""
SPREAD = 0.5
"""Of the standard deviation there, counted as doubt: the mean of 81 pixels that taps meet by chance errs less."""
LEAST_SLACK, MOST_SLACK = 0.05, 0.4
"""Of `bitmask_ao`, with which taps on surfaces of few and of many shapes are joined."""


@serialised
def ao_confidence(
    gbuffer: GBuffer | DeviceGBuffer, ao: ArrayLike, radius: float, *, runtime: Runtime | None = None
) -> NDArray[np.float32]:
    """Estimate how far ambient occlusion may be from that of the scene, of any technique.

    Techniques return it themselves with `confidence=True`.

    Bounds by the bitmask of Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility
    Bitmask". Departs: it is computed twice, with nothing where no layer tells what is there, and
    with all of it solid; the spread between these and `ao`, half of the standard deviation of
    single pixels' A over 9 x 9 pixels, and the share of the disk of the radius beyond the arrays
    are the doubt. Surfaces whose `thickness` is known end there; the last layer has anything behind
    it.

    Args:
        gbuffer: what `ao` was computed from; more layers, overscan and `thickness` give confidence.
        ao: A [rows, columns] in [0, 1].
        radius: with which it was computed, scene units, > 0.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns] float32 in [0, 1]: 1 less the doubt, and 1 where nothing is there.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    if not isinstance(gbuffer, (GBuffer, DeviceGBuffer)):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer or DeviceGBuffer")
    a = checks.plane("ao", ao, low=0.0, high=1.0)
    if a.shape != gbuffer.size:
        raise ValueError(f"ao has shape {a.shape}: expected {gbuffer.size}, the size of the camera's image")
    radius = checks.number("radius", radius, low=0.0, high=1e30, above=True, unit="scene units")
    return _confidence(gbuffer, a, radius, runtime)


def with_confidence(
    found: Any, gbuffer: GBuffer | DeviceGBuffer, radius: Any, runtime: Runtime | None, max_memory: int | None = None
) -> Any:
    """Return what a technique found, A or several arrays of which A is the first, and last the confidence in A.

    Args:
        found: the technique's results.
        gbuffer, runtime: as its function was called.
        radius: of it, or several, of which the largest counts.
        max_memory: most bytes of device memory, if there is a limit.
    """
    results = found if isinstance(found, tuple) else (found,)
    reach = max(radius) if isinstance(radius, tuple) else radius
    return (*results, _confidence(gbuffer, results[0], reach, runtime, max_memory))


def confident_plan(technique: type[OcclusionTechnique], reach: Reach) -> Planner:
    """Return the plan of a technique whose function takes `confidence`, which is that of the whole image.

    Args:
        technique, reach: see `occlusion_plan`.
    """
    without = occlusion_plan(technique, reach)

    def plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
        given = dict(arguments)
        wanted = given.pop("confidence", False)
        checks.switch("confidence", wanted)
        made = without(gbuffer, runtime, given)
        if not wanted:
            return made

        def whole(found: Any, max_memory: int) -> Any:
            return with_confidence(found, gbuffer, made.arguments["radius"], runtime, max_memory)

        return made._replace(whole=whole)

    return plan


def _confidence(
    gbuffer: GBuffer | DeviceGBuffer,
    a: NDArray[np.float32],
    radius: float,
    runtime: Runtime | None,
    max_memory: int | None = None,
) -> NDArray[np.float32]:
    """Return what `ao_confidence` does, of arguments that are checked, within `max_memory` if that is given."""
    if isinstance(gbuffer, DeviceGBuffer):
        runtime, gbuffer = gbuffer.runtime, downloaded(gbuffer)
    runtime = runtime or Runtime.open()
    least, most = ends(gbuffer)
    open_, closed = (
        _bitmask(_with_thickness(gbuffer, thickness), BitmaskParams(radius=radius, slack=slack), runtime, max_memory)
        for thickness, slack in ((least, LEAST_SLACK), (most, MOST_SLACK))
    )
    single = _bitmask(gbuffer, BitmaskParams(radius=radius, blur_radius=0), runtime, max_memory).astype(np.float64)
    mean, square = (ndimage.uniform_filter(image, WINDOW, mode="nearest") for image in (single, single * single))
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0))
    doubt = np.maximum(open_, a) - np.minimum(closed, a) + SPREAD * spread + _beyond(gbuffer, radius)
    depth = gbuffer.first("depth")
    assert depth is not None  # noqa: S101  every G-buffer has one
    there = np.isfinite(gbuffer.inner(depth))
    result: NDArray[np.float32] = np.where(there, np.clip(1.0 - doubt, 0.0, 1.0), 1.0).astype(np.float32)
    return result


def _bitmask(gbuffer: GBuffer, params: BitmaskParams, runtime: Runtime, max_memory: int | None) -> NDArray[np.float32]:
    """Return A by the bitmask."""

    def occlusion(gbuffer: GBuffer, *, runtime: Runtime, **fields: Any) -> NDArray[np.float32]:
        device = surfaces_on_device(gbuffer, runtime)
        return prepared_for(BitmaskAo, device, BitmaskParams(**fields))(device)

    fields = {each.name: getattr(params, each.name) for each in dataclasses.fields(params)}
    if max_memory is None:
        return occlusion(gbuffer, runtime=runtime, **fields)
    plan = occlusion_plan(BitmaskAo, slice_reach)(gbuffer, runtime, fields)
    found: NDArray[np.float32] = in_bands(occlusion, gbuffer, runtime, plan, max_memory)
    return found


def ends(gbuffer: GBuffer) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the least and the greatest thickness that surfaces of a G-buffer may have, of every layer."""
    depth = np.asarray(gbuffer.depth, np.float32)
    depth = depth.reshape(gbuffer.layers, *depth.shape[-2:])
    given = np.full(depth.shape, -1.0, np.float32)
    if gbuffer.thickness is not None:
        known = np.asarray(gbuffer.thickness, np.float32).reshape(-1, *depth.shape[1:])
        given[: len(known)] = known
    there = np.isfinite(depth)
    own = np.where(there, depth, 0.0)
    # Between two layers is nothing or a solid; behind the last one of a pixel, nothing unless it is the last of all.
    following = np.where(there[1:], own[1:] - own[:-1], 0.0)
    most = np.where(given < 0.0, np.concatenate([following, np.zeros_like(depth[:1])]), given)
    most[-1] = np.inf
    shape = np.shape(gbuffer.depth)
    least = np.where(there, np.maximum(given, 0.0), 0.0).astype(np.float32)
    return least.reshape(shape), np.where(there, most, 0.0).astype(np.float32).reshape(shape)


def _with_thickness(gbuffer: GBuffer, thickness: NDArray[np.float32]) -> GBuffer:
    """Return a G-buffer with another thickness; its depths are as exact as before."""
    other = copy(gbuffer)
    object.__setattr__(other, "thickness", thickness)
    return other


def _beyond(gbuffer: GBuffer, radius: float) -> NDArray[np.float64]:
    """Return the share [rows, columns] of the disk of the radius round each pixel that lies beyond the arrays."""
    depth = gbuffer.first("depth")
    assert depth is not None  # noqa: S101  every G-buffer has one
    own = gbuffer.inner(depth).astype(np.float64)
    own = np.where(np.isfinite(own), own, 1.0)
    pixels = radius * pixels_per_depth(gbuffer.camera, 1.0)
    reach = np.full(own.shape, pixels) if gbuffer.camera.is_orthographic else pixels / own
    rows, columns = np.indices(own.shape) + 0.5
    top, left = gbuffer.margin
    share = np.zeros(own.shape)
    for before, count, margin in ((rows, own.shape[0], top), (columns, own.shape[1], left)):
        for distance in (before + margin, count - before + margin):
            t = np.clip(distance / np.maximum(reach, 1.0), 0.0, 1.0)
            share += (np.arccos(t) - t * np.sqrt(1.0 - t * t)) / np.pi  # segment of a disk
    return np.minimum(share, 1.0)
