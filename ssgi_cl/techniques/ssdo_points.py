"""Directional occlusion and one bounce of light from taps in a half ball round each pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.memory import GUARD, DeviceArray, Plane, Size, plane_shape
from ssgi_cl.params import Params, param
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.lit_layers import SenderRecords
from ssgi_cl.techniques.ssao import DEPTH_BIAS
from ssgi_cl.techniques.ssdo_taps import SETS, TapSets, tap_sets
from ssgi_cl.techniques.upsample import coarse_size

POINTS = Struct(
    "PointsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "thickness", "area", "nearest_square"),
        *((n, "int") for n in ("columns", "rows", "margin_columns", "margin_rows", "stride")),
    ),
)

AREAS = ("unbiased", "paper")
STRIP = 256
"""Columns that are gone through before those beside them, so that what is read stays near."""

GROUP = 16
"""Work-items of a work-group, that of devices with lanes."""


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
        reduced: whether receivers are the pixels of a reduced G-buffer of that size, which taps
            read too: its front layer alone.
        kept: whether `kept` is wanted.

    Attributes:
        bounces: whether the last call gathered a bounce.
        kept: int32, a bit for each tap of the last call that lies in the image, and then for each
            that hides, as kernels/ssdo_points/ssdo_points.cl has it. None if not wanted.
        wide_taps: the taps of the last call, [4 rows, taps, fields, 16 columns]. None likewise.
    """

    def __init__(
        self, runtime: Runtime, size: Size, step: int = 1, params: PointsParams | None = None,
        *, reduced: bool = False, kept: bool = False,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.step = step
        self.params = params or PointsParams()
        self.reduced = reduced
        self._results: dict[int, Plane] = {}
        self._nothing = runtime.plane(1, (1, 1))
        self._no_senders = runtime.array(np.zeros(1, np.int32))
        self._no_bits = runtime.array(np.zeros(1, np.int32))
        self._sets: TapSets | None = None
        self._lit: Any = None  # what the sets were made for
        self._turn: NDArray[np.float64] | None = None
        self._near: dict[Any, DeviceArray] = {}
        self._records: dict[Any, SenderRecords] = {}
        fields = 11
        self._taps = runtime.empty(16 * self.params.samples * fields, np.float32)
        self.bounces = False
        self.kept: DeviceArray | None = None
        self.wide_taps: DeviceArray | None = None
        if kept:
            words = 2 * -(-self.params.samples // 32)
            count, pitch = plane_shape(words, coarse_size(size, step))
            self.kept = runtime.array(np.zeros(count * pitch, np.int32))
            self.wide_taps = runtime.empty(64 * self.params.samples * fields, np.float32)

    def gather(
        self, gbuffer: DeviceGBuffer, source: Any, radiance: Plane | SenderRecords | None,
        sky: Any, tiles: Any = None,
    ) -> Plane:
        """Queue the pass; return A, the sky's irradiance if it is an image, and the bounce's.

        Args:
            gbuffer: depth, of any number of layers, and normals.
            source: what is read if this is for reduced ones; else not looked at.
            radiance: that of the layers' visible sides, 3 images for each, W m^-2 sr^-1, or records
                of it; None for no bounce. Layers send light as far as there are normals and
                radiance.
            sky: an `ssgi_cl.techniques.sky.Sky`, of which the image counts, or None.
            tiles: not looked at; taps find what is behind planes too.

        Returns:
            A plane of ceil(size / step): A in [0, 1], 1 where nothing is; with an image of the sky,
            3 images of irradiance from it; with `radiance`, 3 of the bounce's irradiance, W/m^2.
        """
        read = source if self.reduced else gbuffer
        if read.size != self.size:
            raise ValueError(f"the G-buffer's size is {read.size}: expected {self.size}")
        camera = gbuffer.camera
        if camera is None:
            raise ValueError("the device G-buffer is empty: draw or upload something first")
        if self.reduced and radiance is not None:
            raise ValueError("there is radiance: expected none with reduced receivers")
        image = None if sky is None else sky.image
        self._prepare(camera.view[:3, :3], image)
        if isinstance(radiance, Plane):
            radiance = self._packed_senders(gbuffer, radiance)
        senders = 0 if radiance is None else radiance.layers
        self.bounces = senders > 0
        layers = 1 if self.reduced else gbuffer.layers
        thickness = None if self.reduced else gbuffer.thickness
        params = self.params
        kernel = self.runtime.kernel(
            "ssdo_points/ssdo_points.cl",
            {
                "POINTS_COUNT": params.samples,
                "POINTS_LAYERS": layers,
                "POINTS_SENDERS": senders,
                "POINTS_STEP": self.step,
                "POINTS_SKY": int(image is not None),
                "POINTS_PAPER": int(params.area == "paper"),
                "POINTS_THICKNESS": int(thickness is not None),
                "POINTS_KEPT": int(self.kept is not None),
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
                read.depth, read.normal, thickness or self._nothing,
                self._sorted(read.depth, layers),
                self._no_senders if radiance is None else radiance.array, self._taps,
            ],
            writes=[result, self.kept or self._no_bits],
            values=[read.camera_struct, self.packed(read)],
            grid=self._grid(result.size),
        )
        return result

    def _grid(self, size: Size) -> Size | None:
        lanes = self.runtime.form.lanes
        if lanes == 1:
            return None
        rows = GROUP * 4 * lanes // STRIP  # of a work-group
        return -(-size[0] // rows) * -(-size[1] // STRIP), GROUP

    def _packed_senders(self, gbuffer: DeviceGBuffer, radiance: Plane) -> SenderRecords:
        layers = min(radiance.count, gbuffer.normal.count) // 3
        key = gbuffer.whole, layers
        if key not in self._records:
            self._records[key] = SenderRecords(self.runtime, *key)
        self._records[key].pack(gbuffer, radiance)
        return self._records[key]

    def _sorted(self, depth: Plane, layers: int) -> DeviceArray:
        """Queue the pass that sorts the rows of all layers by column modulo 4."""
        rows, columns = depth.size
        wide = SETS[1] * _stride(columns)
        key = depth.size, layers
        if key not in self._near:
            self._near[key] = self.runtime.array(
                np.zeros((layers * rows + 2) * (wide + GUARD), np.float32)
            )
        kernel = self.runtime.kernel("slices/slices_sorted.cl", {"SORTED_COUNT": layers})
        all_columns = (columns, 0, 1, 0, 0)  # from the first on, each
        kernel.run(
            "ssdo depth",
            (rows, wide),
            reads=[depth],
            writes=[self._near[key]],
            values=[np.array([columns, rows], np.int32), *map(np.int32, all_columns)],
        )
        return self._near[key]

    def _prepare(self, turn: NDArray[np.float64], image: NDArray[np.float64] | None) -> None:
        """Bring the taps to the device, unless those of this sky and camera are there."""
        if self._sets is None or image is not self._lit:
            self._sets = tap_sets(self.params.samples, image)
            self._lit = image
            self._turn = None
        if self._turn is None or not np.array_equal(turn, self._turn):
            table = tap_table(self._sets, turn)
            self._taps.upload(table)
            if self.wide_taps is not None:
                self.wide_taps.upload(np.tile(table.transpose(0, 2, 3, 1), 4))
            self._turn = turn.copy()

    def packed(self, gbuffer: Any) -> Any:
        """Return the kernel's struct for receivers of a G-buffer."""
        params = self.params
        return POINTS.pack(
            {
                "radius": params.radius,
                "most_px": params.max_radius_px / (gbuffer.step if self.reduced else 1),
                "bias": params.bias,
                "depth_bias": DEPTH_BIAS,
                "thickness": params.thickness,
                "area": params.strength * math.pi / params.samples,
                "nearest_square": params.nearest**2,
                "columns": gbuffer.whole[1],
                "rows": gbuffer.whole[0],
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
                "stride": _stride(gbuffer.whole[1]),
            }
        )


def _stride(columns: int) -> int:
    """Return the floats of a quarter of a sorted row, a multiple of the lanes of every form."""
    return -(-columns // (SETS[1] * GUARD)) * GUARD


def tap_table(sets: TapSets, turn: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [4 rows, 4 columns, taps, fields] as kernels/ssdo_points/ssdo_points.cl reads it.

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
    return np.ascontiguousarray(np.concatenate(fields, axis=-1), np.float32)
