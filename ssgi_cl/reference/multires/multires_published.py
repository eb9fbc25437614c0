"""Multiresolution splatting as published, in float64; see `multires_published_reference`."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

Masks = list[NDArray[np.bool_]]


def multires_published_reference(
    gbuffer: GBuffer, vpls: Vpls, levels: int, depth_threshold: float, normal_threshold: float
) -> tuple[Doubles, Masks]:
    """Return irradiance by subsplats (Nichols and Wyman 2009), and which texels these are.

    Args:
        gbuffer: what the camera sees; the front layer without its margin counts.
        vpls: the lights.
        levels, depth_threshold, normal_threshold: see `MultiresPublishedParams`.

    Returns:
        [rows, columns, 3] in W/m^2, 0 where nothing is; of each level, from the finest on, where
        subsplats are.
    """
    view = SurfaceView.of(gbuffer)
    kept = subsplats(view, levels, depth_threshold, normal_threshold)
    points, normals = view.inner(view.positions()), view.inner(view.normal)
    light = np.zeros((*kept[-1].shape, 3))
    lit = np.zeros(kept[-1].shape, np.bool_)
    for level in range(levels - 1, -1, -1):
        own = np.zeros((*kept[level].shape, 3))
        for texel in np.argwhere(kept[level]):
            centre = (texel << level) + (1 << level) // 2
            middle = tuple(np.minimum(centre, np.array(view.size) - 1))
            own[tuple(texel)] = _irradiance(points[middle], normals[middle], vpls, view)
        if level == levels - 1:
            light, lit = own, kept[level]
        else:
            light, lit = upsampled(light, lit, own, kept[level])
    return light, kept


def subsplats(view: SurfaceView, levels: int, depth_threshold: float, normal_threshold: float) -> Masks:
    """Return which texels of each level are subsplats, from the finest level on."""
    depth, normal = view.inner(view.depth), view.inner(view.normal)[..., :2]
    there = np.isfinite(depth)
    around = _regions(depth)
    with np.errstate(invalid="ignore"):
        variation = np.where(there, (around.max(0) - around.min(0)) / view.camera.tolerance_depth(depth), 0.0)
    near = _regions(normal)
    low = np.where(there[..., None], near.min(0), 1.0)
    high = np.where(there[..., None], near.max(0), -1.0)
    enough: Masks = [there]
    for level in range(1, levels):
        variation, low, high = (_mip(values, largest) for values, largest in ((variation, 1), (low, 0), (high, 1)))
        extent = (high - low).max(-1)
        enough.append((extent >= -1.0) & (extent <= normal_threshold) & (variation <= depth_threshold * 3.0 / level))
    finer = [own & ~_doubled(coarser, own.shape) for own, coarser in pairwise(enough)]
    return [*finer, enough[-1]]


def _regions(values: Doubles) -> Doubles:
    """Return [9, rows, columns, ...] the 3 x 3 around each pixel; those outside are the nearest."""
    rows, columns = values.shape[:2]
    grown = np.pad(values, [(1, 1), (1, 1), *[(0, 0)] * (values.ndim - 2)], mode="edge")
    return np.stack([grown[y : y + rows, x : x + columns] for y in range(3) for x in range(3)])


def _mip(values: Doubles, largest: int) -> Doubles:
    """Return the largest or least of columns and rows 2 i to 2 i + 2 of a finer level."""
    choose = np.max if largest else np.min
    rows, columns = (-(-length // 2) for length in values.shape[:2])
    result = np.empty((rows, columns, *values.shape[2:]))
    for y in range(rows):
        for x in range(columns):
            result[y, x] = choose(values[2 * y : 2 * y + 3, 2 * x : 2 * x + 3], axis=(0, 1))
    return result


def _doubled(values: NDArray[np.bool_], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return what the parents of a finer level's texels are."""
    return values.repeat(2, axis=0).repeat(2, axis=1)[: shape[0], : shape[1]]


def _irradiance(point: Doubles, normal: Doubles, vpls: Vpls, view: SurfaceView) -> Doubles:
    """Return [3] the sum over lights of flux cos cos / (pi d^2 + area), in view space."""
    turn, shift = view.camera.view[:3, :3], view.camera.view[:3, 3]
    way = vpls.position @ turn.T + shift - point
    square = np.maximum(np.sum(way**2, axis=-1), 1e-300)
    falls = np.maximum(way @ normal, 0.0)
    leaves = np.maximum(-np.sum(way * (vpls.normal @ turn.T), axis=-1), 0.0)
    factor = falls * leaves / (square * (np.pi * square + vpls.area))
    result: Doubles = factor @ vpls.flux
    return result


def upsampled(
    coarse: Doubles, coarse_lit: NDArray[np.bool_], fine: Doubles, fine_lit: NDArray[np.bool_]
) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return light of a finer level from that of a coarser one and from its own subsplats."""
    rows, columns = fine_lit.shape
    y, x = np.indices(fine_lit.shape)
    taps = np.zeros((3, 3, rows, columns, 3))
    there = np.zeros((3, 3, rows, columns))
    for i, j in np.ndindex(3, 3):
        up = tuple(
            np.clip(at // 2 + step - 1, 0, size - 1)
            for at, step, size in ((y, i, coarse_lit.shape[0]), (x, j, coarse_lit.shape[1]))
        )
        own = np.clip(y + i - 1, 0, rows - 1), np.clip(x + j - 1, 0, columns - 1)
        there[i, j] = coarse_lit[up] | fine_lit[own]
        taps[i, j] = np.where(coarse_lit[up][..., None], coarse[up], fine[own])
    # The nearer neighbour of the parent has 3/4, the farther 1/4.
    tents = [
        np.where(at % 2, *(np.array(ends).reshape(3, 1, 1) for ends in ((0.25, 1.0, 0.75), (0.75, 1.0, 0.25))))
        for at in (y, x)
    ]
    weight = tents[0][:, None] * tents[1] * there
    for i, j in ((0, 0), (0, 2), (2, 0), (2, 2)):
        weight[i, j] *= np.maximum(there[i, 1], there[1, j])
    lit = there[1, 1] > 0.0
    total = np.where(lit, weight.sum(axis=(0, 1)), 1.0)
    light = np.einsum("ijyx,ijyxc->yxc", weight, taps) / total[..., None]
    return np.where(lit[..., None], light, 0.0), lit
