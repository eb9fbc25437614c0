"""Edge-aware blur in float64, pixel by pixel as defined in `techniques.filters.bilateral`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

if TYPE_CHECKING:
    from ssgi_cl.techniques.filters.bilateral import BilateralParams

FIT_POWER = 4
"""Exponent n of a fit: (1 - d^2 / (2 n sigma^2))^n is the Gaussian of d as n grows."""

LEAST_N_DOT_V = 0.0017
"""About the cosine between a normal and the view ray below which a surface counts as no more
tilted: exactly so in the middle of the view."""


@dataclass(frozen=True, kw_only=True)
class Blur:
    """The fields of `BilateralParams` of the same names, with the same defaults."""

    radius: int = 4
    sigma: float = 0.0
    depth_sigma: float = 0.01
    normal_sigma: float = 0.5
    passes: int = 1
    separable: bool = True
    checkerboard: bool = False
    """Whether values are on the pixels of even row + column alone; the first pass fills the others."""


def bilateral_reference(
    image: ArrayLike, gbuffer: GBuffer | SurfaceView, params: BilateralParams | Blur | None = None
) -> NDArray[np.float64]:
    """Return the blurred image, [rows, columns] or [rows, columns, channels] as given."""
    params = params or Blur()
    view = gbuffer if isinstance(gbuffer, SurfaceView) else SurfaceView.of(gbuffer)
    value = np.asarray(image, np.float64)
    flat = value.ndim == 2
    value = value[..., None] if flat else value
    if params.radius > 0:
        reach = range(-params.radius, params.radius + 1)
        rows = [(0, d) for d in reach]
        columns = [(d, 0) for d in reach]
        square = [(dy, dx) for dy in reach for dx in reach]
        known = None
        if getattr(params, "checkerboard", False):
            y, x = np.indices(view.size)
            known = (y + x) % 2 == 0
            background = np.array([1.0, *(0.0,) * (value.shape[-1] - 1)])
            value = np.where(known[..., None], value, background)
        for _ in range(params.passes):
            instead = None if known is None else _beside(value, known)
            for offsets in (rows, columns) if params.separable else (square,):
                value, fitted = _blurred(value, view, params, offsets, known)
                known = None if known is None else fitted
            if instead is not None and known is not None:
                there = np.isfinite(view.inner(view.depth))
                value = np.where((there & ~known)[..., None], instead, value)
            known = None
    return value[..., 0] if flat else value


def off_plane(
    view: SurfaceView, row: Doubles, column: Doubles, other: Doubles, pixel: tuple[Doubles, Doubles, Doubles, Doubles]
) -> Doubles:
    """Return the distances of surfaces from the tangent planes of pixels, relative to the depth.

    With an orthographic camera they are relative to the height of its view.

    Args:
        view: whose view rays count.
        row, column: of the other surface's pixel centre.
        other: its depth.
        pixel: row, column, depth and normal of the pixels whose tangent planes count.
    """
    own_row, own_column, depth, normal = pixel
    sx, sy = view.slopes(row, column)
    own_sx, own_sy = view.slopes(own_row, own_column)
    p = 0.0 if view.camera.is_orthographic else 1.0
    n_dot_v = -(normal[..., 0] * own_sx * p + normal[..., 1] * own_sy * p - normal[..., 2])
    n_dot_v = np.maximum(n_dot_v, LEAST_N_DOT_V * (1.0 + 0.5 * p * (own_sx**2 + own_sy**2)))
    # Where n . (x, y, z) is that of the pixel: depth changes by n . dx / n . forward; 1 / depth by
    # its share of the pixel's own.
    step = normal[..., 0] * (sx - own_sx) + normal[..., 1] * (sy - own_sy)
    own = view.flatness(depth)
    plane = own + step / n_dot_v if view.camera.is_orthographic else own - own * step / n_dot_v
    return np.asarray(np.abs(view.flatness(other) - plane) / view.camera.tolerance_depth(np.abs(own)))


def fit_of(off: Doubles, cosine: Doubles, params: BilateralParams | Blur) -> Doubles:
    """Return the fit of pixels to a surface, 1 at best; the weight is a power of its positive part.

    Args:
        off: their distance from its tangent plane, relative to the depth.
        cosine: of the angle between the normals.
        params: for its two sigmas.
    """
    fit: Doubles = (
        1.0
        - 0.5 * (off / params.depth_sigma) ** 2 / FIT_POWER
        - (1.0 - cosine) / params.normal_sigma**2 / FIT_POWER  # angle^2 / 2, for small angles
    )
    return fit


def near(dy: int, dx: int, params: BilateralParams | Blur) -> float:
    """Return the weight in space of a pixel so many rows and columns away."""
    if np.isinf(params.sigma):
        halves: float = 0.5 ** ((abs(dy) == params.radius) + (abs(dx) == params.radius))
        return halves
    sigma = params.sigma or 0.5 * (params.radius + 1)
    return float(np.exp(-0.5 * (dx * dx + dy * dy) / sigma**2))


def _beside(value: Doubles, known: NDArray[np.bool_]) -> Doubles:
    """Return the mean of the known pixels beside each in its row; without one 1, and 0 of further channels."""
    padded = np.pad(value * known[..., None], ((0, 0), (1, 1), (0, 0)))
    count = np.pad(known, ((0, 0), (1, 1)))
    number = count[:, :-2].astype(int) + count[:, 2:]
    mean: Doubles = (padded[:, :-2] + padded[:, 2:]) / np.maximum(number, 1)[..., None]
    return np.where(number[..., None] > 0, mean, np.array([1.0, *(0.0,) * (value.shape[-1] - 1)]))


def _blurred(
    value: Doubles,
    view: SurfaceView,
    params: BilateralParams | Blur,
    offsets: list[tuple[int, int]],
    known: NDArray[np.bool_] | None = None,
) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return the image blurred over offsets, and where anything fits; pixels that are not `known` do not count."""
    rows, columns = view.size
    depth, normal = view.inner(view.depth), view.inner(view.normal)
    y, x = np.indices((rows, columns))
    row, column = (view.inner(centre) for centre in view.centres())
    there = np.isfinite(depth)
    safe = np.where(there, depth, 1.0)
    total = np.zeros((rows, columns))
    result = np.zeros_like(value)
    for dy, dx in offsets:
        ty, tx = y + dy, x + dx
        inside = (ty >= 0) & (ty < rows) & (tx >= 0) & (tx < columns)
        ty, tx = np.clip(ty, 0, rows - 1), np.clip(tx, 0, columns - 1)
        other_there = np.isfinite(depth[ty, tx])
        off = off_plane(
            view, row + dy, column + dx, np.where(other_there, depth[ty, tx], 1.0), (row, column, safe, normal)
        )
        cosine = np.sum(normal * normal[ty, tx], axis=-1)
        counts = inside & other_there if known is None else inside & other_there & known[ty, tx]
        fit = np.where(counts, fit_of(off, cosine, params), 0.0)
        weight = near(dy, dx, params) * np.maximum(fit, 0.0) ** FIT_POWER
        if (dy, dx) == (0, 0):
            weight = np.ones_like(weight) if known is None else known.astype(np.float64)
        total += weight
        result += weight[..., None] * value[ty, tx]
    fitted = total > 0.0
    mean = result / np.where(fitted, total, 1.0)[..., None]
    return np.where((there & fitted)[..., None], mean, value), fitted | ~there
