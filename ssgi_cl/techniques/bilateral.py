"""Edge-aware blur: Gaussian in space, depth and normal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl import check
from ssgi_cl.device_gbuffer import DeviceGBuffer, on_device
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.memory import Plane, Size
from ssgi_cl.params import Params, param
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats

BLUR = Struct(
    "BlurParams",
    (
        *floats("depth_scale", "depth_threshold", "normal_scale", "least_cosine"),
        ("margin_columns", "int"),
        ("margin_rows", "int"),
    ),
)


@dataclass(frozen=True, kw_only=True)
class BilateralParams(Params):
    """Parameters of the edge-aware blur (Tomasi and Manduchi 1998, as a cross-bilateral filter)."""

    radius: int = param(4, "pixels on either side; 7 is a 15 x 15 blur", low=0, high=16, unit="px")
    sigma: float = param(
        0.0, "standard deviation in space; 0 for (radius + 1) / 2", low=0.0, high=100.0, unit="px"
    )
    depth_sigma: float = param(
        0.01, "standard deviation of the distance from the tangent plane, relative to depth",
        low=1e-6, high=10.0,
    )
    depth_threshold: float = param(
        0.03, "samples further off the tangent plane, relative to depth, are tossed",
        low=1e-6, high=0.9,
    )
    normal_sigma: float = param(
        0.35, "standard deviation of the angle between normals", low=1e-3, high=10.0,
        unit="radians",
    )
    normal_threshold: float = param(
        0.8, "samples whose normal differs by more are tossed", low=1e-3, high=math.pi,
        unit="radians",
    )
    passes: int = param(1, "how often the blur is applied", low=0, high=64)
    separable: bool = param(True, "rows, then columns, in place of the full square")


class Bilateral:
    """The blur, prepared for images of one size with `channels` values a pixel."""

    def __init__(
        self, runtime: Runtime, size: Size, params: BilateralParams | None = None, channels: int = 1
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.params = params = params or BilateralParams()
        self.channels = channels
        self.active = params.passes > 0 and params.radius > 0
        if not self.active:
            return
        shapes = (0, 1) if params.separable else (2,)
        self._kernels = [
            runtime.kernel(
                "bilateral/bilateral_blur.cl",
                {"BLUR_RADIUS": params.radius, "BLUR_COUNT": channels, "BLUR_SHAPE": shape},
                (CAMERA, BLUR),
            )
            for shape in shapes
        ]
        sigma = params.sigma or 0.5 * (params.radius + 1)
        distance = np.arange(params.radius + 1)
        weights = np.exp(-0.5 * (distance / sigma) ** 2)
        self._weights = runtime.array(weights.astype(np.float32))
        self._planes = [runtime.plane(channels, size) for _ in range(2)]

    def run(self, value: Plane, gbuffer: DeviceGBuffer, name: str = "blur") -> Plane:
        """Queue the passes and return the plane that holds the result (not `value`, if active)."""
        params = self.params
        if not self.active:
            self.runtime.skip(name, "no passes or radius 0")
            return value
        # Both scales are for 2^-x in place of e^-x; 1 - cos a is a^2 / 2 for small angles.
        packed = BLUR.pack(
            {
                "depth_scale": math.sqrt(0.5 / math.log(2.0)) / params.depth_sigma,
                "depth_threshold": params.depth_threshold,
                "normal_scale": 1.0 / (math.log(2.0) * params.normal_sigma**2),
                "least_cosine": math.cos(params.normal_threshold),
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
            }
        )
        for i in range(params.passes):
            for j, kernel in enumerate(self._kernels):
                out = self._planes[0] if value is not self._planes[0] else self._planes[1]
                direction = ("rows", "columns")[j] if len(self._kernels) == 2 else "square"
                kernel.run(
                    f"{name} {direction}" + (f" {i + 1}" if params.passes > 1 else ""),
                    self.size,
                    reads=[value, gbuffer.linear, gbuffer.normal, self._weights],
                    writes=[out],
                    values=[gbuffer.camera_struct, packed],
                )
                value = out
        return value


def bilateral_blur(
    image: ArrayLike,
    gbuffer: GBuffer | DeviceGBuffer,
    *,
    runtime: Runtime | None = None,
    **params: float | bool,
) -> NDArray[np.float32]:
    """Blur an image without crossing the edges of what it shows.

    Args:
        image: [rows, columns] or [rows, columns, 3] float32 of the G-buffer's size, finite.
        gbuffer: whose depth and normals tell where the edges are.
        runtime: the device; by default the fastest found.
        **params: the fields of `BilateralParams`.

    Returns:
        The blurred image, same shape, float32. Where nothing is, the image itself.

    Raises:
        TypeError, ValueError: the image's dtype, shape or values, or a parameter out of range.
    """
    values = np.asarray(image)
    channels = 3 if values.ndim == 3 else 0
    values = check.plane("image", values, channels=channels)
    chosen = BilateralParams(**params)  # type: ignore[arg-type]
    if values.shape[:2] != gbuffer.size:
        raise ValueError(f"image has shape {values.shape}: expected {gbuffer.size} as the G-buffer")
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    count = channels or 1
    blur, plane = runtime.prepared(
        (Bilateral, gbuffer.size, chosen, count),
        lambda: (
            Bilateral(runtime, gbuffer.size, chosen, count), runtime.plane(count, gbuffer.size)
        ),
    )
    plane.upload(np.moveaxis(values, -1, 0) if channels else values[None])
    with runtime.frame():
        result = blur.run(plane, device).download()
    return np.ascontiguousarray(np.moveaxis(result, 0, -1)) if channels else result[0]
