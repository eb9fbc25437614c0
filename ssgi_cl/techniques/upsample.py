"""Work at half or quarter size: reduce the G-buffer, and bring results back to full size."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl import check
from ssgi_cl.device_gbuffer import DeviceGBuffer, on_device
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.memory import Plane, Size
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats

UPSAMPLE = Struct(
    "UpsampleParams",
    (
        *(
            (name, "int")
            for name in ("step", "margin_columns", "margin_rows", "coarse_columns", "coarse_rows")
        ),
        *floats("depth_scale", "normal_scale", "background"),
    ),
)


def coarse_size(size: Size, step: int) -> Size:
    """Return (rows, columns) at 1 / step of `size`, rounded up."""
    return -(-size[0] // step), -(-size[1] // step)


class ReducedGBuffer:
    """Every step-th pixel of a G-buffer, with a camera whose pixel centres are those pixels'.

    Has the attributes of `DeviceGBuffer` that techniques read: runtime, size, margin, whole,
    depth, linear, normal, camera_struct.
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
        self.depth = runtime.plane(1, self.whole, math.inf)
        self.linear = runtime.plane(1, self.whole, math.inf)
        self.normal = runtime.plane(3, self.whole)
        self.camera_struct = gbuffer.camera_struct
        self._kernels = {
            count: runtime.kernel("gbuffer/gbuffer_reduce.cl", {"REDUCE_COUNT": count})
            for count in (1, 3)
        }

    def update(self, gbuffer: DeviceGBuffer) -> None:
        """Queue the passes that pick the pixels."""
        rows, columns = gbuffer.whole
        values = [_int2(columns, rows), np.int32(self.step), np.int32(self.first[1]),
                  np.int32(self.first[0])]
        for name in ("depth", "linear", "normal"):
            plane: Plane = getattr(self, name)
            self._kernels[plane.count].run(
                f"reduce {name}", self.whole, reads=[getattr(gbuffer, name)], writes=[plane],
                values=[*values, np.float32(plane.outside)],
            )
        struct = gbuffer.camera_struct.copy()
        for axis, first in (("x", self.first[1]), ("y", self.first[0])):
            # Centre of coarse pixel i, at i + 0.5, is centre i * step + first + 0.5 of the fine.
            shift = first + 0.5 - 0.5 * self.step
            to = float(struct[f"to_{axis}"])
            struct[f"at_{axis}"] = float(struct[f"at_{axis}"]) + to * shift
            struct[f"to_{axis}"] = to * self.step
            struct[f"from_{axis}"] = 1.0 / (to * self.step)
            struct[f"centre_{axis}"] = -float(struct[f"at_{axis}"]) / (to * self.step)
        self.camera_struct = struct


class Upsample:
    """The joint-bilateral upsampling, prepared for one full size, step and number of channels."""

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        step: int,
        channels: int = 1,
        *,
        background: float = 0.0,
        depth_sigma: float = 0.005,
        normal_sigma: float = 0.3,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.step = step
        self._background = background
        self._depth_scale = math.sqrt(0.5 / math.log(2.0)) / depth_sigma
        self._normal_scale = 1.0 / (math.log(2.0) * normal_sigma**2)
        self._kernel = runtime.kernel(
            "upsample/upsample_joint.cl", {"UPSAMPLE_COUNT": channels}, (CAMERA, UPSAMPLE)
        )
        self._fine = runtime.plane(channels, size)

    def run(self, coarse: Plane, reduced: ReducedGBuffer, gbuffer: DeviceGBuffer) -> Plane:
        """Queue the pass and return the plane at full size."""
        packed = UPSAMPLE.pack(
            {
                "step": self.step,
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
                "coarse_columns": reduced.whole[1],
                "coarse_rows": reduced.whole[0],
                "depth_scale": self._depth_scale,
                "normal_scale": self._normal_scale,
                "background": self._background,
            }
        )
        self._kernel.run(
            "upsample",
            self.size,
            reads=[coarse, reduced.linear, reduced.normal, gbuffer.linear, gbuffer.normal],
            writes=[self._fine],
            values=[gbuffer.camera_struct, packed],
        )
        return self._fine


def upsample(
    image: ArrayLike,
    gbuffer: GBuffer | DeviceGBuffer,
    *,
    step: int = 2,
    background: float = 0.0,
    depth_sigma: float = 0.005,
    normal_sigma: float = 0.3,
    runtime: Runtime | None = None,
) -> NDArray[np.float32]:
    """Bring an image of half or quarter size to the size of the G-buffer, along surfaces.

    Args:
        image: [ceil(rows / step), ceil(columns / step)] or with 3 channels, float32; its pixel
            (i, j) belongs to the G-buffer's pixel (i * step, j * step).
        gbuffer: at full size.
        step: 1 to 16.
        background: the value where nothing is.
        depth_sigma: standard deviation of the distance from the tangent plane, relative to depth.
        normal_sigma: standard deviation of the angle between normals, radians.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns] or [rows, columns, 3] float32.

    Raises:
        TypeError, ValueError: the image's dtype, shape or values, or a parameter out of range.
    """
    step = check.integer("step", step, low=1, high=16)
    values = np.asarray(image)
    channels = 3 if values.ndim == 3 else 0
    values = check.plane("image", values, channels=channels)
    if values.shape[:2] != coarse_size(gbuffer.size, step):
        raise ValueError(
            f"image has shape {values.shape}: expected {coarse_size(gbuffer.size, step)}, "
            f"1/{step} of the G-buffer's {gbuffer.size}"
        )
    background = check.number("background", background)
    depth_sigma = check.number("depth_sigma", depth_sigma, low=1e-6, high=10.0)
    normal_sigma = check.number("normal_sigma", normal_sigma, low=1e-3, high=10.0, unit="radians")
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    count = channels or 1
    key = (Upsample, device.size, device.margin, step, count, background, depth_sigma, normal_sigma)
    reduced, technique, plane = runtime.prepared(
        key,
        lambda: (
            ReducedGBuffer(device, step),
            Upsample(
                runtime, device.size, step, count, background=background,
                depth_sigma=depth_sigma, normal_sigma=normal_sigma,
            ),
            runtime.plane(count, values.shape[:2]),
        ),
    )
    plane.upload(np.moveaxis(values, -1, 0) if channels else values[None])
    with runtime.frame():
        reduced.update(device)
        result = technique.run(plane, reduced, device).download()
    return np.ascontiguousarray(np.moveaxis(result, 0, -1)) if channels else result[0]


def _int2(x: int, y: int) -> NDArray[np.int32]:
    return np.array([x, y], np.int32)
