"""Choosing virtual point lights from reflective shadow maps in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_rsm import surfaces
from ssgi_cl.flux_curve import hilbert_order
from ssgi_cl.gbuffer import ReflectiveShadowMap
from ssgi_cl.vpls import PARTS, Vpls, cut_evenly

Doubles = NDArray[np.float64]


def choose_vpls_reference(
    rsms: Sequence[ReflectiveShadowMap], count: int, *, parts: bool = False
) -> Vpls:
    """Return virtual point lights; see `ssgi_cl.choose_vpls`."""
    rows = [_lit_texels(rsm) for rsm in rsms]
    position, normal, amounts = (np.concatenate(values) for values in zip(*rows, strict=True))
    if len(amounts) <= count:
        return Vpls(position, normal, amounts[:, :3], amounts[:, 3])

    def cut(pieces: int) -> Vpls:
        middle, flux, area = cut_evenly(amounts.T, pieces)
        return Vpls(position[middle], normal[middle], flux, area)

    return replace(cut(count), parts=cut(PARTS * count) if parts else None)


def _lit_texels(rsm: ReflectiveShadowMap) -> tuple[Doubles, Doubles, Doubles]:
    """Return position and normal [texels, 3], flux and area [texels, 4] along the curve."""
    position, normal, area = surfaces(rsm)
    flux = np.asarray(rsm.flux, np.float64) * np.isfinite(rsm.depth)[..., None]
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
    )
