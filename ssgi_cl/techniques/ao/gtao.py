"""Ground-truth ambient occlusion: cosine-weighted, from the highest horizons of slices.

Bent normals, the mean unoccluded directions, come from the same horizons.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import param, with_fields_described
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.ao.bent_normals import BentNormals
from ssgi_cl.techniques.ao.confidence import confident_plan, with_confidence
from ssgi_cl.techniques.ao.occlusion import AskedKeywords, made_for
from ssgi_cl.techniques.ao.slices import (
    PRESET_LAYERS,
    TILE,
    TUNABLE,
    ScanParams,
    SliceKeywords,
    SliceTechnique,
    slice_reach,
)
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.technique import Bench, Technique


@dataclass(frozen=True, kw_only=True)
class GtaoParams(ScanParams):
    """Parameters of GTAO (Jimenez et al. 2016; XeGTAO, Intel 2021).

    XeGTAO's High setting for a radius r is radius=1.457 * r, slices=3, taps=3 (it counts the taps
    of both sides), tap_power=2, falloff=0.615, contrast=2.2.
    """

    blur_radius: int = param(
        TILE - 1,
        "edge-aware blur against the noise of the 4 x 4 tile; 2 and 3 cancel what repeats with it; 0 for none",
        low=0,
        high=16,
        unit="px",
    )
    falloff: float = param(
        0.0,
        "part of the radius, at its end, over which a horizon moves down to the tangent plane; 0 for a sharp end",
        low=0.0,
        high=1.0,
        unit="radii",
        shape=bool,
    )
    thin_occluder: float = param(
        0.0, "with a falloff: how much more depth counts in the distance, for thin things", low=0.0, high=10.0
    )
    horizon_decay: float = param(
        0.0,
        "part of the way by which a horizon sinks towards each farther tap that is lower, so that what is narrow in "
        "the image hides less; 0 for the highest tap",
        low=0.0,
        high=1.0,
        shape=bool,
    )
    bent_normals: bool = param(False, "also find the mean unoccluded direction of each pixel")

    @property
    def channels(self) -> int:
        """A, and x, y and z of the bent normal."""
        return 4 if self.bent_normals else 1


class GtaoKeywords(SliceKeywords, total=False):
    """The other parameters of `gtao`."""

    falloff: float
    thin_occluder: float
    horizon_decay: float


class Gtao(SliceTechnique[GtaoParams]):
    """GTAO, prepared for images of one size; see `OcclusionTechnique` for the arguments.

    Jimenez et al. 2016. Departs: see `gtao`.

    With `bent_normals`, the plane that `run` returns has four images: A, and x, y, z of the bent
    normal in world space, of unit length; 0 where nothing is.
    """

    name = "gtao"
    defaults = GtaoParams

    def _prepare(self) -> None:
        super()._prepare()
        if self.params.bent_normals:
            self._bent = BentNormals(self.runtime, self.size)

    def run(self, gbuffer: DeviceGBuffer) -> Plane:
        """Queue the passes; return the plane. Nothing is allocated after the first call."""
        plane = super().run(gbuffer)
        return self._bent.run(gbuffer, plane) if self.params.bent_normals else plane

    def __call__(self, gbuffer: GBuffer | DeviceGBuffer, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Return A [rows, columns] float32 in [0, 1], written to `out` if given."""
        if not self.params.bent_normals:
            return super().__call__(gbuffer, out)
        a, _ = self.both(gbuffer)
        if out is None:
            return a
        out[...] = a
        return out

    def both(self, gbuffer: GBuffer | DeviceGBuffer) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return A [rows, columns] and bent normals [rows, columns, 3]; see `gtao`."""
        if not self.params.bent_normals:
            raise ValueError("bent_normals is False: expected True for bent normals")
        device = on_device(gbuffer, self.runtime)
        with self.runtime.frame():
            result = self.run(device).download()
        return result[0], np.ascontiguousarray(np.moveaxis(result[1:], 0, -1))

    def _macros(self) -> Mapping[str, int]:
        params = self.params
        return {
            "GTAO_FALLOFF": int(params.falloff > 0.0),
            "GTAO_DECAY": int(params.horizon_decay > 0.0),
            "GTAO_BENT": int(params.bent_normals),
        }

    def _values(self, *, thick: int) -> Mapping[str, float]:
        params = self.params
        return {
            "falloff_scale": 1.0 / params.falloff if params.falloff > 0.0 else 0.0,
            "thin": (1.0 + params.thin_occluder) ** 2 - 1.0,
            "decay": params.horizon_decay,
        }


class _GtaoCall(GtaoKeywords, AskedKeywords, total=False):
    """Keywords of `gtao`, but those that its types depend on."""


@overload
def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    bent_normals: Literal[False] = False,
    confidence: Literal[False] = False,
    **params: Unpack[_GtaoCall],
) -> NDArray[np.float32]: ...
@overload
def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    bent_normals: Literal[True],
    confidence: Literal[False] = False,
    **params: Unpack[_GtaoCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
@overload
def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    bent_normals: Literal[False] = False,
    confidence: Literal[True],
    **params: Unpack[_GtaoCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
@overload
def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = ...,
    slices: int | None = ...,
    taps: int | None = ...,
    *,
    bent_normals: Literal[True],
    confidence: Literal[True],
    **params: Unpack[_GtaoCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]: ...
@banded(confident_plan(Gtao, slice_reach))
@with_fields_described(GtaoParams)
@serialised
def gtao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = None,
    slices: int | None = None,
    taps: int | None = None,
    *,
    bent_normals: bool = False,
    confidence: bool = False,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[GtaoKeywords],
) -> NDArray[np.float32] | tuple[NDArray[np.float32], ...]:
    """Compute cosine-weighted ambient occlusion from the highest horizons round each pixel.

    Jimenez et al. 2016, "Practical Realtime Strategies for Accurate Indirect Occlusion". Departs: a
    horizon is measured from the tangent plane, slices weigh by the azimuth that they stand for, and
    the sum is divided by that of open slices, so that a plane is unoccluded; `falloff` is that of
    XeGTAO (Intel 2021); `horizon_decay` is the published thickness heuristic, off by default; all
    depth layers are read.

    Args:
        gbuffer: depth, and normals if there are any; taps reach into its margin, and into all its
            depth layers: a deeper one counts where those before it are out of the radius.
        radius: distance up to which surfaces occlude, scene units, > 0; by default 5 % of the
            picture's diagonal where surfaces are seen.
        slices: planes through the view ray, 1 to 32.
        taps: depths read on either side of a slice, 1 to 64.
        bent_normals: whether bent normals are returned too: the mean unoccluded direction of each
            pixel, weighted by its cosine to the normal.
        confidence: whether `ao_confidence` of A is returned too, which takes three times as long as
            `bitmask_ao`.
        preset, error, budget_ms: at most one of them: where the fields that are not given come
            from. "low", "medium", "high" or "ultra"; the greatest RMSE against cast rays, > 0; the
            longest device time of a picture in ms, > 0. See `ssgi_cl.choose`. By default the
            defaults of `GtaoParams`.
        max_memory: most bytes of device memory; where the image needs more, it is computed in bands
            of rows; the result is bit-identical. By default all that the device has.
        runtime: the device; by default the fastest found.
        **params: the other fields of `GtaoParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there. With
        `bent_normals`, A and [rows, columns, 3] float32: bent normals in world space, of unit
        length; the surface's normal where nothing occludes, 0 where nothing is there. In the
        Cornell box they are off from those of 512 rays by 3.8 degrees, the normals by 12.4. With
        `confidence` last [rows, columns] float32 in [0, 1]: see `ao_confidence`.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    checks.switch("confidence", confidence)
    technique, device = made_for(
        Gtao,
        gbuffer,
        runtime,
        radius=radius,
        slices=slices,
        taps=taps,
        bent_normals=bent_normals,
        preset=preset,
        error=error,
        budget_ms=budget_ms,
        **params,
    )
    found = technique.both(device) if bent_normals else technique(device)
    return with_confidence(found, gbuffer, technique.params.radius, runtime) if confidence else found


DESCRIPTOR = Technique(
    name="gtao",
    kind="ao",
    paper="Jimenez et al. 2016",
    function=gtao,
    params=GtaoParams,
    technique=Gtao,
    reference="ssgi_cl.reference.ao.gtao",
    reads=("depth", "normal"),
    writes=("ao", "bent"),
    command=True,
    quantity="occlusion",
    variants={"taps": (4,), "falloff": (0.0, 0.6), "bent_normals": (False, True), "resolution": ("full", "quarter")},
    tunable=TUNABLE,
    layers=PRESET_LAYERS,
    bench=Bench(
        families=("gtao",),
        rows={
            "gtao": (
                "ambient occlusion from horizons, cosine-weighted",
                (("", "gtao.2x9"), ("2 layers", "gtao.2x9-2")),
            ),
            "gtao(bent_normals=True)": (
                "the same with bent normals; RMSE in degrees",
                (("", "bent-normals.2x9"), ("surface normals", "bent-normals.none")),
            ),
        },
    ),
)
