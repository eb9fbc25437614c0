"""Reduction of a G-buffer to half or quarter size, and upsampling of results to full size."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.device.active_region import PreviousRegion, Region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.bands import Plan, banded
from ssgi_cl.techniques.filters.bilateral import BilateralParams, image_planes, plane_image
from ssgi_cl.techniques.source import Source, margin_values
from ssgi_cl.techniques.technique import Bench, Technique

UPSAMPLE = Struct(
    "UpsampleParams",
    (
        *ints("margin_columns", "margin_rows", "coarse_columns", "coarse_rows"),
        *floats("depth_scale", "normal_scale", "background"),
    ),
)


@dataclass(frozen=True, kw_only=True)
class UpsampleParams(Params):
    """Parameters of joint-bilateral upsampling (Kopf et al. 2007)."""

    step: int = param(2, "pixels of the result from one of the image to the next: 1, 2 or 4", low=1, high=4)
    background: float = param(0.0, "the value where nothing is")
    depth_sigma: float = param(
        0.005,
        "standard deviation of the distance from the tangent plane, relative to depth "
        "(orthographic cameras: to the height of the view)",
        low=1e-6,
        high=10.0,
    )
    normal_sigma: float = param(
        0.3, "standard deviation of the angle between normals", low=1e-3, high=10.0, unit="radians"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.step == 3:
            raise ValueError("step is 3: expected 1, 2 or 4")

    def scales(self) -> dict[str, float]:
        """Return the members of the kernels' struct that depend on the parameters."""
        fit = BilateralParams(depth_sigma=self.depth_sigma, normal_sigma=self.normal_sigma)
        return {**fit.scales(), "background": self.background}


def coarse_size(size: Size, step: int) -> Size:
    """Return (rows, columns) at 1 / step of `size`, rounded up."""
    return -(-size[0] // step), -(-size[1] // step)


class ReducedGBuffer:
    """Every step-th pixel of a G-buffer, with a camera whose pixel centres are those pixels'.

    Has the attributes of `DeviceGBuffer` that techniques read: runtime, size, margin, whole,
    depth, linear, normal, camera_struct. Depth is made when it is first asked for.
    """

    def __init__(self, gbuffer: DeviceGBuffer, step: int) -> None:
        self.runtime = runtime = gbuffer.runtime
        self.step = step
        self.size = coarse_size(gbuffer.size, step)
        self.margin = (gbuffer.margin[0] // step, gbuffer.margin[1] // step)
        # The pixel that coarse pixel 0 is picked from, so that the inner images' corners meet.
        self.first = (gbuffer.margin[0] % step, gbuffer.margin[1] % step)
        # The same margin on every side, as techniques expect, though one pixel more may fit.
        self.whole = (self.size[0] + 2 * self.margin[0], self.size[1] + 2 * self.margin[1])
        self._depth: Plane | None = None
        self._source: DeviceGBuffer | None = None  # of depth, until that is made
        self._previous_regions: defaultdict[str, PreviousRegion] = defaultdict(PreviousRegion)
        self.linear = runtime.plane(1, self.whole, math.inf)
        self.normal = runtime.plane(3, self.whole)
        self.camera_struct = gbuffer.camera_struct
        self._kernels = {
            count: runtime.kernel("gbuffer/gbuffer_reduce.cl", {"REDUCE_COUNT": count, "UPSAMPLE_STEP": step})
            for count in (1, 3)
        }

    def update(self, gbuffer: DeviceGBuffer) -> None:
        """Queue the passes that pick the pixels."""
        self._reduce("linear", gbuffer.linear, self.linear, gbuffer.region)
        self._reduce("normal", gbuffer.normal, self.normal, gbuffer.region)
        self._source = gbuffer
        struct = gbuffer.camera_struct.copy()
        for axis, first in (("x", self.first[1]), ("y", self.first[0])):
            # Centre of coarse pixel i, at i + 0.5, is centre i * step + first + 0.5 of the fine.
            shift = first + 0.5 - 0.5 * self.step
            to = float(struct[f"to_{axis}"])
            struct[f"at_{axis}"] = float(struct[f"at_{axis}"]) + to * shift
            struct[f"to_{axis}"] = to * self.step
            struct[f"from_{axis}"] = 1.0 / (to * self.step)
            struct[f"centre_{axis}"] = -float(struct[f"at_{axis}"]) / (to * self.step)
        band = gbuffer.band
        if band is not None:
            rows = coarse_size(band.camera.size, self.step)[0] + 2 * (band.margin[0] // self.step)
            struct["rows_above"] = band.first // self.step
            struct["rows_below"] = rows - band.first // self.step - self.whole[0]
        self.camera_struct = struct

    @property
    def depth(self) -> Plane:
        """Depth of the pixels, scene units; queues the pass that picks it where that is due."""
        if self._depth is None:
            self._depth = self.runtime.plane(1, self.whole, math.inf)
        if self._source is not None:
            self._reduce("depth", self._source.depth, self._depth, self._source.region)
            self._source = None
        return self._depth

    def _reduce(self, name: str, fine: Plane, coarse: Plane, region: Region | None) -> None:
        if region is not None:
            whole = self.whole[0] * self.step, self.whole[1] * self.step
            region = region.inside(whole, self.first).reduced(self.step)
        with self._previous_regions[name].over(region) as over:
            self._kernels[coarse.count].run(
                self.whole,
                region=over,
                fine=fine,
                coarse=coarse,
                fine_size=fine.size,
                first_x=self.first[1],
                first_y=self.first[0],
                outside=coarse.outside,
            )


class Upsample(Prepared[UpsampleParams]):
    """The joint-bilateral upsampling, prepared for images of one full size.

    Kopf et al. 2007. Departs: see `upsample`. `kept` is as of `Bilateral`.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `UpsampleParams`.
        channels: images of the result.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: UpsampleParams | None = None,
        channels: int = 1,
        *,
        kept: bool = True,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params or UpsampleParams()
        self._kernel = runtime.kernel(
            "filters/upsample_joint.cl",
            {"UPSAMPLE_COUNT": channels, "UPSAMPLE_STEP": self._params.step},
            (CAMERA, UPSAMPLE),
        )
        self._channels = channels
        self._fine = Target(runtime, channels, size, kept=kept)

    def run(self, gbuffer: DeviceGBuffer, coarse: Plane, *, reduced: Source) -> Plane:
        """Queue the pass and return the plane at full size.

        `reduced` is the G-buffer of the pixels of `coarse`.
        """
        packed = _packed(reduced, gbuffer, self.params.scales())
        lanes = self.runtime.variant.lanes
        background = (self.params.background,) * self._channels
        with self._fine.over(gbuffer.seen, background=background) as (fine, over):
            self._kernel.run(
                self.size,
                grid=(self.size[0], -(-coarse.size[1] // lanes)),
                region=over,
                cell=(1, lanes * self.params.step),
                coarse=coarse,
                coarse_linear=reduced.linear,
                coarse_normal=reduced.normal,
                linear=gbuffer.linear,
                normal=gbuffer.normal,
                fine=fine,
                camera=gbuffer.camera_struct,
                params=packed,
            )
        return fine


class UpsampleBlur:
    """Upsampling and an edge-aware blur in one, prepared for one full size and step.

    Each pixel of the full size is the blur's weighted mean of the coarse pixels in its window of
    2 radius + 1 pixels square: what the blur would make of the upsampled result, for a share
    1 / step^2 of its samples. A first pass goes along the rows that have coarse pixels, a second
    along all columns.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        step: 1, 2 or 4.
        blur: its radius, at least step - 1 to join the coarse pixels, and sigmas; in pixels of the
            result. Applied once, separably.
        background: the value where nothing is.
        kept: as of `Bilateral`.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        step: int,
        blur: BilateralParams,
        *,
        background: float = 0.0,
        kept: bool = True,
    ) -> None:
        self.size = size
        self.step = step
        self._lanes = runtime.variant.lanes
        blur = replace(blur, radius=max(blur.radius, step - 1))
        self._scales = {**blur.scales(), "background": background}
        self._kernels = [
            runtime.kernel(
                f"filters/{name}.cl", {"UPSAMPLE_STEP": step, "BLUR_RADIUS": blur.radius}, (CAMERA, UPSAMPLE)
            )
            for name in ("upsample_blur_rows", "upsample_blur_columns")
        ]
        outwards = np.append(blur.weights(), np.zeros(step))
        weights = np.concatenate([outwards[:0:-1], outwards])
        self._weights = runtime.array(weights.astype(np.float32))
        self._background = (background,)
        self._rows = Target(runtime, 1, (coarse_size(size, step)[0], size[1]), kept=False)
        self._fine = Target(runtime, 1, size, kept=kept)

    def run(self, gbuffer: DeviceGBuffer, coarse: Plane, *, reduced: Source) -> Plane:
        """Queue the passes and return the plane at full size."""
        packed = _packed(reduced, gbuffer, self._scales)
        rows, columns = coarse.size
        guides: dict[str, Any] = {
            "coarse": coarse,
            "coarse_linear": reduced.linear,
            "coarse_normal": reduced.normal,
            "linear": gbuffer.linear,
            "normal": gbuffer.normal,
            "weights": self._weights,
            "camera": gbuffer.camera_struct,
            "params": packed,
        }
        along_rows, along_columns = self._kernels
        seen, wide = gbuffer.seen, None
        if seen is not None:
            coarse_rows = seen.reduced(self.step)
            wide = Region(coarse_rows.row, seen.column, coarse_rows.rows, seen.columns)
        with self._rows.over(wide) as (between, over):
            along_rows.run(
                self._rows.size,
                grid=(rows, -(-columns // self._lanes)),
                region=over,
                cell=(1, self._lanes * self.step),
                blurred=between,
                small=coarse.size,
                whole=gbuffer.whole,
                **guides,
            )
        with self._fine.over(seen, background=self._background) as (fine, over):
            along_columns.run(
                self.size,
                grid=(rows, -(-self.size[1] // self._lanes)),
                region=over,
                cell=(self.step, self._lanes),
                rows=between,
                fine=fine,
                **guides,
            )
        return fine


def _packed(reduced: Source, gbuffer: DeviceGBuffer, scales: Mapping[str, float]) -> NDArray[np.void]:
    return UPSAMPLE.pack(
        {**margin_values(gbuffer.margin), "coarse_columns": reduced.whole[1], "coarse_rows": reduced.whole[0], **scales}
    )


def _plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
    step = UpsampleParams(step=arguments.get("step", 2)).step
    return Plan(arguments, 2 * step, images={"image": step})


@banded(_plan)
@serialised
def upsample(
    image: ArrayLike,
    gbuffer: GBuffer | DeviceGBuffer,
    *,
    step: int = 2,
    background: float = 0.0,
    depth_sigma: float = 0.005,
    normal_sigma: float = 0.3,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
) -> NDArray[np.float32]:
    """Bring an image of half or quarter size to the size of the G-buffer, along surfaces.

    Kopf et al. 2007, "Joint Bilateral Upsampling". Departs: of the 2 x 2 nearest pixels alone;
    depth is compared with the pixel's tangent plane; a pixel that none of them fits takes the one
    that fits best.

    Args:
        image: [ceil(rows / step), ceil(columns / step)] or with 3 channels, float32; its pixel
            (i, j) belongs to the G-buffer's pixel (i * step, j * step).
        gbuffer: at full size.
        step: 1, 2 or 4.
        background: the value where nothing is.
        depth_sigma: standard deviation of the distance from the tangent plane, relative to depth
            (orthographic cameras: to the height of the view).
        normal_sigma: standard deviation of the angle between normals, radians.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns] or [rows, columns, 3] float32.

    Raises:
        TypeError, ValueError: the image's dtype, shape or values, or a parameter out of range.
    """
    params = UpsampleParams(step=step, background=background, depth_sigma=depth_sigma, normal_sigma=normal_sigma)
    step = params.step
    planes = image_planes(image)
    expected = coarse_size(gbuffer.size, step)
    if planes.shape[1:] != expected:
        raise ValueError(
            f"image has shape {np.shape(image)}: expected {expected}, 1/{step} of the G-buffer's {gbuffer.size}"
        )
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    count = len(planes)
    reduced, technique, plane = runtime.prepared(
        (Upsample, device.size, device.margin, params.shape(), count),
        lambda: (
            ReducedGBuffer(device, step),
            Upsample(runtime, device.size, params, count),
            runtime.plane(count, expected),
        ),
    )
    technique.params = params
    plane.upload(planes)
    with runtime.frame():
        reduced.update(device)
        return plane_image(technique.run(device, plane, reduced=reduced).download())


DESCRIPTOR = Technique(
    name="upsample",
    kind="filter",
    paper="Kopf et al. 2007",
    function=upsample,
    params=UpsampleParams,
    technique=Upsample,
    reference="ssgi_cl.reference.filters.upsample",
    reads=("depth", "normal", "image"),
    writes=("image",),
    bench=Bench(
        families=("upsample",),
        rows={"upsample": ("half or quarter size to full size, along surfaces", (("half", "upsample.2"),))},
    ),
)
