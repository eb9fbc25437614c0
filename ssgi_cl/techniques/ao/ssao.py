"""Screen-space ambient occlusion from points in a ball round each pixel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import param, with_fields_described
from ssgi_cl.core.sampling import DEPTH_BIAS, TILE_ORDER
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.constants import SSAO_TILE
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.techniques.ao.confidence import confident_plan, with_confidence
from ssgi_cl.techniques.ao.occlusion import (
    AskedKeywords,
    OcclusionKeywords,
    OcclusionParams,
    OcclusionTechnique,
    made_for,
)
from ssgi_cl.techniques.ao.occlusion_bands import pixels_per_depth, widest_ray
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.radius import sensible_radius
from ssgi_cl.techniques.source import Source, border_values, check_size
from ssgi_cl.techniques.technique import Bench, Technique

SSAO = Struct(
    "SsaoParams",
    (
        *floats("radius_0", "radius_1", "radius_2", "radius_3"),
        *floats("most_px", "samples_per_px", "fewest", "bias", "depth_bias"),
        *floats("rate", "none_at", "ramp_scale", "power", "curve_end", "curve_scale"),
        *floats("contrast", "border_depth"),
        *ints("margin_left", "margin_right", "margin_top", "margin_bottom", "exact"),
    ),
)

FALLOFFS = ("exponential", "ramp")
POINT_ORDER = np.block([[4 * TILE_ORDER, 4 * TILE_ORDER + 2], [4 * TILE_ORDER + 3, 4 * TILE_ORDER + 1]])
"""[8, 8] Bayer's order of the pixels of a tile."""
TABLE_COLUMNS = 16
"""Columns of the table that kernels read: the most lanes."""


@dataclass(frozen=True, kw_only=True)
class SsaoParams(OcclusionParams):
    """Parameters of SSAO (Mittring 2007; Filion and McNaughton 2008), which have no contrast (1).

    The default contrast was chosen on generated scenes: the RMSE is 9 % less than with 1 on those
    for tuning, 4 % on those for validation.
    """

    cancelling: ClassVar[Mapping[int, float]] = {SSAO_TILE // 2: math.inf}
    """The mean of the tile."""

    radius: float | tuple[float, ...] = param(
        0.5,
        "radius of the ball; up to 4 at once, of which the greatest occlusion counts",
        unit="scene units",
        shape=len,
    )
    samples: int = param(16, "points per pixel and radius", low=1, high=256)
    blur_radius: int = param(
        4,
        "edge-aware blur against the noise of the 8 x 8 tile; 4 leaves nothing that repeats with it; 0 for none",
        low=0,
        high=16,
        unit="px",
    )
    length_power: float = param(
        0.5, "points lie at u^power of the radius, u uniform; 1/3 fills the ball evenly", low=0.05, high=4.0
    )
    hemisphere: bool = param(True, "flip points to the normal's side; without, a flat surface is half occluded")
    falloff: str | tuple[float, ...] = param(
        "ramp",
        "occlusion by distance behind the surface: 'exponential', 'ramp', or values at "
        "equal steps from 0 to `falloff_end`",
        shape=lambda falloff: falloff if isinstance(falloff, str) else len(falloff),
    )
    falloff_rate: float = param(1.0, "exponential: e^(-falloff_rate d), d in radii", low=0.0, high=100.0)
    ramp_start: float = param(1.0, "ramp: full occlusion up to this d", low=0.0, high=100.0, unit="radii")
    ramp_end: float = param(2.0, "ramp: no occlusion from this d on", low=1e-3, high=1e3, unit="radii")
    power: float = param(1.0, "ramp: exponent of its linear part", low=0.01, high=100.0)
    falloff_end: float = param(2.0, "values: d of the last one, no occlusion beyond", low=1e-3, high=1e3, unit="radii")
    bias: float = param(
        0.02, "height above the tangent plane up to which nothing occludes", low=0.0, high=1.0, unit="radii"
    )
    contrast: float = param(
        1.4,
        "exponent of A before the blur; points find less occlusion than rays do, so that more "
        "than 1 has a smaller error",
        low=0.1,
        high=10.0,
    )
    outside: str | float = param(
        "unknown",
        "samples outside the G-buffer: 'unknown' (not counted), 'open' (nothing there) "
        "or the depth of a border in scene units",
        shape=lambda outside: outside == "unknown",
    )
    near_px: float = param(
        math.inf,
        "projected radius above which samples grow in proportion, up to `max_samples`",
        low=1.0,
        high=math.inf,
        unit="px",
    )
    max_samples: int = param(0, "most points per pixel; 0 for `samples`", low=0, high=256)

    def __post_init__(self) -> None:
        OcclusionParams.__post_init__(self)
        set_ = object.__setattr__
        radii = self.radius if isinstance(self.radius, (Sequence, np.ndarray)) else (self.radius,)
        if not 1 <= len(radii) <= 4:
            raise ValueError(f"radius has {len(radii)} values: expected 1 to 4")
        set_(
            self,
            "radius",
            tuple(checks.number("radius", r, low=0, high=1e30, above=True, unit="scene units") for r in radii),
        )
        if isinstance(self.falloff, str):
            checks.choice("falloff", self.falloff, FALLOFFS)
        else:
            curve = checks.vector("falloff", self.falloff, np.size(self.falloff))
            if len(curve) < 2 or len(curve) > 4096 or curve.min() < 0 or curve.max() > 1:
                raise ValueError(
                    f"falloff has {len(curve)} values from {curve.min():g} to {curve.max():g}: "
                    "expected 2 to 4096 values in [0, 1]"
                )
            set_(self, "falloff", tuple(curve.tolist()))
        if isinstance(self.outside, str):
            checks.choice("outside", self.outside, ("unknown", "open"))
        else:
            set_(self, "outside", checks.number("outside", self.outside, low=0, above=True, unit="scene units"))
        if self.ramp_end <= self.ramp_start and self.falloff == "ramp":
            raise ValueError(f"ramp_end is {self.ramp_end}: expected more than ramp_start, which is {self.ramp_start}")
        if self.max_samples and self.max_samples < self.samples:
            raise ValueError(f"max_samples is {self.max_samples}: expected 0 or at least samples, {self.samples}")


class SsaoKeywords(OcclusionKeywords, total=False):
    """The other parameters of `ssao`."""

    length_power: float
    hemisphere: bool
    falloff: str | tuple[float, ...]
    falloff_rate: float
    ramp_start: float
    ramp_end: float
    power: float
    falloff_end: float
    bias: float
    contrast: float
    outside: str | float
    near_px: float
    max_samples: int


def sample_points(count: int, length_power: float) -> NDArray[np.float64]:
    """Return [count, 3] points of the unit ball; any beginning of the list is well spread.

    Directions and lengths follow the three-dimensional R sequence (Roberts 2018).
    """
    root = 1.22074408460575947536  # of g^4 = g + 1
    steps = root ** -np.arange(1.0, 4.0)
    u = np.mod(0.5 + np.outer(np.arange(1, count + 1), steps), 1.0)
    z = 1.0 - 2.0 * u[:, 0]
    ring = np.sqrt(1.0 - z * z)
    angle = 2.0 * np.pi * u[:, 1]
    direction = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)
    return direction * u[:, 2:] ** length_power


def tile_vectors() -> NDArray[np.float64]:
    """Return [8, 8, 3] unit vectors, neighbours far apart: the random vectors of a tile."""
    order = POINT_ORDER
    # Reflection about v and about -v is the same, so the spiral covers half of the sphere.
    z = (order + 0.5) / SSAO_TILE**2
    angle = order * (np.pi * (3.0 - np.sqrt(5.0)))
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)


def reflected_points(count: int, length_power: float) -> NDArray[np.float64]:
    """Return [8, 8, count, 3]: points of each tile pixel, reflected about its vector.

    Each pixel takes every 64th of one list, so that a tile has 64 times as many different points: one list for all
    has few lengths, which would show as contour lines, since a reflection keeps them. Tiles of 4 x 4 pixels, whose
    columns have 4 sets of points each, leave streaks along columns of the hall that no blur takes away.
    """
    pixels = SSAO_TILE**2
    points = sample_points(pixels * count, length_power)
    points = points[POINT_ORDER[..., None] + pixels * np.arange(count)]
    mirror = tile_vectors()[:, :, None, :]
    along = np.sum(points * mirror, axis=-1, keepdims=True)
    reflected: NDArray[np.float64] = points - 2.0 * along * mirror
    return reflected


def point_table(params: SsaoParams) -> NDArray[np.float32]:
    """Return [8 rows, points, 3, 16 columns] as kernels/ssao/ssao.cl reads it."""
    most = max(params.samples, params.max_samples)
    points = reflected_points(most, params.length_power)  # row, column, point, axis
    return np.tile(points.transpose(0, 2, 3, 1), TABLE_COLUMNS // SSAO_TILE).astype(np.float32)


class Ssao(OcclusionTechnique):
    """SSAO, prepared for images of one size; see `OcclusionTechnique` for the arguments.

    Mittring 2007; Filion and McNaughton 2008. Departs: see `ssao`. Reads the front layer alone.
    """

    name = "ssao"
    defaults = SsaoParams

    def _prepare(self) -> None:
        params = self.params
        most = max(params.samples, params.max_samples)
        curve = np.zeros(2) if isinstance(params.falloff, str) else np.asarray(params.falloff)
        self._kernel = self.runtime.kernel(
            "ssao/ssao.cl",
            {
                "SSAO_MOST_SAMPLES": most,
                "SSAO_RADII": len(params.radius),
                "SSAO_HEMISPHERE": int(params.hemisphere),
                "SSAO_FALLOFF": FALLOFFS.index(params.falloff) if isinstance(params.falloff, str) else len(FALLOFFS),
                "SSAO_CURVE_SIZE": len(curve),
                "SSAO_OUTSIDE": int(params.outside != "unknown"),
            },
            (CAMERA, SSAO),
        )
        self._points = self.runtime.array(point_table(params))
        self._curve = self.runtime.array(curve.astype(np.float32))

    def _set(self, params: SsaoParams) -> None:
        if params.length_power != self.params.length_power:
            self._points.upload(point_table(params))
        if params.falloff != self.params.falloff:
            self._curve.upload(np.asarray(params.falloff, np.float32))

    def _check(self, gbuffer: DeviceGBuffer) -> None:
        check_size(gbuffer, self.size, self.margin)

    def _occlude(self, out: Plane, gbuffer: DeviceGBuffer, source: Source, region: Region | None) -> None:
        self._kernel.run(
            out.size,
            region=region,
            depth=source.depth,
            normal=source.normal,
            samples=self._points,
            curve=self._curve,
            visibility=out,
            camera=source.camera_struct,
            params=self._packed(source, exact=gbuffer.is_exact),
        )

    def _packed(self, source: Source, *, exact: bool) -> Any:
        params = self.params
        radii = [*params.radius, 0.0, 0.0, 0.0][:4]
        curve_size = 2 if isinstance(params.falloff, str) else len(params.falloff)
        return SSAO.pack(
            {
                **{f"radius_{i}": radius for i, radius in enumerate(radii)},
                "most_px": params.max_radius_px / self._step,
                "samples_per_px": params.samples * self._step / params.near_px,
                "fewest": params.samples,
                "bias": params.bias,
                "depth_bias": DEPTH_BIAS,
                "rate": params.falloff_rate,
                "none_at": params.ramp_end,
                "ramp_scale": 1.0 / (params.ramp_end - params.ramp_start)
                if params.ramp_end > params.ramp_start
                else 0.0,
                "power": params.power,
                "curve_end": params.falloff_end,
                "curve_scale": (curve_size - 1) / params.falloff_end,
                "contrast": params.contrast,
                "border_depth": params.outside if isinstance(params.outside, float) else math.inf,
                "exact": int(exact),
                **border_values(source, self._visibility.size),
            }
        )


def ssao_reach(params: SsaoParams, camera: Camera, layers: int, nearest: float) -> float:
    """Return how many rows away the points of a receiver are seen at most, at a depth of at least `nearest`.

    A point that is nearer to the eye than the receiver is seen farther out.
    """
    radii = params.radius if isinstance(params.radius, tuple) else (params.radius,)
    pixels = min(max(radii) * pixels_per_depth(camera, nearest), params.max_radius_px)
    if camera.is_orthographic:
        return pixels + 1.0
    share = pixels / pixels_per_depth(camera, 1.0)  # of the depth
    return pixels * widest_ray(camera) / (1.0 - share) + 1.0 if share < 1.0 else math.inf


class _SsaoCall(SsaoKeywords, AskedKeywords, total=False):
    """Keywords of `ssao`, but those that its types depend on."""


@overload
def ssao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: ArrayLike | None = ...,
    samples: int | None = ...,
    *,
    confidence: Literal[False] = False,
    **params: Unpack[_SsaoCall],
) -> NDArray[np.float32]: ...
@overload
def ssao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: ArrayLike | None = ...,
    samples: int | None = ...,
    *,
    confidence: Literal[True],
    **params: Unpack[_SsaoCall],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
@banded(confident_plan(Ssao, ssao_reach))
@with_fields_described(SsaoParams)
@serialised
def ssao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: ArrayLike | None = None,
    samples: int | None = None,
    *,
    confidence: bool = False,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[SsaoKeywords],
) -> NDArray[np.float32] | tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Compute ambient occlusion from points in a ball round each pixel.

    Mittring 2007, "Finding Next Gen: CryEngine 2", and Filion and McNaughton 2008, "StarCraft II
    Effects and Techniques". Departs: with `hemisphere` (the default) a surface occludes only where
    it rises above the receiver's tangent plane; points are a low-discrepancy sequence; A is raised
    to `contrast`.

    Args:
        gbuffer: depth, and normals if there are any; with a margin, samples reach into it.
        radius: of the ball in scene units, > 0, by default 5 % of the picture's diagonal where surfaces
            are seen; up to 4 values, of which the greatest occlusion
            counts in each pixel.
        samples: points per pixel, 1 to 256; by default 16, or the preset's.
        confidence: whether `ao_confidence` of A is returned too, which takes three times as long as
            `bitmask_ao`.
        preset, error, budget_ms: at most one of them: where the fields that are not given come
            from. "low", "medium", "high" or "ultra"; the greatest RMSE against cast rays, > 0; the
            longest device time of a picture in ms, > 0. See `ssgi_cl.choose`. By default the
            defaults of `SsaoParams`.
        max_memory: most bytes of device memory; where the image needs more, it is computed in bands
            of rows; the result is bit-identical. By default all that the device has.
        runtime: the device; by default the fastest found.
        **params: the other fields of `SsaoParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there. With `confidence`,
        A and [rows, columns] float32 in [0, 1]: see `ao_confidence`.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    checks.switch("confidence", confidence)
    radii = checks.as_array("radius", sensible_radius(gbuffer) if radius is None else radius)
    if radii.dtype.kind not in "fiu":
        raise TypeError(f"radius is {radius!r}: expected 1 to 4 numbers (scene units)")
    technique, device = made_for(
        Ssao,
        gbuffer,
        runtime,
        radius=tuple(radii.ravel().tolist()),
        samples=samples,
        preset=preset,
        error=error,
        budget_ms=budget_ms,
        **params,
    )
    a = technique(device)
    return with_confidence(a, gbuffer, technique.params.radius, runtime) if confidence else a


DESCRIPTOR = Technique(
    name="ssao",
    kind="ao",
    paper="Mittring 2007; Filion and McNaughton 2008",
    function=ssao,
    params=SsaoParams,
    technique=Ssao,
    reference="ssgi_cl.reference.ao.ssao",
    reads=("depth", "normal"),
    writes=("ao",),
    command=True,
    quantity="occlusion",
    variants={"falloff": ("ramp", "exponential"), "outside": ("unknown", 1.0), "resolution": ("full", "quarter")},
    tunable={"samples": [4, 8, 16, 32, 64], "resolution": ["full", "half"]},
    bench=Bench(
        families=("ssao-blur",),
        rows={"ssao": ("ambient occlusion from points in a ball", (("16 samples, blurred", "ssao-blur.16"),))},
    ),
)
