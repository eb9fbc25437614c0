"""Ground-truth ambient occlusion: cosine-weighted, from the highest horizons of slices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.params import param
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques.slices import SliceParams, SliceTechnique, prepared


@dataclass(frozen=True, kw_only=True)
class GtaoParams(SliceParams):
    """Parameters of GTAO (Jimenez et al. 2016; XeGTAO, Intel 2021).

    XeGTAO's High setting for a radius r is radius=1.457 * r, slices=3, taps=3 (it counts the taps
    of both sides), tap_power=2, falloff=0.615, contrast=2.2.
    """

    falloff: float = param(
        0.0, "part of the radius, at its end, over which a horizon moves down to the tangent "
        "plane; 0 for a sharp end", low=0.0, high=1.0, unit="radii",
    )
    thin_occluder: float = param(
        0.0, "with a falloff: how much more depth counts in the distance, for thin things",
        low=0.0, high=10.0,
    )


class Gtao(SliceTechnique[GtaoParams]):
    """GTAO, prepared for images of one size; see `SliceTechnique` for the arguments."""

    name = "gtao"
    defaults = GtaoParams

    def _macros(self) -> Mapping[str, int]:
        return {"GTAO_FALLOFF": int(self.params.falloff > 0.0)}

    def _values(self) -> Mapping[str, float]:
        params = self.params
        return {
            "falloff_scale": 1.0 / params.falloff if params.falloff > 0.0 else 0.0,
            "thin": (1.0 + params.thin_occluder) ** 2 - 1.0,
        }


def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float = 0.5,
    slices: int = 2,
    taps: int = 9,
    *,
    runtime: Runtime | None = None,
    **params: Any,
) -> NDArray[np.float32]:
    """Compute cosine-weighted ambient occlusion from the highest horizons round each pixel.

    Args:
        gbuffer: depth, and normals if there are any; taps reach into its margin, and into all its
            depth layers: a deeper one counts where those before it are out of the radius.
        radius: distance up to which surfaces occlude, scene units, > 0.
        slices: planes through the line of sight, 1 to 32.
        taps: depths read on either side of a slice, 1 to 64.
        runtime: the device; by default the fastest found.
        **params: the other fields of `GtaoParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    chosen = GtaoParams(radius=radius, slices=slices, taps=taps, **params)
    return prepared(Gtao, gbuffer, runtime, chosen)
