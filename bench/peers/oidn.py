"""Intel's Open Image Denoise, guided by the G-buffer's normals.

Chosen among its modes by the RMSE of 1, 4 and 16 rays a pixel on both built-in scenes: HDR for A
too (for low dynamic range it takes the zeros and ones of a few rays for something else, and turns
out up to .2 too bright), and guides that are not declared noise-free. Neither A nor irradiance
depends on the albedo, so its guide is white; OIDN wants one with the normals.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.tuning.context import Context

from .extras import missing_package

Floats = NDArray[np.float32]

QUALITY = "fast"
"""The quickest: twice as fast as "high", for an RMSE that is at most 1.12 times as large."""


def missing() -> str:
    """Return what to install where the denoiser is missing."""
    return missing_package("pyoidn", "peers")


def denoised(context: Context, noisy: Callable[[], Floats]) -> Callable[[], Floats]:
    """Return what computes an image and denoises it.

    Args:
        context: whose G-buffer guides the denoiser.
        noisy: returns A [rows, columns] in [0, 1], or irradiance [rows, columns, 3].
    """
    pyoidn = import_module("pyoidn")
    normal = context.host_gbuffer.first("normal")
    white = np.ones_like(normal)

    def run() -> Floats:
        image = noisy()
        color = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=-1)
        result: Floats = pyoidn.denoise(color, white, normal, hdr=True, quality=QUALITY)
        return result if image.ndim == 3 else np.clip(result[..., 0], 0.0, 1.0)

    return run
