"""Choosing virtual point lights from reflective shadow maps in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_rsm import mirrored_axes, surfaces
from ssgi_cl.flux_curve import hilbert_order
from ssgi_cl.gbuffer import ReflectiveShadowMap
from ssgi_cl.vpls import PARTS, SHARPEST, Vpls, cut_evenly

Doubles = NDArray[np.float64]


def choose_vpls_reference(
    rsms: Sequence[ReflectiveShadowMap], count: int, *, parts: bool = False, glossy: bool = False
) -> Vpls:
    """Return virtual point lights; see `ssgi_cl.choose_vpls`."""
    rows = [_lit_texels(rsm, glossy=glossy) for rsm in rsms]
    position, normal, amounts, axis, gloss = (
        np.concatenate(values) for values in zip(*rows, strict=True)
    )

    def lit_by(index: NDArray[np.intp], flux: Doubles, area: Doubles) -> Vpls:
        lobes = (axis[index], gloss[index]) if glossy else (None, None)
        return Vpls(position[index], normal[index], flux, area, None, *lobes)

    if len(amounts) <= count:
        return lit_by(np.arange(len(amounts)), amounts[:, :3], amounts[:, 3])
    importance = np.sqrt(np.clip(gloss, 1.0, SHARPEST) + 1.0) if glossy else np.ones(len(amounts))

    def cut(pieces: int) -> Vpls:
        return lit_by(*cut_evenly(amounts.T, pieces, importance))

    return replace(cut(count), parts=cut(PARTS * count) if parts else None)


def _lit_texels(
    rsm: ReflectiveShadowMap, *, glossy: bool
) -> tuple[Doubles, Doubles, Doubles, Doubles, Doubles]:
    """Return position, normal, flux and area, axis and exponent of lit texels along the curve."""
    position, normal, area = surfaces(rsm)
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
