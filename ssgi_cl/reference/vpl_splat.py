"""Splatting of virtual point lights in float64."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.techniques.vpl_splat import VplSplatParams
from ssgi_cl.vpls import Vpls

Doubles = NDArray[np.float64]

Sight = Callable[[Doubles, Doubles, Doubles, Doubles, float], NDArray[np.bool_]]
"""Points and normals [n, 3] of receivers, a light's, a phase -> where the light is hidden [n]."""


def receivers(gbuffer: GBuffer) -> tuple[NDArray[np.bool_], Doubles, Doubles]:
    """Return where a surface is [rows, columns], and its points and normals there [n, 3].

    World space; normals face the viewer.

    Raises:
        ValueError: the G-buffer has no normals; they are not reconstructed here.
    """
    depth = gbuffer.inner(np.asarray(gbuffer.first("depth"), np.float64))
    given = gbuffer.first("normal")
    if given is None:
        raise ValueError("the G-buffer has no normals: expected them")
    seen = np.isfinite(depth)
    camera = gbuffer.camera
    point = camera.unproject(np.where(seen, depth, 1.0))[seen]
    normal = gbuffer.inner(given.astype(np.float64))[seen]
    if camera.is_orthographic:
        to_eye = np.broadcast_to(camera.view[2, :3], point.shape)
    else:
        to_eye = camera.position - point
    behind = np.sum(normal * to_eye, axis=-1, keepdims=True) < 0.0
    return seen, point, np.where(behind, -normal, normal)


def vpl_splat_reference(gbuffer: GBuffer, vpls: Vpls, params: VplSplatParams) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by all lights, without visibility or blur.

    With `interleave`, pixel (x, y) takes the lights i with i % 16 = (y % 4) * 4 + x % 4, times 16.
    """
    seen, point, normal = receivers(gbuffer)
    total = np.zeros_like(point)
    subset = _subsets(seen)[seen] if params.interleave else np.zeros(len(point), np.int64)
    for index in range(len(vpls)):
        taken = subset == (index % 16 if params.interleave else 0)
        weight = form_factor(point[taken], normal[taken], vpls, index, params)
        total[taken] += weight[:, None] * vpls.flux[index]
    result = np.zeros((*seen.shape, 3))
    result[seen] = total * (16.0 if params.interleave else 1.0)
    return result


def vpl_sight_reference(
    gbuffer: GBuffer,
    vpls: Vpls,
    params: VplSplatParams,
    lists: NDArray[np.object_],
    hidden: Sight,
) -> Doubles:
    """Return irradiance [rows, columns, 3] with visibility and without blur, of one batch.

    Args:
        gbuffer: what the camera sees.
        vpls: the lights.
        params: of which `share` says how many neighbours of a list share a line of sight.
        lists: [tile rows, tile columns, 16] arrays: which lights a tile's subset looks at.
        hidden: whether something stands between.
    """
    seen, point, normal = receivers(gbuffer)
    subset = _subsets(seen)
    number = np.full(seen.shape, -1)
    number[seen] = np.arange(len(point))
    total = np.zeros_like(point)
    for row, column, s in np.ndindex(lists.shape):
        tile = np.s_[16 * row : 16 * row + 16, 16 * column : 16 * column + 16]
        own = number[tile][(subset[tile] == s) & seen[tile]]
        lights = lists[row, column, s]
        for first in range(0, len(lights), params.share):
            group = lights[first : first + params.share]
            target = group[(s * 7 + 3) % 16 * len(group) // 16]
            phase = (((s * 5 + first // params.share * 3) & 15) + 0.5) / 16.0
            blocked = hidden(
                point[own], normal[own], vpls.position[target], vpls.normal[target], phase
            )
            for light in group:
                weight = form_factor(point[own], normal[own], vpls, light, params)
                total[own] += np.where(blocked, 0.0, weight)[:, None] * vpls.flux[light]
    result = np.zeros((*seen.shape, 3))
    result[seen] = 16.0 * total
    return result


def form_factor(
    point: Doubles, normal: Doubles, vpls: Vpls, index: int, params: VplSplatParams
) -> Doubles:
    """Return irradiance per flux [points] by light `index`, cut as the parameters say."""
    way = vpls.position[index] - point
    squared = np.maximum(np.sum(way * way, axis=-1), 1e-300)
    received = np.maximum(np.sum(way * normal, axis=-1), 0.0)
    emitted = np.maximum(-(way @ vpls.normal[index]), 0.0)
    area = vpls.area[index]
    if params.near == "disk":
        spread = math.pi * squared + area
    else:
        spread = np.maximum(math.pi * squared, area)
    weight = received * emitted / (squared * spread)
    if params.cutoff > 0.0:
        cut = params.cutoff / (math.pi * params.unit_distance**2)
        weight = np.maximum(np.minimum(weight, 2.0 * (weight - cut)), 0.0)
    result: Doubles = weight
    return result


def _subsets(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    row, column = np.indices(seen.shape, np.int64)
    subset: NDArray[np.int64] = np.add(row % 4 * 4, column % 4)
    return subset
