"""Splatting of virtual point lights in float64."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import Vpls

if TYPE_CHECKING:
    from ssgi_cl.reference.multires.multires_splat import EveryLight
    from ssgi_cl.techniques.vpl.vpl_splat import VplSplatParams

Doubles = NDArray[np.float64]

PARTS = 16
"""Parts of a light: as many as tiles of 4 x 4 pixels have subsets."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear sRGB (ITU-R BT.709)."""
SHARPEST = 1000.0
"""Greatest exponent of a lobe."""

Blocked = Callable[[Doubles, Doubles, Doubles, Doubles], NDArray[np.bool_]]
"""Points and normals [n, 3] of receivers, and a light's -> where the light is hidden [n]."""


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
    to_eye = np.broadcast_to(camera.view[2, :3], point.shape) if camera.is_orthographic else camera.position - point
    behind = np.sum(normal * to_eye, axis=-1, keepdims=True) < 0.0
    return seen, point, np.where(behind, -normal, normal)


def vpl_splat_reference(gbuffer: GBuffer, vpls: Vpls, params: VplSplatParams | EveryLight) -> Doubles:
    """Return irradiance [rows, columns, 3] in W/m^2 by all lights, without visibility or blur.

    With `interleave`, pixel (x, y) takes the lights i with i % 16 = (y % 4) * 4 + x % 4, times 16;
    of lights with parts that are near, part number i % 16 of each, times 16.
    """
    seen, point, normal = receivers(gbuffer)
    total = np.zeros_like(point)
    subset = _subsets(seen)[seen] if params.interleave else np.zeros(len(point), np.int64)
    for index in range(len(vpls)):
        taken = subset == (index % 16 if params.interleave else 0)
        weight = form_factor(point[taken], normal[taken], vpls, index, params)
        if params.interleave and vpls.parts is not None and params.refine > 0.0:
            squared = np.sum((vpls.position[index] - point) ** 2, axis=-1)
            near = 4.0 / 3.0 * (1.0 - squared / (params.refine * vpls.area[index]))
            share = np.clip(near, 0.0, 1.0)
            weight *= 1.0 - share[taken]
            for part in range(PARTS):
                own = (subset == part) & (share > 0.0)
                number = PARTS * index + part
                shining = form_factor(point[own], normal[own], vpls.parts, number, params)
                total[own] += (share[own] * shining)[:, None] * vpls.parts.flux[number]
        total[taken] += weight[:, None] * vpls.flux[index]
    result = np.zeros((*seen.shape, 3))
    result[seen] = total * (16.0 if params.interleave else 1.0)
    return result


def vpl_visibility_reference(
    gbuffer: GBuffer, vpls: Vpls, params: VplSplatParams, lists: NDArray[np.object_], hidden: Blocked
) -> Doubles:
    """Return irradiance [rows, columns, 3] with visibility and without blur, of one batch.

    Args:
        gbuffer: what the camera sees.
        vpls: the lights.
        params: of which `share` says how many neighbours of a list share a shadow ray, whose target
            is one of them with a probability in proportion to its flux.
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
            weights = np.stack([form_factor(point[own], normal[own], vpls, i, params) for i in group])
            flux = vpls.flux[group]
            before = np.cumsum(flux @ LUMINANCE)
            x, y = 4 * column + s % 4, 4 * row + s // 4
            wanted = share_number(x, y, first // params.share) * before[-1]
            target = group[min(np.searchsorted(before, wanted, side="right"), len(group) - 1)]
            blocked = hidden(point[own], normal[own], vpls.position[target], vpls.normal[target])
            total[own] += np.where(blocked, 0.0, weights).T @ flux
    result = np.zeros((*seen.shape, 3))
    result[seen] = 16.0 * total
    return result


def share_number(x: int, y: int, group: int) -> float:
    """Return where in (0, 1) of a group's flux the target of its shadow ray is.

    Args:
        x, y: number of the tile's subset, of 4 a tile along each side.
        group: number of the group in the subset's list.
    """
    return ((x * 12368 + y * 9336 + group * 10125) % 2**14 + 0.5) / 2.0**14


def form_factor(
    point: Doubles, normal: Doubles, vpls: Vpls, index: int, params: VplSplatParams | EveryLight
) -> Doubles:
    """Return irradiance per flux [points] by light `index`, cut as the parameters say."""
    way = vpls.position[index] - point
    squared = np.maximum(np.sum(way * way, axis=-1), 1e-300)
    received = np.maximum(np.sum(way * normal, axis=-1), 0.0)
    emitted = np.maximum(-(way @ vpls.normal[index]), 0.0)
    area, sphere, lobe = vpls.area[index], math.pi * squared, emitted / np.sqrt(squared)
    if vpls.axis is not None and vpls.gloss is not None:
        cosine = np.maximum(-(way @ vpls.axis[index]), 0.0) / np.sqrt(squared)
        exponent = min(max(vpls.gloss[index], 1.0), SHARPEST)
        sharp = (exponent - 1.0) / (1.0 + (exponent - 1.0) * area / (4.0 * math.pi * squared))
        turned = float(vpls.axis[index] @ vpls.normal[index])
        share = lobe_share(exponent, turned)
        lobe = np.where(emitted > 0.0, np.minimum(cosine, 1.0) ** (sharp + 1.0), 0.0)
        sphere = squared * 2.0 * math.pi * share / (sharp + 2.0)
    spread = sphere + area if params.near == "disk" else np.maximum(sphere, area)
    weight = received / np.sqrt(squared) * lobe / spread
    if params.cutoff > 0.0:
        cut = params.cutoff / (math.pi * params.unit_distance**2)
        weight = np.maximum(np.minimum(weight, 2.0 * (weight - cut)), 0.0)
    result: Doubles = weight
    return result


def lobe_share(exponent: float, cosine: float) -> float:
    """Return the fit to `lobe_share_exact` that light is defined with, within 0.4 % of it.

    1 - exp(-1.1 sqrt(q) - .7123 q) / 2 with q = -(n + .6374) ln(sine).

    Args:
        exponent: n >= 1.
        cosine: of the axis to the normal, in [0, 1] or clipped to it.
    """
    sine = math.sqrt(max(1.0 - min(max(cosine, 0.0), 1.0) ** 2, 1e-30))
    q = -(exponent + 0.6374) * math.log(sine)
    return 1.0 - 0.5 * math.exp(-1.1 * math.sqrt(q) - 0.7123 * q)


def lobe_share_exact(exponent: float, cosine: float) -> float:
    """Return which share of a lobe (n + 1) / (2 pi) cos^n lies above its surface.

    Where its axis turns away from the normal, the surface's edge sweeps over the lobe: the share
    falls by sin^n of the angle per radian, times what makes it 1/2 at a right angle.

    Args:
        exponent: n >= 1.
        cosine: of the axis to the normal, in [0, 1] or clipped to it.
    """

    def swept(angle: float) -> float:
        node, weight = _gauss_points()
        return float(weight @ np.sin(0.5 * angle * (node + 1.0)) ** exponent) * angle

    angle = math.acos(min(max(cosine, 0.0), 1.0))
    return 1.0 - 0.5 * swept(angle) / swept(0.5 * math.pi)


@lru_cache(maxsize=1)
def _gauss_points() -> tuple[Doubles, Doubles]:
    return np.polynomial.legendre.leggauss(200)


def _subsets(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    row, column = np.indices(seen.shape, np.int64)
    subset: NDArray[np.int64] = np.add(row % 4 * 4, column % 4)
    return subset
