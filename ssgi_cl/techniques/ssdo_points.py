"""Directional occlusion and one bounce of light from taps in a half ball round each pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.memory import Plane, Size
from ssgi_cl.params import Params, param
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.ssao import DEPTH_BIAS
from ssgi_cl.techniques.ssdo_taps import SETS, TapSets, tap_sets
from ssgi_cl.techniques.upsample import coarse_size

POINTS = Struct(
    "PointsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "thickness", "area", "nearest_square"),
        *((name, "int") for name in ("columns", "rows", "margin_columns", "margin_rows")),
    ),
)

AREAS = ("unbiased", "paper")


@dataclass(frozen=True, kw_only=True)
class PointsParams(Params):
    """Parameters of SSDO as published (Ritschel, Grosch and Seidel 2009)."""

    radius: float = param(
        0.5, "of the half ball that taps lie in", low=0.0, high=1e30, above=True,
        unit="scene units",
    )
    samples: int = param(16, "taps per pixel", low=1, high=256)
    max_radius_px: float = param(
        math.inf, "limit of the projected radius, for a near view", low=1.0, high=math.inf,
        unit="px",
    )
    thickness: float = param(
        1.0, "of surfaces, along the line of sight; that of each pixel where the G-buffer has it; "
        "the next depth layer ends them if it is nearer", low=0.0, high=1e30, unit="radii",
    )
    bias: float = param(
        0.02, "height above the tangent plane up to which nothing hides or sends", low=0.0,
        high=1.0, unit="radii",
    )
    area: str = param(
        "unbiased", "of a sender: from the density of taps that find it, or pi radius^2 / samples "
        "as published", choices=AREAS,
    )
    nearest: float = param(
        0.25, "published area: least distance that counts between sender and receiver", low=1e-6,
        high=1.0, unit="radii",
    )
    strength: float = param(
        1.0, "published area: factor of the bounce", low=0.0, high=1e3
    )


class SsdoPoints:
    """Directional occlusion and a bounce of light, prepared for results of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the G-buffers' image.
        step: 1, 2 or 4: every step-th pixel of it is a receiver. Taps read the full size.
        params: see `PointsParams`.
    """

    def __init__(
        self, runtime: Runtime, size: Size, step: int = 1, params: PointsParams | None = None
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.step = step
        self.params = params or PointsParams()
        self._results: dict[int, Plane] = {}
        self._nothing = runtime.plane(1, (1, 1))
        self._sets: TapSets | None = None
        self._lit: Any = None  # what the sets were made for
        self._turn: NDArray[np.float64] | None = None
        fields = 11
        self._taps = runtime.empty(4 * self.params.samples * fields * 16, np.float32)

    def gather(
        self, gbuffer: DeviceGBuffer, source: Any, radiance: Plane | None, sky: Any,
        tiles: Any = None,
    ) -> Plane:
        """Queue the pass; return A, the sky's irradiance if it is an image, and the bounce's.

        Args:
            gbuffer: depth, of any number of layers, and normals.
            source: not looked at; receivers are every `step`-th pixel.
            radiance: that of the layers' visible sides, 3 images for each, W m^-2 sr^-1; None for
                no bounce. Layers send light as far as there are normals and radiance.
            sky: an `ssgi_cl.techniques.sky.Sky`, of which the image counts, or None.
            tiles: not looked at; taps find what is behind planes too.

        Returns:
            A plane of ceil(size / step): A in [0, 1], 1 where nothing is; with an image of the sky,
            3 images of irradiance from it; with `radiance`, 3 of the bounce's irradiance, W/m^2.
        """
        if gbuffer.size != self.size:
            raise ValueError(f"the G-buffer's size is {gbuffer.size}: expected {self.size}")
        camera = gbuffer.camera
        if camera is None:
            raise ValueError("the device G-buffer is empty: draw or upload something first")
        image = None if sky is None else sky.image
        self._prepare(camera.view[:3, :3], image)
        senders = 0
        if radiance is not None:
            senders = min(radiance.count, gbuffer.normal.count) // 3
        params = self.params
        kernel = self.runtime.kernel(
            "ssdo_points/ssdo_points.cl",
            {
                "POINTS_COUNT": params.samples,
                "POINTS_LAYERS": gbuffer.layers,
                "POINTS_SENDERS": senders,
                "POINTS_STEP": self.step,
                "POINTS_SKY": int(image is not None),
                "POINTS_PAPER": int(params.area == "paper"),
                "POINTS_THICKNESS": int(gbuffer.thickness is not None),
            },
            (CAMERA, POINTS),
        )
        count = 1 + 3 * (image is not None) + 3 * (senders > 0)
        if count not in self._results:
            size = coarse_size(self.size, self.step)
            self._results[count] = self.runtime.plane(count, size)
        result = self._results[count]
        kernel.run(
            "ssdo points",
            result.size,
            reads=[
                gbuffer.depth, gbuffer.normal, gbuffer.thickness or self._nothing,
                radiance or self._nothing, self._taps,
            ],
            writes=[result],
            values=[gbuffer.camera_struct, self._packed(gbuffer)],
        )
        return result

    def _prepare(self, turn: NDArray[np.float64], image: NDArray[np.float64] | None) -> None:
        """Bring the taps to the device, unless those of this sky and camera are there."""
        if self._sets is None or image is not self._lit:
            self._sets = tap_sets(self.params.samples, image)
            self._lit = image
            self._turn = None
        if self._turn is None or not np.array_equal(turn, self._turn):
            self._taps.upload(tap_table(self._sets, turn))
            self._turn = turn.copy()

    def _packed(self, gbuffer: DeviceGBuffer) -> Any:
        params = self.params
        return POINTS.pack(
            {
                "radius": params.radius,
                "most_px": params.max_radius_px,
                "bias": params.bias,
                "depth_bias": DEPTH_BIAS,
                "thickness": params.thickness,
                "area": params.strength * math.pi / params.samples,
                "nearest_square": params.nearest**2,
                "columns": gbuffer.whole[1],
                "rows": gbuffer.whole[0],
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
            }
        )


def tap_table(sets: TapSets, turn: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [4 rows, taps, fields, 16 columns] as kernels/ssdo_points/ssdo_points.cl reads it.

    Args:
        sets: the taps of a tile.
        turn: [3, 3] world to view.
    """
    length = sets.length[..., None]
    fields = [
        (sets.direction @ turn.T) * length,
        sets.solid_angle[..., None] / length,
        sets.solid_angle[..., None],
    ]
    if sets.light is not None:
        fields += [sets.light[..., 0, :] / length, sets.light[..., 1, :] / length]
    table = np.concatenate(fields, axis=-1)  # row, column, tap, field
    table = np.tile(table.transpose(0, 2, 3, 1), SETS[1])
    return np.ascontiguousarray(table, np.float32)
