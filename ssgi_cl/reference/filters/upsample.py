"""Joint-bilateral upsampling in float64, as defined in `ssgi_cl.techniques.filters.upsample`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.filters.bilateral import FIT_POWER, Blur, fit_of, off_plane
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

if TYPE_CHECKING:
    from ssgi_cl.techniques.filters.bilateral import BilateralParams

LEAST_WEIGHT = 1e-6
"""Of all samples together, below which none of them fits."""

Bools = NDArray[np.bool_]
Integers = NDArray[np.int_]


def upsample_reference(
    image: ArrayLike,
    gbuffer: GBuffer | SurfaceView,
    *,
    step: int = 2,
    background: float = 0.0,
    depth_sigma: float = 0.005,
    normal_sigma: float = 0.3,
) -> NDArray[np.float64]:
    """Return an image of 1 / step of the size at full size, [rows, columns(, channels)]."""
    view = gbuffer if isinstance(gbuffer, SurfaceView) else SurfaceView.of(gbuffer)
    params = Blur(depth_sigma=depth_sigma, normal_sigma=normal_sigma)
    value = np.asarray(image, np.float64)
    flat = value.ndim == 2
    value = value[..., None] if flat else value
    total = np.zeros(view.size)
    result = np.zeros((*view.size, value.shape[-1]))
    for weight, _, sample in _corners(value, view, params, step):
        total += weight
        result += weight[..., None] * sample
    lost = total < LEAST_WEIGHT
    result = np.where(lost[..., None], _best(value, view, params, step), result / np.where(lost, 1.0, total)[..., None])
    result = np.where(np.isfinite(view.inner(view.depth))[..., None], result, background)
    return result[..., 0] if flat else result


def _corners(
    value: Doubles, view: SurfaceView, params: BilateralParams | Blur, step: int
) -> Iterator[tuple[Doubles, Doubles, Doubles]]:
    """Yield weight, fit and value of each of the four coarse pixels round every pixel."""
    y, x = np.indices(view.size)
    for down in (0, 1):
        for right in (0, 1):
            row, column = (y // step + down) * step, (x // step + right) * step
            fit, ty, tx = _fit(view, (y, x), (row, column), params)
            near = (step - np.abs(row - y)) * (step - np.abs(column - x))
            weight = near * np.maximum(fit, 0.0) ** FIT_POWER
            yield weight, fit, value[ty // step, tx // step]


def _best(value: Doubles, view: SurfaceView, params: BilateralParams | Blur, step: int) -> Doubles:
    """Return the value of the best of the four coarse pixels, the first one where none is there."""
    _, most, best = next(corners := _corners(value, view, params, step))
    for _, fit, sample in corners:
        best = np.where((fit > most)[..., None], sample, best)
        most = np.maximum(fit, most)
    return best


def upsample_blur_reference(
    image: ArrayLike,
    gbuffer: GBuffer | SurfaceView,
    params: BilateralParams | Blur,
    *,
    step: int = 2,
    background: float = 0.0,
) -> NDArray[np.float64]:
    """Return an image [rows, columns] of 1 / step of the size, blurred, at full size."""
    view = gbuffer if isinstance(gbuffer, SurfaceView) else SurfaceView.of(gbuffer)
    params = replace(params, radius=max(params.radius, step - 1))
    y, x = np.indices(view.size)
    wide, fitted = _pass(
        np.asarray(image, np.float64), np.ones(np.shape(image), bool), view, params, step, y[::step], x[::step], along=1
    )
    fine, fitted = _pass(wide, fitted, view, params, step, y, x, along=0)
    coarse = np.asarray(image, np.float64)[..., None]
    fine = np.where(fitted, fine, _best(coarse, view, params, step)[..., 0])
    return np.where(np.isfinite(view.inner(view.depth)), fine, background)


def _pass(
    value: Doubles,
    known: Bools,
    view: SurfaceView,
    params: BilateralParams | Blur,
    step: int,
    y: Integers,
    x: Integers,
    *,
    along: int,
) -> tuple[Doubles, Bools]:
    """Return the mean of the `known` samples along rows (1) or columns (0), and where any fits.

    `y` and `x` are the pixels to find it for; samples lie `step` pixels apart along the pass, and
    `value` has them at the places of its other axis that y or x have.
    """
    sigma = params.sigma or 0.5 * (params.radius + 1)
    total, result = np.zeros(y.shape), np.zeros(y.shape)
    first, last = -(params.radius // step), (params.radius + step - 1) // step
    for d in range(first, last + 1):
        at = ((x if along else y) // step + d) * step
        fit, ty, tx = _fit(view, (y, x), (y, at) if along else (at, x), params)
        index = (ty // step, tx // step) if along else (ty // step, tx)
        apart = at - (x if along else y)
        reach = np.abs(apart) <= params.radius
        weight = np.exp(-0.5 * (apart / sigma) ** 2) * np.maximum(fit, 0.0) ** FIT_POWER
        weight = np.where(reach & known[index], weight, 0.0)
        total += weight
        result += weight * value[index]
    fitted = total >= LEAST_WEIGHT
    return result / np.where(fitted, total, 1.0), fitted


def _fit(
    view: SurfaceView, at: tuple[Integers, Integers], other: tuple[Integers, Integers], params: BilateralParams | Blur
) -> tuple[Doubles, Integers, Integers]:
    """Return the fit of the pixels (rows, columns) `other` to the surfaces of those `at`.

    It is -inf where they lie outside the image or are empty. Also returns `other`, clamped to the
    image.
    """
    depth, normal = view.inner(view.depth), view.inner(view.normal)
    row, column = (view.inner(centre) for centre in view.centres())
    pixel = (row[at], column[at], np.where(np.isfinite(depth[at]), depth[at], 1.0), normal[at])
    y, x = (np.clip(other[i], 0, view.size[i] - 1) for i in (0, 1))
    there = (y == other[0]) & (x == other[1]) & np.isfinite(depth[y, x])
    below, right = (other[i].astype(np.float64) + (view.margin[i] + 0.5) for i in (0, 1))
    off = off_plane(view, below, right, np.where(there, depth[y, x], 1.0), pixel)
    cosine = np.sum(normal[at] * normal[y, x], axis=-1)
    return np.where(there, fit_of(off, cosine, params), -np.inf), y, x
