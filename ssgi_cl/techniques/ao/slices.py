"""Scan of the depth in slices round a pixel: base of HBAO, GTAO and the visibility bitmask."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.params import Prepared, param
from ssgi_cl.core.sampling import TILE_ORDER
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_bytes
from ssgi_cl.device.constants import SLICES_GROUP, SLICES_NEAREST_TAP, SLICES_STRIP
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.device.transient import ImageParts, Target
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS, OcclusionKeywords, OcclusionParams, OcclusionTechnique
from ssgi_cl.techniques.ao.occlusion_bands import pixels_per_depth, widest_ray
from ssgi_cl.techniques.filters.upsample import coarse_size
from ssgi_cl.techniques.source import Source, border_values

SLICES = Struct(
    "SliceParams",
    (
        *floats("radius", "ortho_unit", "unit_px", "most_px", "bias", "depth_bias", "contrast"),
        *floats("thickness", "slack", "falloff_scale", "thin", "decay"),
        *floats("attenuation", "bias_cos", "bias_sin"),
        *ints("margin_left", "margin_right", "margin_top", "margin_bottom", "stride", "lead", "exact"),
    ),
)

TILE = 4
"""Rows and columns after which the pattern of slices repeats; the blur is made for it."""

FRAME_STEPS = (0.7548776662466927, 0.5698402909980532, 0.5 * (math.sqrt(5.0) - 1.0))
"""By which angle, taps and dither go on from one frame to the next: powers of 1 / g, g^3 = g + 1, and 1 / the golden
ratio."""

DEPTH_BIAS = 4e-6
"""Bias relative to the distance from the eye: some roundings of a float32 position (2^-24 each)."""

# Presets differ in how much they sample, not in what they take for an occluder, and in nothing that
# depends on the scene: more slices err less on all sets of scenes. More taps err less where what is
# tuned on is thick, and more where horizons take thin rods for walls.
TUNABLE: Mapping[str, Sequence[Any]] = {"slices": [1, 2, 3, 4, 8], "resolution": ["full", "half"]}
"""Parameters by which presets differ."""
PRESET_LAYERS = (1, 2, 4)
"""Numbers of depth layers that presets are recorded for."""


@dataclass(frozen=True, kw_only=True)
class SliceParams(OcclusionParams):
    """Parameters of every technique that scans slices.

    Two slices of nine taps a side find occlusion better than three of six, and taps almost evenly
    spread better than taps that crowd round the receiver: blurred, on the built-in scenes with
    0.5 to 2.5 times their own radii, GTAO's RMSE is .082 with the defaults, .095 with three slices
    of six taps and a power of 2.
    """

    radius: float = param(
        0.5, "distance up to which surfaces occlude", low=0.0, high=1e30, above=True, unit="scene units"
    )
    slices: int = param(2, "planes along the view direction, each with two sides", low=1, high=32)
    taps: int = param(9, "depths read on either side of a slice", low=1, high=64)
    tap_power: float = param(1.2, "taps lie at u^tap_power of the radius, u evenly spread", low=0.1, high=8.0)
    bias: float = param(
        0.0, "height above the tangent plane up to which nothing occludes", low=0.0, high=1.0, unit="radii"
    )
    contrast: float = param(1.0, "exponent of A before the blur", low=0.1, high=10.0)
    frame: int = param(
        0,
        "number of the frame: each turns the slices and shifts the taps in another way, for the mean of several",
        low=0,
        high=1_000_000,
        shape=lambda _: None,
    )

    def in_front_of(self, layers: int) -> Self:
        """Return the parameters with which the first of so many depth layers is read."""
        return self

    @property
    def overshoot(self) -> float:
        """Shift of the taps away from the receiver, in distances between taps."""
        return 0.0


@dataclass(frozen=True, kw_only=True)
class ScanParams(SliceParams):
    """Parameters of the techniques of ambient occlusion that scan slices."""

    cancelling: ClassVar[Mapping[int, float]] = {TILE // 2: math.inf, TILE - 1: math.sqrt(2.0 / math.log(2.0))}
    """The mean of the tile, and a Gaussian that weighs half two pixels away: what repeats every 4 pixels along rows or
    columns cancels out, 1 - 2 / 2 = 0."""

    blur_radius: int = param(
        TILE // 2,
        "edge-aware blur against the noise of the 4 x 4 tile; 2 and 3 cancel what repeats with it; 0 for none",
        low=0,
        high=16,
        unit="px",
    )
    checkerboard: bool = param(
        False,
        "scan every other pixel, as on a checkerboard: the blur finds the others from their neighbours; at full "
        "resolution",
    )

    def __post_init__(self) -> None:
        SliceParams.__post_init__(self)
        if self.checkerboard and self.resolution != "full":
            raise ValueError(f"checkerboard is True with resolution={self.resolution!r}: expected 'full'")
        for name in ("blur_radius", "blur_passes") if self.checkerboard else ():
            if getattr(self, name) == 0:
                raise ValueError(f"checkerboard is True with {name}=0: expected 1 or more, the blur fills the pixels")

    @property
    def halved(self) -> bool:
        """Whether every other pixel is computed, as on a checkerboard, and the blur finds the others."""
        return self.checkerboard


class SliceKeywords(OcclusionKeywords, total=False):
    """`ScanParams` as keyword arguments, but those that functions name."""

    checkerboard: bool
    tap_power: float
    bias: float
    contrast: float
    frame: int


@dataclass(frozen=True, eq=False)
class Pattern:
    """Slices and taps of the pixels of a tile.

    Attributes:
        angle: [4, 4, slices] of each slice from +columns towards +rows, radians, in [0, pi).
        share: [4, 4, slices, taps] distance of each tap, in parts of the radius, rising.
        dither: [4, 4, slices] in [0, 1), for roundings that are right on average.
    """

    angle: NDArray[np.float64]
    share: NDArray[np.float64]
    dither: NDArray[np.float64]


def pattern(params: SliceParams) -> Pattern:
    """Return the deterministic pattern of a tile: Hammersley's points in Bayer's order.

    The 16 pixels turn their slices by 16 even steps and shift their taps by 16 others; of a checkerboard the
    8 that are scanned, whose numbers are the first 8, by 8. On the
    built-in scenes, blurred, GTAO's RMSE is 2 % (4 % with one slice) below that of the R2 sequence
    along a Hilbert curve, 16 points of which crowd. From frame to frame all of a tile go on along the R2
    sequence (Roberts 2018), dithers along the golden ratio's.
    """
    slices, taps = params.slices, params.taps
    on_turn, on_jitter, on_dither = (math.fmod(params.frame * step, 1.0) for step in FRAME_STEPS)
    number = np.arange(slices)
    count = TILE**2 // 2 if params.halved else TILE**2
    order = TILE_ORDER % count
    digits = count.bit_length() - 1
    reversed_bits = np.sum([((order >> bit) & 1) << (digits - 1 - bit) for bit in range(digits)], axis=0)
    turn = np.mod((order[..., None] + 0.5) / count + on_turn, 1.0)
    jitter = np.mod((reversed_bits[..., None] + 0.5) / count + number / slices + on_jitter, 1.0)
    golden = FRAME_STEPS[2]
    return Pattern(
        angle=np.pi * (number + turn) / slices,
        share=((np.arange(taps) + jitter[..., None] + params.overshoot) / taps) ** params.tap_power,
        dither=np.mod(0.5 + golden * (TILE_ORDER[..., None] + TILE**2 * number) + on_dither, 1.0),
    )


def table(params: SliceParams) -> NDArray[np.float32]:
    """Return the pattern as kernels read it: [4 rows, 4 columns, slices, 3 + taps].

    Taps are filled up to a multiple of 16.
    """
    made = pattern(params)
    rows = np.concatenate(
        [
            np.stack([np.cos(made.angle), np.sin(made.angle), made.dither], axis=-1),
            made.share,
            np.zeros((*made.share.shape[:3], -params.taps % SLICES_GROUP)),
        ],
        axis=-1,
    )
    return rows.astype(np.float32)


class SliceScan(Prepared[SliceParams]):
    """Inputs of a scan of slices, prepared for G-buffers of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the camera's image.
        params: of the technique.
        margin: (rows, columns) by which the G-buffers exceed it on every side.
        layers: depth layers of the G-buffers.

    Attributes:
        step: pixels of the image from one that is scanned to the next.
        size: (rows, columns) of the result, every step-th pixel.
        table: what kernels read of the pattern.
    """

    def __init__(self, runtime: Runtime, size: Size, params: SliceParams, margin: Size, layers: int) -> None:
        self.runtime, self._params, self.layers = runtime, params, layers
        self.step = step = RESOLUTIONS[params.resolution]
        self.size = coarse_size(size, step)
        self.table = runtime.array(table(params))
        reduced_margin = (margin[0] // step, margin[1] // step)
        self._whole = (self.size[0] + 2 * reduced_margin[0], self.size[1] + 2 * reduced_margin[1])
        # Column 0 of the result begins a tile.
        self._lead = -reduced_margin[1] % TILE
        quarter = -(-(self._whole[1] + self._lead) // TILE)
        self._stride = (-(-quarter // SLICES_GROUP) + 1) * SLICES_GROUP
        self._first = (margin[0] % step, margin[1] % step)

    def _set(self, params: SliceParams) -> None:
        if (params.tap_power, params.frame) != (self.params.tap_power, self.params.frame):
            self.table.upload(table(params))

    @property
    def sorted_size(self) -> Size:
        """Return (rows, columns) of the arrays that kernels scan."""
        return self._whole[0], TILE * self._stride

    @property
    def grid(self) -> Size:
        """Return (rows, columns) of work-items: a strip's are below one another's."""
        rows, columns = self.size
        across = SLICES_STRIP // self.runtime.variant.lanes
        return rows * -(-columns // SLICES_STRIP), across // 2 if self.params.halved else across

    def strips(self, region: Region | None) -> list[Region | None]:
        """Return the parts of `grid` that scan a window of the result, one a strip."""
        if region is None:
            return [None]
        _, columns = self.grid
        first, (_, count) = region.cells((1, SLICES_STRIP))
        return [
            Region(strip * self.size[0] + region.row, 0, region.rows, columns)
            for strip in range(first[1], first[1] + count)
        ]

    def macros(self, *, thick: int, reads_thickness: bool) -> dict[str, int]:
        """Return the macros of a kernel that scans all layers, so many of which have thickness by pixel."""
        return {
            "SLICES_COUNT": self.params.slices,
            "SLICES_TAPS": self.params.taps,
            "SLICES_LAYERS": self.layers,
            "SLICES_CHECKERBOARD": int(self.params.halved),
            **({"SLICES_THICKNESS": thick} if reads_thickness else {}),
        }

    def inv_depth(self, gbuffer: DeviceGBuffer, thickness: Plane | None) -> Plane:
        """Queue the pass that brings all layers into the measure and size of the scan."""
        count = self.layers
        perspective = bool(gbuffer.camera_struct["perspective"])
        thick = 0 if thickness is None else thickness.count
        kernel = self.runtime.kernel(
            "slices/slices_inv_depth.cl", {"INV_DEPTH_LAYERS": count, "INV_DEPTH_THICKNESS": thick}, (CAMERA,)
        )
        # What lies outside differs between perspective and orthographic cameras.
        target = Target(self.runtime, count + thick, self.sorted_size, 0.0 if perspective else math.inf, kept=False)
        with target.over(self._rows_of(gbuffer.region)) as (inv_depth, over):
            kernel.run(
                inv_depth.size,
                region=over,
                depth=gbuffer.depth,
                thickness=thickness,
                inv_depth=inv_depth,
                ortho_unit=_ortho_unit(gbuffer.camera_struct, self.step),
                camera=gbuffer.camera_struct,
                **self._places(gbuffer.depth),
            )
        return inv_depth

    def _rows_of(self, region: Region | None) -> Region | None:
        """Return the whole rows of `inv_depth` that hold what is seen in a window of a G-buffer."""
        if region is None:
            return None
        rows, columns = self.sorted_size
        seen = region.inside((rows * self.step, columns * self.step), self._first)
        coarse = seen.reduced(self.step)
        return Region(coarse.row, 0, coarse.rows, columns)

    def sorted(self, images: Plane | ImageParts, region: Region | None = None) -> DeviceArray:
        """Queue the passes that sort images of the G-buffer's whole size as `inv_depth` sorts depth.

        The results are 0 outside of `region`.
        """
        parts: Iterable[tuple[int, Plane]] = [(0, images)] if not isinstance(images, ImageParts) else images.parts
        array, over = self._array(images.count, region)
        if isinstance(images, ImageParts) and not images.complete and region is None:
            array.fill(0)
        for first, part in parts:
            kernel = self.runtime.kernel("slices/slices_sorted.cl", {"SORTED_COUNT": part.count})
            kernel.run(
                self.sorted_size, region=over, images=part, sorted=array, first_image=first, **self._places(part)
            )
            del part  # its memory is the next one's
        return array

    def slopes(self, gbuffer: DeviceGBuffer) -> DeviceArray:
        """Queue the pass that finds the planes of all layers, from normals where there are any."""
        slopes, over = self._array(2 * self.layers, gbuffer.region)
        kernel = self.runtime.kernel(
            "slices/slices_slopes.cl", {"SLOPES_LAYERS": self.layers, "SLOPES_NORMALS": gbuffer.attributes}, (CAMERA,)
        )
        kernel.run(
            self.sorted_size,
            region=over,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            slopes=slopes,
            ortho_unit=_ortho_unit(gbuffer.camera_struct, self.step),
            camera=gbuffer.camera_struct,
            **self._places(gbuffer.depth),
        )
        return slopes

    def _array(self, count: int, region: Region | None) -> tuple[DeviceArray, Region | None]:
        """Return images of `sorted_size`, and where in them what a window of a G-buffer shows is
        written; they are 0 elsewhere."""
        array = self.runtime.transient.images(count, self.sorted_size)
        if region is not None:
            array.fill(0)
        return array, self._rows_of(region)

    def _places(self, fine: Plane) -> dict[str, Any]:
        """Return arguments: which pixels of a plane are picked and where they are put."""
        return {
            "fine_size": fine.size,
            "columns": self._whole[1],
            "lead": self._lead,
            "step": self.step,
            "first_x": self._first[1],
            "first_y": self._first[0],
        }

    def packed(self, source: Source, values: Mapping[str, float], *, exact: bool = False) -> Any:
        """Return the struct for a G-buffer, or it reduced, with the technique's own `values`.

        `exact`: whether depths are, see `DeviceGBuffer.is_exact`.
        """
        params = self.params
        camera = source.camera_struct
        unit = _ortho_unit(camera, 1)
        pixels = max(abs(float(camera["from_x"])), abs(float(camera["from_y"])))
        return SLICES.pack(
            {
                **dict.fromkeys(SLICES.dtype.names or (), 0.0),
                "radius": params.radius,
                "ortho_unit": unit,
                "unit_px": pixels / (1.0 if camera["perspective"] else unit),
                "most_px": params.max_radius_px / self.step,
                "bias": params.bias,
                "depth_bias": DEPTH_BIAS,
                "contrast": params.contrast,
                "stride": self._stride,
                "lead": self._lead,
                "exact": int(exact),
                **border_values(source, self.size),
                **values,
            }
        )


P = TypeVar("P", bound=SliceParams)


class SliceTechnique(OcclusionTechnique, Generic[P]):
    """A technique that scans slices; see `OcclusionTechnique` for the arguments."""

    reads_thickness: ClassVar[bool] = False
    """Whether the technique reads the per-pixel thickness that a G-buffer may have."""

    def _prepare(self) -> None:
        in_front = self.params.in_front_of(self.layers)
        self._scan = scan = SliceScan(self.runtime, self.size, in_front, self.margin, self.layers)
        result = plane_bytes(self.params.channels, scan.size)
        self.runtime.transient.reserve(result + max(result, plane_bytes(self.layers, scan.sorted_size)))
        self._kernel(thick=0)

    def _set(self, params: P) -> None:
        self._scan.params = params.in_front_of(self.layers)

    def _kernel(self, *, thick: int) -> Kernel:
        """Return the kernel that scans all layers, so many of which have thickness by pixel."""
        macros = self._scan.macros(thick=thick, reads_thickness=self.reads_thickness)
        return self.runtime.kernel(f"{self.name}/{self.name}.cl", {**macros, **self._macros()}, (CAMERA, SLICES))

    def _check(self, gbuffer: DeviceGBuffer) -> None:
        check_shape(gbuffer, self.size, self.margin, self.layers)

    def _occlude(self, out: Plane, gbuffer: DeviceGBuffer, source: Source, region: Region | None) -> None:
        thickness = gbuffer.thickness if self.reads_thickness else None
        inv_depth = self._scan.inv_depth(gbuffer, thickness)
        thick = 0 if thickness is None else thickness.count
        packed = self._scan.packed(source, self._values(thick=thick), exact=gbuffer.is_exact)
        kernel = self._kernel(thick=thick)
        for strip in self._scan.strips(region):
            kernel.run(
                out.size,
                grid=self._scan.grid,
                region=strip,
                cell=(1, 1),
                inv_depth=inv_depth,
                normal=source.normal,
                table=self._scan.table,
                visibility=out,
                camera=source.camera_struct,
                params=packed,
            )

    def _macros(self) -> Mapping[str, int]:
        """Return the technique's own switches."""
        return {}

    def _values(self, *, thick: int) -> Mapping[str, float]:
        """Return the technique's own members of the struct, where so many layers have thickness by pixel."""
        return {}


def check_shape(gbuffer: DeviceGBuffer, size: Size, margin: Size, layers: int) -> None:
    """Raise ValueError if a G-buffer is not what a technique was prepared for."""
    if (gbuffer.size, gbuffer.margin, gbuffer.layers) != (size, margin, layers):
        raise ValueError(
            f"the G-buffer's size, margin and layers are {gbuffer.size}, {gbuffer.margin} and "
            f"{gbuffer.layers}: expected {size}, {margin} and {layers}"
        )


def _ortho_unit(camera: Any, step: int) -> float:
    """Return 1 / the width of every `step`-th of a camera's pixels, per scene unit."""
    return abs(float(camera["from_x"])) / step


def slice_reach(params: SliceParams, camera: Camera, layers: int, nearest: float) -> float:
    """Return how many rows away the taps of a receiver lie at most, at a depth of at least `nearest`."""
    pixels = min(params.radius * pixels_per_depth(camera, nearest), params.max_radius_px)
    taps = params.in_front_of(layers).taps
    farthest: float = max(1.0, (taps + params.overshoot) / taps) ** params.tap_power
    return farthest * pixels * widest_ray(camera) + SLICES_NEAREST_TAP + 1.0
