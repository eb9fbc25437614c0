"""Joint-bilateral upsampling in float64, as defined in `ssgi_cl.techniques.upsample`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.bilateral import off_plane
from ssgi_cl.reference.gbuffer import SurfaceView

FARTHEST, MOST_TURNED = 25.0, 15.0
"""Halvings of the weight that a distance and an angle cause at most, so that none becomes 0."""


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
    coarse = view.reduced(step)
    value = np.asarray(image, np.float64)
    flat = value.ndim == 2
    value = value[..., None] if flat else value
    rows, columns = view.size
    y, x = np.indices((rows, columns))
    depth, normal = view.inner(view.depth), view.inner(view.normal)
    coarse_depth, coarse_normal = coarse.inner(coarse.depth), coarse.inner(coarse.normal)
    there = np.isfinite(depth)
    row, column = (view.inner(centre) for centre in view.centres())
    pixel = (row, column, np.where(there, depth, 1.0), normal)
    total = np.zeros((rows, columns))
    result = np.zeros((rows, columns, value.shape[-1]))
    for down in (0, 1):
        for right in (0, 1):
            cy = np.minimum(y // step + down, coarse.size[0] - 1)
            cx = np.minimum(x // step + right, coarse.size[1] - 1)
            dy, dx = cy * step - y, cx * step - x
            near = [np.maximum(1.0 - np.abs(d) / step, 0.0) + 1e-3 for d in (dy, dx)]
            tap = coarse_depth[cy, cx]
            tap_there = np.isfinite(tap)
            off = off_plane(view, row + dy, column + dx, np.where(tap_there, tap, 1.0), pixel)
            apart = 0.5 * (off / depth_sigma) ** 2 / math.log(2.0)
            apart = np.where(tap_there, np.minimum(apart, FARTHEST), FARTHEST)
            cosine = np.sum(normal * coarse_normal[cy, cx], axis=-1)
            turned = (1.0 - cosine) / normal_sigma**2 / math.log(2.0)
            weight = near[0] * near[1] * 0.5 ** (apart + np.minimum(turned, MOST_TURNED))
            total += weight
            result += weight[..., None] * value[cy, cx]
    result = np.where(there[..., None], result / total[..., None], background)
    return result[..., 0] if flat else result
