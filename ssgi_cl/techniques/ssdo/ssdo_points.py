"""Directional occlusion and one bounce of light from directions in the half ball round each pixel.

Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image Space": as
published (method "published"), and corrected so that light is conserved (method "points").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.sampling import DEPTH_BIAS
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.direct.layer_shading import SenderRecords
from ssgi_cl.techniques.filters.upsample import coarse_size
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_directions import DirectionSets, direction_sets

POINTS = Struct(
    "PointsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "thickness", "area", "nearest_square"),
        *((n, "int") for n in ("columns", "rows", "margin_columns", "margin_rows")),
    ),
)

POINT_METHODS = ("points", "published")
STRIP = 256
"""Columns that are gone through before those beside them, so that what is read stays near."""

GROUP = 16
"""Work-items of a work-group, that of devices with lanes."""


@dataclass(frozen=True, kw_only=True)
class PointsParams(Params):
    """Parameters of SSDO from directions (Ritschel, Grosch and Seidel 2009)."""

    method: str = param(
        "points", "rays that meet surfaces, or one tap for each direction as published", choices=POINT_METHODS
    )
    radius: float = param(0.5, "radius of the half ball", low=0.0, high=1e30, above=True, unit="scene units")
    samples: int = param(16, "directions per pixel", low=1, high=256)
    max_radius_px: float = param(
        math.inf, "limit of the projected radius, for a near view", low=1.0, high=math.inf, unit="px"
    )
    thickness: float = param(
        0.0,
        "points: taps this far behind a surface, along the view ray, meet it too; that "
        "of each pixel where the G-buffer has it",
        low=0.0,
        high=1e30,
        unit="radii",
        shape=bool,
    )
    bias: float = param(
        0.005, "height above the tangent plane up to which nothing hides or sends", low=0.0, high=1.0, unit="radii"
    )
    nearest_distance: float = param(
        1.0,
        "published: least distance that counts between sender and receiver",
        low=0.0,
        high=1e30,
        above=True,
        unit="scene units",
    )
    strength: float = param(1.0, "published: factor of the bounce", low=0.0, high=1e3)

    @property
    def taps(self) -> int:
        """Taps of a direction: the more directions there are, the finer; one as published."""
        return 1 if self.method == "published" else 2 + math.isqrt(self.samples)

    def thickness_of(self, given: Plane | None) -> int:
        """Return which thickness counts: 0 none, 1 the parameter, 2 that of each pixel."""
        if self.method == "published":
            return 0
        return 2 if given is not None else int(self.thickness > 0.0)


class SurfacePlanes:
    """Tangent planes of the surfaces of a G-buffer's layers, one quad for each pixel.

    Args:
        runtime: the device.
        whole: (rows, columns) of the G-buffers, with their margin.
        layers: of them.

    Attributes:
        array: as kernels/ssdo/ssdo_planes.cl has it.
    """

    def __init__(self, runtime: Runtime, whole: Size, layers: int) -> None:
        self.runtime = runtime
        self.whole = whole
        self.layers = layers
        padded = -(-whole[1] // 16) * 16
        self.array: DeviceArray = runtime.empty(4 * layers * whole[0] * padded, np.int32)

    def make(self, gbuffer: Any) -> DeviceArray:
        """Queue the pass for a (reduced) G-buffer; return `array`."""
        kernel = self.runtime.kernel(
            "ssdo/ssdo_planes.cl",
            {"PLANES_LAYERS": self.layers, "PLANES_NORMALS": min(self.layers, gbuffer.normal.count // 3)},
            (CAMERA,),
        )
        kernel.run(
            self.whole, depth=gbuffer.depth, normal=gbuffer.normal, planes=self.array, camera=gbuffer.camera_struct
        )
        return self.array


class SsdoPoints(Prepared[PointsParams]):
    """Directional occlusion and a bounce of light, prepared for results of one size.

    Method "points": a direction meets the nearest surface that the camera sees within the radius
    and brings its radiance, or is open and brings the sky's; all count with their solid angle times
    cosine, so light is conserved. Method "published": equations 1 and 2 of the paper with one tap
    for each direction. Its sum isn't conserved: all senders have the area pi radius^2 / samples
    times `strength`, whatever their distance. In both, a direction that leaves the image is open.

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
        kept: int32, a bit for each direction of the last call that met something, as
            kernels/ssdo/ssdo_points.cl has it. None if not wanted.
        wide_directions: the directions of the last call, [16 rows, directions, fields, 16 columns].
            None likewise.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        step: int = 1,
        params: PointsParams | None = None,
        *,
        reduced: bool = False,
        kept: bool = False,
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.step = step
        self._params = params or PointsParams()
        self.reduced = reduced
        self._results: dict[int, Plane] = {}
        self._sets: DirectionSets | None = None
        self._lit: Any = None  # what the sets were made for
        self._turn: NDArray[np.float64] | None = None
        self._planes: dict[Any, SurfacePlanes] = {}
        self._records: dict[Any, SenderRecords] = {}
        fields, count = 11, self.params.samples
        self._directions = runtime.empty(64 * count * fields, np.float32)
        self.bounces = False
        self.kept: DeviceArray | None = None
        self.wide_directions: DeviceArray | None = None
        if kept:
            images, pitch = plane_shape(-(-count // 32), coarse_size(size, step))
            self.kept = runtime.array(np.zeros(images * pitch, np.int32))
            self.wide_directions = runtime.empty(256 * count * fields, np.float32)

    def run(
        self,
        gbuffer: DeviceGBuffer,
        source: Source | None = None,
        *,
        radiance: Plane | SenderRecords | None = None,
        sky: Any = None,
    ) -> Plane:
        """Queue the passes; return A, the sky's irradiance if it is an image, and the bounce's.

        Args:
            gbuffer: depth, of any number of layers, and normals.
            source: what is read if this is for reduced ones; else not looked at.
            radiance: that of the layers' visible sides, 3 images for each, W m^-2 sr^-1, or records
                of it; None for no bounce. Layers send light as far as there are normals and
                radiance.
            sky: an `ssgi_cl.techniques.direct.sky.Sky`, of which the image counts, or None.

        Returns:
            A plane of ceil(size / step): A in [0, 1], 1 where nothing is; with an image of the sky,
            3 images of irradiance from it; with `radiance`, 3 of the bounce's irradiance, W/m^2.
        """
        read: Source = source if self.reduced and source is not None else gbuffer
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
        kernel = self.runtime.kernel(
            "ssdo/ssdo_points.cl",
            {
                "POINTS_COUNT": self.params.samples,
                "POINTS_TAPS": self.params.taps,
                "POINTS_LAYERS": layers,
                "POINTS_SENDERS": senders,
                "POINTS_STEP": self.step,
                "POINTS_SKY": int(image is not None),
                "POINTS_PUBLISHED": int(self.params.method == "published"),
                "POINTS_THICKNESS": self.params.thickness_of(thickness),
                "POINTS_KEPT": int(self.kept is not None),
            },
            (CAMERA, POINTS),
        )
        count = 1 + 3 * (image is not None) + 3 * (senders > 0)
        if count not in self._results:
            size = coarse_size(self.size, self.step)
            self._results[count] = self.runtime.plane(count, size)
        result = self._results[count]
        planes = self.planes_of(read, layers)
        kernel.run(
            result.size,
            grid=self._grid(result.size),
            depth=read.depth,
            normal=read.normal,
            thickness=thickness,
            planes=planes,
            senders=None if radiance is None else radiance.array,
            directions=self._directions,
            gathered=result,
            kept=self.kept,
            camera=read.camera_struct,
            params=self.packed(read),
        )
        return result

    def planes_of(self, gbuffer: Any, layers: int) -> DeviceArray:
        """Queue the pass that makes tangent planes; return them. G-buffers of a shape share them."""
        key = gbuffer.whole, layers
        if key not in self._planes:
            self._planes[key] = SurfacePlanes(self.runtime, *key)
        return self._planes[key].make(gbuffer)

    def _grid(self, size: Size) -> Size | None:
        lanes = self.runtime.variant.lanes
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

    def _prepare(self, turn: NDArray[np.float64], image: NDArray[np.float64] | None) -> None:
        """Bring the directions to the device, unless those of this sky and camera are there."""
        if self._sets is None or image is not self._lit:
            self._turn = None
            equal = self.params.method == "published"
            self._sets = direction_sets(self.params.samples, image, equal=equal)
            self._lit = image
        if self._turn is None or not np.array_equal(turn, self._turn):
            self._turn = None
            table = direction_table(self._sets, turn)
            self._directions.upload(table)
            if self.wide_directions is not None:
                self.wide_directions.upload(np.tile(table.transpose(0, 2, 3, 1), 4))
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
                "nearest_square": params.nearest_distance**2,
                "columns": gbuffer.whole[1],
                "rows": gbuffer.whole[0],
                "margin_columns": gbuffer.margin[1],
                "margin_rows": gbuffer.margin[0],
            }
        )


def direction_table(sets: DirectionSets, turn: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return [16 rows, 4 columns, directions, fields] as kernels/ssdo/ssdo_points.cl reads.

    Args:
        sets: the directions of each pixel of a tile.
        turn: [3, 3] world to view.
    """
    fields = [sets.direction @ turn.T, sets.length[..., None], sets.solid_angle[..., None]]
    if sets.light is not None:
        fields += [sets.light[..., 0, :], sets.light[..., 1, :]]
    return np.ascontiguousarray(np.concatenate(fields, axis=-1), np.float32)
