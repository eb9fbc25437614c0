"""Blur and upsampling of ambient occlusion, in float64."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from ssgi_cl.reference.filters.bilateral import Blur, bilateral_reference
from ssgi_cl.reference.filters.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView

RESOLUTIONS = {"full": 1, "half": 2, "quarter": 4}
"""Name -> pixels of the image from one that is computed to the next."""
DEPTH_SIGMA = 0.002
"""Of the blur, per pixel of its image; the angle's is that of `Blur`."""
JOINED_SIGMA = 0.4
"""Standard deviation in pixels of the blur of more than two joined slices, over its radius + 1."""

TILE_SIGMA = 2.0 / 1.3862943611198906**0.5
"""Standard deviation of the blur of radius 3 of scans, px: exp(-4 / (2 sigma^2)) = 1/2."""


def blur_of(params: Any) -> Blur:
    """Return the blur that parameters of ambient occlusion ask for."""
    step = RESOLUTIONS[params.resolution] if params.blur_resolution == "own" else 1
    sigma = 0.0
    if getattr(params, "joined", False) and params.slices > 2:
        sigma = JOINED_SIGMA * (params.blur_radius + 1)
    elif step == RESOLUTIONS[params.resolution]:
        # Half of what a pattern repeats after: 4 px of scans, 8 px of the points of SSAO.
        scans = hasattr(params, "slices")
        if params.blur_radius == (2 if scans else 4):
            sigma = math.inf
        elif scans and params.blur_radius == 3:
            sigma = TILE_SIGMA
    return Blur(
        radius=params.blur_radius,
        passes=params.blur_passes,
        depth_sigma=DEPTH_SIGMA * step,
        sigma=sigma,
        checkerboard=getattr(params, "checkerboard", False),
    )


def finished(visibility: Doubles, view: SurfaceView, full: SurfaceView, params: Any) -> Doubles:
    """Return A, or another result of a technique, at full size.

    Args:
        visibility: the result before blur, [rows, columns] of `view`, or [rows, columns, channels].
        view: the G-buffer at the size of `params.resolution`.
        full: the same at full size.
        params: those of `OcclusionParams`.
    """
    step = RESOLUTIONS[params.resolution]
    blur = blur_of(params)
    late = step > 1 and params.blur_resolution == "full" and blur.radius > 0 and blur.passes > 0
    if late and visibility.ndim > 2:
        a = upsample_reference(visibility, full, step=step, background=1.0)
        return bilateral_reference(a, full, blur)
    if late:
        a = upsample_blur_reference(visibility, full, blur, step=step, background=1.0)
        return bilateral_reference(a, full, replace(blur, passes=blur.passes - 1))
    a = bilateral_reference(visibility, view, blur)
    return upsample_reference(a, full, step=step, background=1.0) if step > 1 else a
