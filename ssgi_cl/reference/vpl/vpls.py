"""Choice of virtual point lights from reflective shadow maps, in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.reference.rsm.rsm import hilbert_order, mirrored_axes, texels
from ssgi_cl.reference.vpl.vpl_splat import LUMINANCE, PARTS, SHARPEST

Doubles = NDArray[np.float64]


def choose_vpls_reference(
    rsms: Sequence[ReflectiveShadowMap], count: int, *, parts: bool = False, glossy: bool = False
) -> Vpls:
    """Return virtual point lights; see `ssgi_cl.choose_vpls`."""
    rows = [_lit_texels(rsm, glossy=glossy) for rsm in rsms]
    position, normal, amounts, axis, gloss = (np.concatenate(values) for values in zip(*rows, strict=True))

    def lit_by(index: NDArray[np.intp], flux: Doubles, area: Doubles) -> Vpls:
        lobes = (axis[index], gloss[index]) if glossy else (None, None)
        return Vpls(position[index], normal[index], flux, area, None, *lobes)

    if len(amounts) <= count:
        return lit_by(np.arange(len(amounts)), amounts[:, :3], amounts[:, 3])
    importance = np.sqrt(np.clip(gloss, 1.0, SHARPEST) + 1.0) if glossy else np.ones(len(amounts))

    def cut(pieces: int) -> Vpls:
        return lit_by(*cut_evenly(amounts, pieces, importance))

    return replace(cut(count), parts=cut(PARTS * count) if parts else None)


def _lit_texels(rsm: ReflectiveShadowMap, *, glossy: bool) -> tuple[Doubles, Doubles, Doubles, Doubles, Doubles]:
    """Return position, normal, flux and area, axis and exponent of lit texels along the curve."""
    position, normal, area = texels(rsm)
    power, gloss = (rsm.specular_flux, rsm.gloss) if glossy else (rsm.flux, np.ones_like(area))
    flux = np.asarray(power, np.float64) * np.isfinite(rsm.depth)[..., None]
    size, faces = rsm.cameras[0].size, len(rsm.cameras)
    order = hilbert_order(*size)
    order = np.concatenate([order + face * len(order) for face in range(faces)])
    order = order[(flux > 0.0).any(axis=-1).ravel()[order]]
    amounts = np.concatenate([flux, area[..., None]], axis=-1)
    origin = rsm.cameras[0].position
    return (
        position.reshape(-1, 3)[order] + origin,
        normal.reshape(-1, 3)[order],
        amounts.reshape(-1, 4)[order],
        mirrored_axes(rsm).reshape(-1, 3)[order],
        np.asarray(gloss, np.float64).ravel()[order],
    )


def cut_evenly(amounts: Doubles, count: int, importance: Doubles) -> tuple[NDArray[np.intp], Doubles, Doubles]:
    """Cut a row of texels into pieces of equal luminous flux times importance.

    Piece by piece along the row; a texel at a border is divided in proportion.

    Args:
        amounts: [texels, 4] RGB flux and area, luminous flux > 0.
        count: of pieces.
        importance: [texels].

    Returns:
        Which texel is at the middle of each piece, and the pieces' flux [count, 3] and area.
    """
    weight = amounts[:, :3] @ LUMINANCE * importance
    end = np.cumsum(weight)
    start = np.concatenate([[0.0], end[:-1]])
    middle, sums = np.zeros(count, np.intp), np.zeros((count, 4))
    for piece in range(count):
        low, high = end[-1] * piece / count, end[-1] * (piece + 1) / count
        first, last = np.searchsorted(end, low, "right"), np.searchsorted(start, high, "left")
        own = slice(first, max(last, first + 1))
        inside = np.minimum(end[own], high) - np.maximum(start[own], low)
        sums[piece] = np.maximum(inside / weight[own], 0.0) @ amounts[own]
        middle[piece] = min(np.searchsorted(end, 0.5 * (low + high)), len(end) - 1)
    return middle, sums[:, :3], sums[:, 3]
