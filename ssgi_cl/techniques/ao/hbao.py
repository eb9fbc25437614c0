"""Horizon-based ambient occlusion: all directions weigh the same, nearby occluders the most."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import param, with_fields_described
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.ao.confidence import confident_plan, with_confidence
from ssgi_cl.techniques.ao.occlusion import AskedKeywords, made_for
from ssgi_cl.techniques.ao.slices import PRESET_LAYERS, TUNABLE, ScanParams, SliceKeywords, SliceTechnique, slice_reach
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.technique import Bench, Technique


@dataclass(frozen=True, kw_only=True)
class HbaoParams(ScanParams):
    """Parameters of HBAO (Bavoil and Sainz 2008); a slice is two opposite directions.

    As published the attenuation is 1. The default was chosen on generated scenes: the RMSE against
    rays, which know no attenuation, is 4 % less than with 1 on those for tuning, 3 % on those for
    validation.
    """

    attenuation: float = param(
        0.6,
        "how much less an occluder at the radius hides than one nearby: by the square of its "
        "distance; 0 for a sharp end",
        low=0.0,
        high=1.0,
        shape=bool,
    )
    angle_bias: float = param(
        0.0,
        "elevation above the tangent plane up to which nothing occludes",
        low=0.0,
        high=1.5,
        unit="radians",
        shape=bool,
    )


class HbaoKeywords(SliceKeywords, total=False):
    """The other parameters of `hbao`."""

    attenuation: float
    angle_bias: float


class Hbao(SliceTechnique[HbaoParams]):
    """HBAO, prepared for images of one size; see `OcclusionTechnique` for the arguments.

    Bavoil and Sainz 2008. Departs: see `hbao`.
    """

    name = "hbao"
    defaults = HbaoParams

    def _macros(self) -> Mapping[str, int]:
        return {"HBAO_ATTENUATION": int(self.params.attenuation > 0.0), "HBAO_BIAS": int(self.params.angle_bias > 0.0)}

    def _values(self, *, thick: int) -> Mapping[str, float]:
        params = self.params
        return {
            "attenuation": params.attenuation,
            "bias_cos": math.cos(params.angle_bias),
            "bias_sin": math.sin(params.angle_bias),
        }


class _HbaoCall(HbaoKeywords, AskedKeywords, total=False):
    """Keywords of `hbao`, but those that its types depend on."""


@overload
def hbao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    confidence: Literal[False] = False,
    **params: Unpack[_HbaoCall],
) -> NDArray[np.float32]: ...
@overload
def hbao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    confidence: Literal[True],
    **params: Unpack[_HbaoCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
@banded(confident_plan(Hbao, slice_reach))
@with_fields_described(HbaoParams)
@serialised
def hbao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = None,
    slices: int | None = None,
    taps: int | None = None,
    *,
    confidence: bool = False,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[HbaoKeywords],
) -> NDArray[np.float32] | tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Compute ambient occlusion from horizons, all directions of the hemisphere weighing the same.

    Bavoil and Sainz 2008, "Image-Space Horizon-Based Ambient Occlusion". Departs: elevations are
    measured from the tangent plane across the view ray, directions weigh by the azimuth that
    they stand for, and the sum is divided by what they could hide, so that a plane is unoccluded.

    Args:
        gbuffer: depth, and normals if there are any; taps reach into its margin, and into all its
            depth layers: a deeper one counts where those before it are out of the radius.
        radius: distance up to which surfaces occlude, scene units, > 0; by default 5 % of the
            picture's diagonal where surfaces are seen.
        slices: pairs of opposite directions, 1 to 32.
        taps: depths read in each direction, 1 to 64.
        confidence: whether `ao_confidence` of A is returned too, which takes three times as long as
            `bitmask_ao`.
        preset, error, budget_ms: at most one of them: where the fields that are not given come
            from. "low", "medium", "high" or "ultra"; the greatest RMSE against cast rays, > 0; the
            longest device time of a picture in ms, > 0. See `ssgi_cl.choose`. By default the
            defaults of `HbaoParams`.
        max_memory: most bytes of device memory; where the image needs more, it is computed in bands
            of rows; the result is bit-identical. By default all that the device has.
        runtime: the device; by default the fastest found.
        **params: the other fields of `HbaoParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there. With `confidence`,
        A and [rows, columns] float32 in [0, 1]: see `ao_confidence`.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    checks.switch("confidence", confidence)
    technique, device = made_for(
        Hbao,
        gbuffer,
        runtime,
        radius=radius,
        slices=slices,
        taps=taps,
        preset=preset,
        error=error,
        budget_ms=budget_ms,
        **params,
    )
    a = technique(device)
    return with_confidence(a, gbuffer, technique.params.radius, runtime) if confidence else a


DESCRIPTOR = Technique(
    name="hbao",
    kind="ao",
    paper="Bavoil and Sainz 2008",
    function=hbao,
    params=HbaoParams,
    technique=Hbao,
    reference="ssgi_cl.reference.ao.hbao",
    reads=("depth", "normal"),
    writes=("ao",),
    command=True,
    quantity="occlusion",
    variants={"taps": (4,), "attenuation": (0.6, 0.0, 1.0), "resolution": ("full", "half")},
    tunable=TUNABLE,
    layers=PRESET_LAYERS,
    bench=Bench(
        families=("hbao",),
        rows={"hbao": ("ambient occlusion from horizons, attenuated with distance", (("", "hbao.2x9"),))},
    ),
)
