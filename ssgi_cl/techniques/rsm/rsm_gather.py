"""One bounce of light gathered from reflective shadow maps, without indirect visibility."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack, get_args

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import GatherMethod, GatherResolution
from ssgi_cl.core.params import Params, param, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.bands import CELL, banded, fixed_plan
from ssgi_cl.techniques.methods import Method, chosen_params
from ssgi_cl.techniques.multires.multires_grid import MultiresGrid, MultiresGridParams
from ssgi_cl.techniques.rsm.rsm_maps import MapSampling
from ssgi_cl.techniques.rsm.rsm_published import RsmPublished, RsmPublishedParams
from ssgi_cl.techniques.rsm.rsm_technique import RsmTechnique
from ssgi_cl.techniques.technique import Bench, Technique

RESOLUTIONS = get_args(GatherResolution)


@dataclass(frozen=True, kw_only=True)
class RsmGatherParams(Params):
    """Parameters of gathering from reflective shadow maps, method "unbiased".

    In the time of 400 samples in a disk, which lie scattered in memory, 6400 drawn by flux have
    0.33 to 0.66 of the error (against all texels; Cornell box and both lights of the hall). A disk
    as far as the furthest corner has at most 12 % more error there than the best of 0.25, 0.5,
    0.75, 1 and 1.42 sides, which is 0.75 for one light and 1 for the others.
    """

    samples: int = param(400, "texels of each map that a pixel gathers from", low=1, high=65536)
    pattern: str = param(
        "flux",
        "'flux': drawn in proportion to flux, the same for all pixels; 'fixed': a disk "
        "round the pixel's place in the map; 'rotated': the disk turned from pixel to pixel, noise "
        "for bands; 'all': every texel, whatever `samples` is",
        choices=("flux", "fixed", "rotated", "all"),
    )
    radius: float = param(
        math.inf,
        "of the disk; by default as far as the furthest corner of the map",
        unit="sides of a face of the map",
        low=0.0,
        above=True,
        high=math.inf,
    )
    resolution: GatherResolution = param(
        "full",
        "'full': light is gathered for all pixels; 'adaptive': for those alone between "
        "which it is not smooth, the others are interpolated",
        choices=RESOLUTIONS,
    )
    interpolation_error: float = param(
        0.02, "of interpolation, as estimated", unit="of the mean irradiance", low=0.0, high=1e6
    )
    plane_tolerance: float = param(
        0.005,
        "distance from the tangent plane at which a neighbour counts nothing "
        "(orthographic cameras: in heights of the view)",
        unit="depths",
        low=1e-6,
        high=1.0,
    )
    normal_tolerance: float = param(
        0.32, "angle between normals at which it counts nothing", unit="radians", low=1e-3, high=3.0
    )


class RsmGatherKeywords(TypedDict, total=False):
    """The other parameters of `rsm_gather`, of either method."""

    interpolation_error: float
    plane_tolerance: float
    normal_tolerance: float
    offset: float
    spacing: int
    position_tolerance: float


class RsmGather(RsmTechnique[RsmGatherParams]):
    """Gathering, prepared for images of one size; see `RsmTechnique` for the arguments.

    After Dachsbacher and Stamminger 2005, "Reflective Shadow Maps". Departs: see `rsm_gather`;
    `RsmPublished` is the method as published.
    """

    name = "rsm gather"
    defaults = RsmGatherParams

    def _prepare(self) -> None:
        self._grid: MultiresGrid | None = None
        if self.params.resolution == "adaptive":
            self._grid = MultiresGrid(self.runtime, self.size, _grid_params(self.params))
            self._bound = self.runtime.empty(1, np.float32)
            self._bounds = self.runtime.kernel("rsm/rsm_gather_bound.cl")
        else:
            self._irradiance = self.runtime.plane(3, self.size)

    def _sampling(self, params: RsmGatherParams) -> MapSampling:
        return MapSampling(pattern=params.pattern, samples=params.samples, radius=params.radius)

    def _set(self, params: RsmGatherParams) -> None:
        super()._set(params)
        if self._grid is not None:
            self._grid.params = _grid_params(params)

    @property
    def computed(self) -> float:
        """Share of all pixels that the latest run gathered for. Waits for the device."""
        if self._grid is None:
            return 1.0
        return sum(self._grid.counts().values()) / (self.size[0] * self.size[1])

    def _gathered(self, gbuffer: DeviceGBuffer, camera: Camera) -> Plane:
        if self._grid is None:
            self._maps.gather(gbuffer, camera, self._irradiance)
            return self._irradiance
        for level in self._grid.levels(gbuffer, self._bound):
            self._maps.gather(level.source, camera, level.values, level)
            if level.number == 0:
                self._bounds.run(
                    level.size,
                    grid=(1, 1),
                    local=(1, 1),
                    list=level.list,
                    values=level.values,
                    bound=self._bound,
                    share=self.params.interpolation_error,
                )
        return self._grid.result


def _grid_params(params: RsmGatherParams) -> MultiresGridParams:
    return MultiresGridParams(plane_tolerance=params.plane_tolerance, normal_tolerance=params.normal_tolerance)


METHODS: dict[str, Method] = dict(
    zip(
        get_args(GatherMethod),
        (Method(RsmGather, RsmGatherParams), Method(RsmPublished, RsmPublishedParams)),
        strict=True,
    )
)
"""The first is the default."""


@banded(fixed_plan(CELL))
@with_fields_described(RsmGatherParams, RsmPublishedParams)
@serialised
def rsm_gather(
    gbuffer: GBuffer | DeviceGBuffer,
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    samples: int = 400,
    *,
    method: GatherMethod = "unbiased",
    radius: float | None = None,
    pattern: str | None = None,
    resolution: GatherResolution | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[RsmGatherKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by the one-bounce indirect light of reflective shadow maps.

    E(x) = sum over texels of flux cos cos / (pi d^2 + area) (after Dachsbacher and Stamminger
    2005, "Reflective Shadow Maps", eq. 1). Walls between texel and pixel cast no shadow, and what
    glossy surfaces mirror is left out (`vpl_splat` has both).

    Departs, with method "unbiased": each texel is a disc of the surface that it stands for, so E is
    bounded; samples are drawn in proportion to flux (Clarberg et al. 2005) or weighted by what
    their density lacks, so they converge to the sum over all texels; where to interpolate is
    decided by the light's differences. Method "published" is as published: see
    `RsmPublishedParams`.

    Args:
        gbuffer: depth, and normals if there are any.
        rsms: what `rasterize.rsm` returns, or several of them, whose light is summed.
        samples: texels of each map that a pixel gathers from, 1 to 65536.
        method: "unbiased", or "published" for the disk of samples, weights, low-resolution pass and
            interpolation of the paper.
        radius: of the disk in sides of the map (of a point light's face), > 0. Method "unbiased":
            of the patterns "fixed" and "rotated", by default as far as the furthest corner of the
            map; "published": 0.5 by default.
        pattern: method "unbiased": "flux", "fixed", "rotated" or "all"; see `RsmGatherParams`.
        resolution: method "unbiased": "full", or "adaptive" for fewer pixels where light is smooth.
        max_memory: as of `gtao`; with "adaptive" each band is held to the error by itself.
        runtime: the device; by default the fastest found.
        **params: the other fields of `RsmGatherParams` or, with method "published", of
            `RsmPublishedParams`.

    Returns:
        Irradiance E [rows, columns, 3] float32 in W/m^2, not clamped to 1; 0 where nothing is.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range, or one of another
            method; the message says which, its value and what is allowed.
    """
    given = {"radius": radius, "pattern": pattern, "resolution": resolution}
    given = {name: value for name, value in given.items() if value is not None}
    chosen: Any = chosen_params(METHODS, method, {"samples": samples, **given, **params})
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    kind: Any = METHODS[method].technique
    technique = runtime.prepared(
        (kind, device.size, device.margin, chosen.shape()), lambda: kind(runtime, device.size, chosen, device.margin)
    )
    technique.params = chosen
    result: NDArray[np.float32] = technique(device, rsms)
    return result


DESCRIPTOR = Technique(
    name="rsm_gather",
    kind="indirect",
    paper="Dachsbacher and Stamminger 2005",
    function=rsm_gather,
    params=RsmGatherParams,
    technique=RsmGather,
    reference="ssgi_cl.reference.rsm.rsm_gather",
    reads=("depth", "normal", "rsms"),
    writes=("irradiance",),
    methods={name: method.params for name, method in METHODS.items()},
    quantity="unblocked_bounce",
    bench=Bench(
        families=("rsm-gather", "rsm-gather-adaptive"),
        rows={
            "rsm_gather": (
                "one-bounce indirect light, gathered from reflective shadow maps",
                (("400 samples", "rsm-gather.400"), ('`resolution="adaptive"`', "rsm-gather-adaptive.400")),
            )
        },
    ),
)
