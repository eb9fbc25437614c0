"""Gathering from reflective shadow maps as published, in float64; see `rsm_published_reference`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.rsm.rsm import texels

TURN = math.pi * (math.sqrt(5.0) - 1.0)
"""Radians from one sample of the disk to the next."""


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
    full = np.zeros((rows, columns, 3))
    of_texels = [texels(rsm) for rsm in rsms]
    for y, x in np.argwhere(there):
        full[y, x] = sum(
            _gathered(points[y, x], normals[y, x], view, rsm, made, settings)
            for rsm, made in zip(rsms, of_texels, strict=True)
        )
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


def _gathered(
    point: Doubles,
    normal: Doubles,
    view: SurfaceView,
    rsm: ReflectiveShadowMap,
    made: tuple[Doubles, Doubles, Doubles],
    settings: Settings,
) -> Doubles:
    """Return [3] the irradiance at a point of the camera's view space, by samples of one map, of
    whose texels `made` is what `texels` says."""
    position, towards, area = made
    turn = view.camera.view[:3, :3]
    x = point @ turn + (view.camera.position - rsm.cameras[0].position)
    row, column, weight = _in_disk(x, rsm, settings)
    flux = np.asarray(rsm.flux, np.float64)[row, column] * np.isfinite(np.asarray(rsm.depth)[row, column])[:, None]
    n = towards[row, column]
    way = position[row, column] - settings.offset * np.sqrt(area[row, column])[:, None] * n - x
    square = np.maximum(np.sum(way**2, axis=1), 1e-18)
    falls = np.maximum(way @ (normal @ turn), 0.0)
    leaves = np.maximum(-np.sum(way * n, axis=1), 0.0)
    result: Doubles = (weight * falls * leaves / (math.pi * square**2)) @ flux
    return result


def _in_disk(
    x: Doubles, rsm: ReflectiveShadowMap, settings: Settings
) -> tuple[NDArray[np.intp], NDArray[np.intp], Doubles]:
    """Return rows and columns of the samples round a point, and how many texels each stands for."""
    first = np.arange(settings.samples)
    xi1 = np.asarray((first + 0.5) / settings.samples, np.float64)
    angle = np.asarray(first * TURN, np.float64)
    share: Doubles = xi1**2 / np.sum(xi1**2)
    if len(rsm.cameras) == 6:
        return _in_cap(x, rsm, settings, xi1, angle, share)
    camera = rsm.cameras[0]
    size = np.array([camera.width, camera.height], np.float64)
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    local = camera.view[:3, :3] @ x
    k = 1.0 if camera.is_orthographic else -local[2]
    # Of the middle of the map: what lies outside, or behind the light, is moved to the border.
    half = np.array([to_x, to_y]) * size / 2.0
    off = (local[:2] - k * (np.array([at_x, at_y]) + half)) / half
    at = (off / max(np.abs(off).max(), k, 1e-30) + 1.0) * size / 2.0
    radius = settings.radius * size.max()
    places = at + radius * xi1[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inside = np.all((places >= 0.0) & (places < size), axis=1)
    column, row = np.clip(places, 0, size - 1).astype(np.intp).T
    return row, column, np.where(inside, math.pi * radius**2 * share, 0.0)


def _in_cap(
    x: Doubles, rsm: ReflectiveShadowMap, settings: Settings, xi1: Doubles, angle: Doubles, share: Doubles
) -> tuple[NDArray[np.intp], NDArray[np.intp], Doubles]:
    """Return what `_in_disk` does for a point light: directions round that of the point."""
    reach = min(0.5 * math.pi * settings.radius, math.pi)
    w = x / np.linalg.norm(x)
    # Any frame round w gives other samples; this is the one of Frisvad 2012.
    a = 1.0 / max(1.0 + w[2], 1e-6)
    t = np.array([1.0 - w[0] ** 2 * a, -w[0] * w[1] * a, -w[0]])
    s = np.array([-w[0] * w[1] * a, 1.0 - w[1] ** 2 * a, -w[1]])
    polar = reach * xi1
    way = (
        np.outer(np.sin(polar) * np.cos(angle), t)
        + np.outer(np.sin(polar) * np.sin(angle), s)
        + np.outer(np.cos(polar), w)
    )
    rows, columns, count = (np.empty(len(xi1)) for _ in range(3))
    height = np.asarray(rsm.depth).shape[0] // 6
    for i, direction in enumerate(way):
        face = 2 * int(np.abs(direction).argmax())
        face += int(direction[face // 2] < 0.0)
        camera = rsm.cameras[face]
        to_x, to_y, at_x, at_y = camera.pixel_to_view
        local = camera.view[:3, :3] @ direction
        slope = local[:2] / -local[2]
        columns[i] = np.clip((slope[0] - at_x) / to_x, 0, camera.width - 1)
        rows[i] = face * height + int(np.clip((slope[1] - at_y) / to_y, 0, height - 1))
        count[i] = (1.0 + slope @ slope) ** 1.5 / abs(to_x * to_y)
    cap = 2.0 * math.pi * (1.0 - math.cos(reach))
    return rows.astype(np.intp), columns.astype(np.intp), cap * share * count
