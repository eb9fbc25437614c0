"""Ambient occlusion with a visibility bitmask: surfaces have a thickness, light passes behind."""

from __future__ import annotations

from typing import Literal, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import with_fields_described
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskKeywords, BitmaskParams
from ssgi_cl.techniques.ao.confidence import confident_plan, with_confidence
from ssgi_cl.techniques.ao.occlusion import AskedKeywords, made_for
from ssgi_cl.techniques.ao.slices import PRESET_LAYERS, TUNABLE, slice_reach
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.technique import Bench, Technique


class _BitmaskCall(BitmaskKeywords, AskedKeywords, total=False):
    """Keywords of `bitmask_ao`, but those that its types depend on."""


@overload
def bitmask_ao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    confidence: Literal[False] = False,
    **params: Unpack[_BitmaskCall],
) -> NDArray[np.float32]: ...
@overload
def bitmask_ao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    confidence: Literal[True],
    **params: Unpack[_BitmaskCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
@banded(confident_plan(BitmaskAo, slice_reach))
@with_fields_described(BitmaskParams)
@serialised
def bitmask_ao(
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
    **params: Unpack[BitmaskKeywords],
) -> NDArray[np.float32] | tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Compute ambient occlusion from the sectors of slices that surfaces of some thickness cover.

    Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask". Departs: sectors
    are equal parts of the cosine-weighted measure (`sectors="angle"`: equal angles, as published);
    neighbouring taps on one surface cover what lies between them; all depth layers are read.

    Args:
        gbuffer: depth, and normals if there are any; taps reach into its margin, and each covers
            sectors with every depth layer.
        radius: distance up to which surfaces occlude, scene units, > 0; by default 5 % of the
            picture's diagonal where surfaces are seen.
        slices: planes through the view ray, 1 to 32.
        taps: depths read on either side of a slice, 1 to 64; of several layers see `BitmaskParams`.
        confidence: whether `ao_confidence` of A is returned too, which takes three times as long as
            `bitmask_ao`.
        preset, error, budget_ms: at most one of them: where the fields that are not given come
            from. "low", "medium", "high" or "ultra"; the greatest RMSE against cast rays, > 0; the
            longest device time of a picture in ms, > 0. See `ssgi_cl.choose`. By default the
            defaults of `BitmaskParams`.
        max_memory: most bytes of device memory; where the image needs more, it is computed in bands
            of rows; the result is bit-identical. By default all that the device has.
        runtime: the device; by default the fastest found.
        **params: the other fields of `BitmaskParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there. With `confidence`,
        A and [rows, columns] float32 in [0, 1]: see `ao_confidence`.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    checks.switch("confidence", confidence)
    technique, device = made_for(
        BitmaskAo,
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
    name="bitmask_ao",
    kind="ao",
    paper="Therrien et al. 2023",
    function=bitmask_ao,
    params=BitmaskParams,
    technique=BitmaskAo,
    reference="ssgi_cl.reference.ao.bitmask_ao",
    reads=("depth", "normal", "thickness"),
    writes=("ao",),
    command=True,
    quantity="occlusion",
    bench=Bench(
        settings=("1x9", "2x9", "2x14", "4x20", "2x14-2", "2x14-4", "4x20-4"),
        families=("bitmask_ao",),
        rows={
            "bitmask_ao": (
                "ambient occlusion from 32 sectors a slice that surfaces cover",
                (("", "bitmask_ao.2x14"), ("2 layers", "bitmask_ao.2x14-2"), ("4 layers", "bitmask_ao.2x14-4")),
            )
        },
    ),
    variants={"taps": (6,), "resolution": ("full", "half")},
    tunable=TUNABLE,
    layers=PRESET_LAYERS,
)
