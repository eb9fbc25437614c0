"""Edge-aware blur: Gaussian in space, depth and normal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.device.transient import Target, background_of
from ssgi_cl.techniques.bands import Plan, banded
from ssgi_cl.techniques.source import Source, margin_values
from ssgi_cl.techniques.technique import Bench, Technique

BLUR = Struct("BlurParams", (*floats("depth_scale", "normal_scale"), ("margin_columns", "int"), ("margin_rows", "int")))

FIT_POWER = 4
"""The weight of a sample is its fit to the surface to this power; see common/surface.clh."""


@dataclass(frozen=True, kw_only=True)
class BilateralParams(Params):
    """Parameters of the edge-aware blur (Tomasi and Manduchi 1998, as a cross-bilateral filter)."""

    radius: int = param(4, "pixels on either side; 7 is a 15 x 15 blur", low=0, high=16, unit="px")
    sigma: float = param(
        0.0,
        "standard deviation in space; 0 for (radius + 1) / 2; inf for the mean of 2 radius pixels, in which those at "
        "either end count by half: of what repeats after as many nothing is left",
        low=0.0,
        high=math.inf,
        unit="px",
    )
    depth_sigma: float = param(
        0.01,
        "standard deviation of the distance from the tangent plane, relative to depth "
        "(orthographic cameras: to the height of the view); beyond 2.8 of it samples have no weight",
        low=1e-6,
        high=10.0,
    )
    normal_sigma: float = param(
        0.5,
        "standard deviation of the angle between normals; beyond about twice as much samples "
        "have no weight: at 0.5, those at right angles",
        low=1e-3,
        high=10.0,
        unit="radians",
    )
    passes: int = param(1, "how often the blur is applied", low=0, high=64)
    separable: bool = param(True, "rows, then columns, in place of the full square")

    def weights(self) -> NDArray[np.float64]:
        """Return the weights in space of distances 0 to `radius`."""
        sigma = self.sigma or 0.5 * (self.radius + 1)
        weights: NDArray[np.float64] = np.exp(-0.5 * (np.arange(self.radius + 1) / sigma) ** 2)
        if math.isinf(sigma) and self.radius > 0:
            weights[-1] = 0.5
        return weights

    def scales(self) -> dict[str, float]:
        """Return the scales of a fit, see kernels/common/surface.clh.

        The weight (1 - d^2 / (2 n sigma^2) - (1 - cos) / (n sigma^2))^n is about that of Gaussians
        of the distance d and of the angle, whose 1 - cos is half its square; n = FIT_POWER.
        """
        return {
            "depth_scale": 1.0 / (math.sqrt(2.0 * FIT_POWER) * self.depth_sigma),
            "normal_scale": 1.0 / (FIT_POWER * self.normal_sigma**2),
        }


class BilateralKeywords(TypedDict, total=False):
    """The parameters of `bilateral_blur`."""

    radius: int
    sigma: float
    depth_sigma: float
    normal_sigma: float
    passes: int
    separable: bool


class Bilateral(Prepared[BilateralParams]):
    """The blur, prepared for images of one size with `channels` values a pixel.

    Tomasi and Manduchi 1998. Departs: see `bilateral_blur`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: of the blur.
        channels: values of a pixel.
        kept: whether results are in memory of its own; else each lives as long as somebody refers
            to it.
        checkerboard: whether values are on the pixels of even row + column alone, in the first image from 0 to 1; those
            between are found from what fits, or if nothing does from their neighbours in the row.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: BilateralParams | None = None,
        channels: int = 1,
        *,
        kept: bool = True,
        checkerboard: bool = False,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or BilateralParams()
        self.channels = channels
        self.active = params.passes > 0 and params.radius > 0
        if not self.active:
            return
        # Rows of a work-item: on a CPU two of them share what they read.
        self._rows = {0: 1, 1: 2 if runtime.variant.lanes > 1 else 1, 2: 1}
        self._shapes = (0, 1) if params.separable else (2,)
        self._kernels = {
            (shape, fills): runtime.kernel(
                "filters/bilateral_blur.cl",
                {
                    "BLUR_RADIUS": params.radius,
                    "BLUR_COUNT": channels,
                    "BLUR_SHAPE": shape,
                    "BLUR_ROWS": self._rows[shape],
                    "BLUR_CHECKERBOARD": int(fills),
                },
                (CAMERA, BLUR),
            )
            for shape in self._shapes
            for fills in {checkerboard, checkerboard and params.passes == 1}
        }
        self._checkerboard = checkerboard
        self._weights = runtime.array(_weight_table(params))
        self._result = Target(runtime, channels, size, kept=kept)
        self._between = Target(runtime, channels, size, kept=False)

    def _set(self, params: BilateralParams) -> None:
        if self.active and params.sigma != self.params.sigma:
            self._weights.upload(_weight_table(params))

    def run(self, gbuffer: Source, value: Plane, *, region: Region | None = None) -> Plane:
        """Queue the passes and return the plane that holds the result (not `value`, if active).

        Outside `region` no surface is, and the value is the same in every call with one.
        """
        params = self.params
        if not self.active:
            self.runtime.skip("bilateral_blur", "no passes or radius 0")
            return value
        packed = BLUR.pack({**params.scales(), **margin_values(gbuffer.margin)})
        lanes = self.runtime.variant.lanes
        rows, columns = self.size
        background = background_of(value)
        left = params.passes * len(self._shapes)
        for number in range(params.passes):
            for shape in self._shapes:
                left -= 1
                target = self._between if left % 2 else self._result
                with target.over(region, background=background) as (out, over):
                    self._kernels[shape, self._checkerboard and number == 0].run(
                        self.size,
                        grid=(-(-rows // self._rows[shape]), -(-columns // lanes)),
                        region=over,
                        cell=(self._rows[shape], lanes),
                        value=value,
                        linear=gbuffer.linear,
                        normal=gbuffer.normal,
                        weights=self._weights,
                        blurred=out,
                        camera=gbuffer.camera_struct,
                        params=packed,
                    )
                value = out
        return value


def _weight_table(params: BilateralParams) -> NDArray[np.float32]:
    """Return the weights in space as kernels/filters/bilateral_blur.cl reads them."""
    weights = np.append(params.weights(), 0.0)
    weights[0] = 0.0 if params.separable else 1.0  # the kernel adds a pixel's own value
    return weights.astype(np.float32)


def image_planes(image: ArrayLike) -> NDArray[np.float32]:
    """Return an image [rows, columns] or [rows, columns, 3] as [1 or 3, rows, columns], checked."""
    values = checks.as_array("image", image)
    coloured = values.ndim == 3
    values = checks.plane("image", values, channels=3 if coloured else 0)
    return np.moveaxis(values, -1, 0) if coloured else values[None]


def plane_image(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return [1 or 3, rows, columns] as an image, the inverse of `image_planes`."""
    return planes[0] if len(planes) == 1 else np.ascontiguousarray(np.moveaxis(planes, 0, -1))


def _plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
    given = {name: value for name, value in arguments.items() if name != "image"}
    params = BilateralParams(**given)
    return Plan(arguments, params.radius * params.passes, images={"image": 1})


@banded(_plan)
@with_fields_described(BilateralParams)
@serialised
def bilateral_blur(
    image: ArrayLike,
    gbuffer: GBuffer | DeviceGBuffer,
    *,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[BilateralKeywords],
) -> NDArray[np.float32]:
    """Blur an image without crossing the edges of surfaces.

    Tomasi and Manduchi 1998, "Bilateral Filtering for Gray and Color Images", as a cross-bilateral
    filter (Eisemann and Durand 2004; Petschnigg et al. 2004). Departs: depth is compared with the
    pixel's tangent plane; the Gaussians of depth and normal are powers that end, so that what is
    beyond weighs 0.

    Args:
        image: [rows, columns] or [rows, columns, 3] float32 of the G-buffer's size, finite.
        gbuffer: whose depth and normals tell where the edges are.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.
        **params: the fields of `BilateralParams`.

    Returns:
        The blurred image, same shape, float32. Where nothing is, the image itself.

    Raises:
        TypeError, ValueError: the image's dtype, shape or values, or a parameter out of range.
    """
    planes = image_planes(image)
    chosen = BilateralParams(**params)
    if planes.shape[1:] != gbuffer.size:
        raise ValueError(f"image has shape {np.shape(image)}: expected {gbuffer.size} as the G-buffer")
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    count = len(planes)
    blur, plane = runtime.prepared(
        (Bilateral, gbuffer.size, chosen.shape(), count),
        lambda: (Bilateral(runtime, gbuffer.size, chosen, count), runtime.plane(count, gbuffer.size)),
    )
    blur.params = chosen
    plane.upload(planes)
    with runtime.frame():
        return plane_image(blur.run(device, plane).download())


DESCRIPTOR = Technique(
    name="bilateral_blur",
    kind="filter",
    paper="Tomasi and Manduchi 1998",
    function=bilateral_blur,
    params=BilateralParams,
    technique=Bilateral,
    reference="ssgi_cl.reference.filters.bilateral",
    reads=("depth", "normal", "image"),
    writes=("image",),
    bench=Bench(families=("blur",), rows={"bilateral_blur": ("edge-aware blur", (("15 x 15, separable", "blur.7"),))}),
)
