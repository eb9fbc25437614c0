"""Multiresolution splatting in float64: all lights at computed pixels, interpolation between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.reference.multires_grid import multires_grid_reference
from ssgi_cl.reference.vpl_splat import vpl_splat_reference
from ssgi_cl.techniques.multires_splat import MultiresSplatParams
from ssgi_cl.techniques.vpl_splat import VplSplatParams
from ssgi_cl.vpls import Vpls


def multires_splat_reference(
    gbuffer: GBuffer, vpls: Vpls, params: MultiresSplatParams, mean: float
) -> tuple[NDArray[np.float64], NDArray[np.int_]]:
    """Return irradiance, every light by itself, and which pixels were computed.

    Args:
        gbuffer: what the camera sees.
        vpls: the lights.
        params: of which `light_error` counts as 0.
        mean: irradiance that errors are shares of, W/m^2.

    Returns:
        E [rows, columns, 3] in W/m^2, and [rows, columns] the step of the level that computed a
        pixel, 0 where it was interpolated or nothing is.
    """
    every = VplSplatParams(
        cutoff=params.cutoff, unit_distance=params.unit_distance, near=params.near
    )
    truth = vpl_splat_reference(gbuffer, vpls, every)
    return multires_grid_reference(gbuffer, truth, params.error * mean, params)
