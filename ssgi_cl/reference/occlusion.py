"""What follows the occlusion of each pixel, in float64: blur, and full size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ssgi_cl.reference.bilateral import bilateral_reference
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.reference.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.techniques.occlusion import RESOLUTIONS


def finished(openness: Doubles, view: SurfaceView, full: SurfaceView, params: Any) -> Doubles:
    """Return A (or what goes with it) at full size from what a technique of occlusion found.

    Args:
        openness: [rows, columns] of `view`, or [rows, columns, channels].
        view: the G-buffer at the size of `params.resolution`.
        full: the same at full size.
        params: with the fields that `ssgi_cl.techniques.occlusion` reads.
    """
    step = RESOLUTIONS[params.resolution]
    blur = params.blur
    late = step > 1 and params.blur_resolution == "full" and blur.radius > 0 and blur.passes > 0
    if late and openness.ndim > 2:
        a = upsample_reference(openness, full, step=step, background=1.0)
        return bilateral_reference(a, full, blur)
    if late:
        a = upsample_blur_reference(openness, full, blur, step=step, background=1.0)
        return bilateral_reference(a, full, replace(blur, passes=blur.passes - 1))
    a = bilateral_reference(openness, view, blur)
    return upsample_reference(a, full, step=step, background=1.0) if step > 1 else a
