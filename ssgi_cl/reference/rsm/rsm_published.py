"""Gathering from reflective shadow maps as published, in float64; see `rsm_published_reference`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.rsm.rsm import texels
from ssgi_cl.reference.rsm.rsm_gather import receivers, samples_round


@dataclass(frozen=True, kw_only=True)
class Settings:
    """See `RsmPublishedParams`."""

    samples: int
    radius: float
    offset: float
    spacing: int
    position_tolerance: float
    normal_tolerance: float


def rsm_published_reference(
    gbuffer: GBuffer, rsms: Sequence[ReflectiveShadowMap], settings: Settings
) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return irradiance [rows, columns, 3] in W/m^2, and [rows, columns] where it was gathered.

    Dachsbacher and Stamminger 2005, "Reflective Shadow Maps".
    """
    view = SurfaceView.of(gbuffer)
    rows, columns = view.size
    step = settings.spacing
    there = np.isfinite(view.inner(view.depth))
    points, normals = view.inner(view.positions()), view.inner(view.normal)
    light = sum((_gathered(view, rsm, settings) for rsm in rsms), np.zeros((rows, columns, 3)))
    full = np.where(there[..., None], light, 0.0)
    low_rows, low_columns = (np.minimum(np.arange(0, length, step) + step // 2, length - 1) for length in view.size)
    gathered = np.zeros((rows, columns), np.bool_)
    gathered[np.ix_(low_rows, low_columns)] = there[np.ix_(low_rows, low_columns)]
    if step == 1:
        return full, gathered
    result = full.copy()
    # Scene units that a pixel covers at depth 1, the larger side.
    pixel = max(abs(value) for value in view.camera.pixel_to_view[:2])
    for y, x in np.argwhere(there):
        across, down = (x - step // 2) / step, (y - step // 2) / step
        left, top = math.floor(across), math.floor(down)
        weights, values = [], []
        for i in (0, 1):
            for j in (0, 1):
                at = (
                    low_rows[min(max(top + i, 0), len(low_rows) - 1)],
                    low_columns[min(max(left + j, 0), len(low_columns) - 1)],
                )
                k = 1.0 if view.camera.is_orthographic else -points[y, x, 2]
                far = settings.position_tolerance * step * pixel * k
                near = np.linalg.norm(points[at] - points[y, x]) <= far
                if there[at] and near and normals[at] @ normals[y, x] >= math.cos(settings.normal_tolerance):
                    weights.append((1.0 - abs(across - left - j)) * (1.0 - abs(down - top - i)))
                    values.append(full[at])
        if len(weights) >= 3 and sum(weights) > 0.0:
            result[y, x] = np.array(weights) @ np.array(values) / sum(weights)
        else:
            gathered[y, x] = True
    return result, gathered


def _gathered(view: SurfaceView, rsm: ReflectiveShadowMap, settings: Settings) -> Doubles:
    """Return the irradiance of all pixels by samples of one map, [rows, columns, 3]."""
    position, towards, area = (values.reshape(-1, *values.shape[2:]) for values in texels(rsm))
    flux = np.asarray(rsm.flux, np.float64).reshape(-1, 3) * np.isfinite(np.asarray(rsm.depth)).reshape(-1, 1)
    light = np.zeros((*view.size, 3))
    for row, x, normal in zip(light, *receivers(view, rsm), strict=True):
        index, weight = samples_round(x, rsm, settings.samples, settings.radius, "paper", np.zeros(len(x)))
        n = towards[index]
        way = position[index] - settings.offset * np.sqrt(area[index])[..., None] * n - x[:, None]
        square = np.maximum(np.sum(way**2, axis=-1), 1e-18)
        falls = np.maximum(np.sum(way * normal[:, None], axis=-1), 0.0)
        leaves = np.maximum(-np.sum(way * n, axis=-1), 0.0)
        row += np.sum((weight * falls * leaves / (math.pi * square**2))[..., None] * flux[index], axis=1)
    return light
