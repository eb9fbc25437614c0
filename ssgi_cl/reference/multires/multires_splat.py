"""Multiresolution splatting in float64: all lights at computed pixels, interpolation between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.reference.multires.multires_grid import multires_grid_reference
from ssgi_cl.reference.vpl.vpl_splat import vpl_splat_reference

if TYPE_CHECKING:
    from ssgi_cl.techniques.multires.multires_splat import MultiresSplatParams


@dataclass(frozen=True)
class EveryLight:
    """Fields of `VplSplatParams` for all lights at every pixel."""

    cutoff: float
    unit_distance: float
    near: str
    interleave: bool = False
    refine: float = 0.0


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
    every = EveryLight(params.cutoff, params.unit_distance, params.near)
    truth = vpl_splat_reference(gbuffer, vpls, every)
    return multires_grid_reference(gbuffer, truth, params.interpolation_error * mean, params)
