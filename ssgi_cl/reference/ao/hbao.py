"""HBAO in float64, direction by direction as defined in `ssgi_cl.techniques.ao.hbao`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.slices import Scan, finished
from ssgi_cl.reference.gbuffer import Doubles

if TYPE_CHECKING:
    from ssgi_cl.techniques.ao.hbao import HbaoParams


def hbao_reference(gbuffer: GBuffer, params: HbaoParams) -> NDArray[np.float64]:
    """Return A [rows, columns] from the same taps as the kernel, blurred and upsampled alike."""
    return finished(gbuffer, params, lambda scan: visibility(scan, params), uniform=True)


def visibility(scan: Scan, params: HbaoParams) -> Doubles:
    """Return A before blur: 1 - what the horizons hide, over what they could."""
    hidden, whole = np.zeros(scan.depth.shape), np.full(scan.depth.shape, 1e-30)
    for plane in scan.slices():
        for side in (1, -1):
            tangent = np.arctan(side * plane.lean)
            lowest = np.sin(np.minimum(tangent + params.angle_bias, 0.5 * np.pi))
            # A triangle's own plane, where it is not across the normal, ends what could be seen.
            horizon = np.where(scan.tilted, np.maximum(lowest, np.sin(np.arctan(side * plane.edge))), lowest)
            whole += plane.weight * (1.0 - horizon)
            for taps in scan.taps_of_all_layers(plane, side):
                for tap in taps:
                    elevation = np.sin(np.arctan(tap.cot))
                    raises = tap.counts & (elevation > horizon)
                    gain = (1.0 - params.attenuation * tap.distance**2) * (elevation - horizon)
                    hidden += plane.weight * np.where(raises, gain, 0.0)
                    horizon = np.where(raises, elevation, horizon)
    a: Doubles = 1.0 - hidden / whole
    return a
