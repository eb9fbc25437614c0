"""Directions of SSDO: directional occlusion and one-bounce light from rays in the hemisphere.

Ritschel, Grosch and Seidel 2009, "Approximating Dynamic Global Illumination in Image Space": as
published (method "published"), and corrected so that light is conserved (method "points").

Directions are fixed in world space. A direction and its opposite are one: a receiver takes the one
on its own side. Each stands for the part of the sphere that is nearer to it than to any other of its
set, with the sky's light from there. Directions lie denser where the sky is bright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.sampling import DEPTH_BIAS, TILE_ORDER, r_points
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.techniques.direct.layer_shading import SenderRecords
from ssgi_cl.techniques.filters.upsample import coarse_size
from ssgi_cl.techniques.source import Source

Doubles = NDArray[np.float64]

POINTS = Struct(
    "PointsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "thickness", "area", "nearest_square"),
        *ints("columns", "rows", "margin_columns", "margin_rows"),
    ),
)

POINT_METHODS = ("points", "published")
STRIP = 256
"""Width in columns of the strips in which receivers are processed, for locality of reads."""

GROUP = 16
"""Work-items of a work-group on devices with lanes."""

SETS = (16, 4)
"""Rows and columns of the tile of direction sets, one set a pixel. Kernels process columns modulo 4
together; more rows cost nothing and make neighbouring tiles less alike."""

BLOCK_ORDER = (0, 2, 1, 3)
"""Order of the blocks of 4 x 4 pixels of a tile."""

CELLS = (64, 128)
"""Rows and columns of the cells of equal solid angle that are assigned to their nearest direction."""

EVEN = 0.5
"""Share of the density of directions that does not follow the sky's radiance."""

LEAST_CELLS = 1e-3
"""Cells counted for a direction that is the nearest one to none: no solid angle is 0."""

FIELDS = 11
"""Floats of a direction in `direction_table`, with a sky."""


@dataclass(frozen=True, kw_only=True)
class PointsParams(Params):
    """Parameters of SSDO from directions (Ritschel, Grosch and Seidel 2009)."""

    method: str = param(
        "points", "rays that meet surfaces, or one tap for each direction as published", choices=POINT_METHODS
    )
    radius: float = param(0.5, "radius of the hemisphere", low=0.0, high=1e30, above=True, unit="scene units")
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
        0.005,
        "height above the tangent plane up to which nothing occludes or sends light",
        low=0.0,
        high=1.0,
        unit="radii",
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

    def thickness_of(self, gbuffer: DeviceGBuffer) -> Plane | None:
        """Return the thicknesses that the kernels read: none as published."""
        return None if self.method == "published" else gbuffer.thickness

    def macros(self, layers: int, thickness: Plane | None) -> dict[str, int]:
        """Return the macros of kernels/ssdo/search.clh to read depth layers with or without thickness."""
        published = self.method == "published"
        return {
            "POINTS_TAPS": self.taps,
            "POINTS_LAYERS": layers,
            "POINTS_PUBLISHED": int(published),
            # None, the parameter, or that of each pixel.
            "POINTS_THICKNESS": 0 if published else 2 if thickness is not None else int(self.thickness > 0.0),
        }


class SsdoPoints(Prepared[PointsParams]):
    """Directional occlusion and one-bounce light, prepared for results of one size.

    Method "points": a direction meets the nearest surface that the camera sees within the radius
    and receives its radiance, or is unoccluded and receives the sky's. Each counts with its solid
    angle times cosine, so light is conserved. Method "published": equations 1 and 2 of the paper
    with one tap for each direction. Its sum isn't conserved: all senders have the area
    pi radius^2 / samples times `strength`, whatever their distance. In both, a direction that leaves
    the image is unoccluded.

    Args:
        runtime: the device.
        size: (rows, columns) of the G-buffers' image.
        step: 1, 2 or 4: every step-th pixel of it is a receiver. Taps read the full size.
        params: see `PointsParams`.
        reduced: whether receivers are the pixels of a reduced G-buffer of that size. Taps then read
            its front layer only.
        kept: whether `kept` and `wide_directions` are needed, for auxiliary cameras.

    Attributes:
        bounces: whether the last call gathered a bounce.
        kept: int32, a bit for each direction of the last call that met something, as
            kernels/ssdo/ssdo_points.cl has it. None without the argument `kept`.
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
        self._sky: Doubles | None = None  # of the sets
        self._turn: Doubles | None = None
        self._planes: dict[Any, DeviceArray] = {}
        self._records: dict[Any, SenderRecords] = {}
        count = self.params.samples
        self._directions = runtime.empty(64 * count * FIELDS, np.float32)
        self.bounces = False
        self.kept: DeviceArray | None = None
        self.wide_directions: DeviceArray | None = None
        if kept:
            rows, pitch = plane_shape(-(-count // 32), coarse_size(size, step))
            self.kept = runtime.array(np.zeros(rows * pitch, np.int32))
            self.wide_directions = runtime.empty(256 * count * FIELDS, np.float32)

    def run(
        self,
        gbuffer: DeviceGBuffer,
        source: Source | None = None,
        *,
        radiance: Plane | SenderRecords | None = None,
        sky: Any = None,
    ) -> Plane:
        """Queue the passes; return A, the irradiance by the sky's image, and by surfaces.

        Args:
            gbuffer: depth, of any number of layers, and normals.
            source: the reduced G-buffer with `reduced`; else ignored.
            radiance: that of the layers' visible sides, 3 images for each, W m^-2 sr^-1, or records
                of it; None for no bounce. Layers with both normals and radiance send light.
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
        thickness = None if self.reduced else self.params.thickness_of(gbuffer)
        kernel = self.runtime.kernel(
            "ssdo/ssdo_points.cl",
            {
                **self.params.macros(layers, thickness),
                "POINTS_COUNT": self.params.samples,
                "POINTS_SENDERS": senders,
                "POINTS_STEP": self.step,
                "POINTS_SKY": int(image is not None),
                "POINTS_KEPT": int(self.kept is not None),
            },
            (CAMERA, POINTS),
        )
        count = 1 + 3 * (image is not None) + 3 * (senders > 0)
        if count not in self._results:
            self._results[count] = self.runtime.plane(count, coarse_size(self.size, self.step))
        result = self._results[count]
        kernel.run(
            result.size,
            grid=self._grid(result.size),
            depth=read.depth,
            normal=read.normal,
            thickness=thickness,
            planes=self.planes_of(read, layers),
            senders=None if radiance is None else radiance.array,
            directions=self._directions,
            gathered=result,
            kept=self.kept,
            camera=read.camera_struct,
            params=self.packed(read),
        )
        return result

    def planes_of(self, gbuffer: Any, layers: int) -> DeviceArray:
        """Queue the pass that makes the tangent plane of each pixel; return one quad for each.

        Args:
            gbuffer: a G-buffer or a reduced one; those of one shape share the memory.
            layers: of it, from the front.
        """
        rows, columns = gbuffer.whole
        key = gbuffer.whole, layers
        if key not in self._planes:
            self._planes[key] = self.runtime.empty(4 * layers * rows * (-(-columns // 16) * 16), np.int32)
        planes = self._planes[key]
        macros = {"PLANES_LAYERS": layers, "PLANES_NORMALS": min(layers, gbuffer.normal.count // 3)}
        self.runtime.kernel("ssdo/ssdo_planes.cl", macros, (CAMERA,)).run(
            gbuffer.whole, depth=gbuffer.depth, normal=gbuffer.normal, planes=planes, camera=gbuffer.camera_struct
        )
        return planes

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

    def _prepare(self, turn: Doubles, sky: Doubles | None) -> None:
        """Upload the directions, unless the device has those of this sky and camera."""
        if self._sets is None or sky is not self._sky:
            self._turn = None
            self._sets = direction_sets(self.params.samples, sky, equal=self.params.method == "published")
            self._sky = sky
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


def direction_table(sets: DirectionSets, turn: Doubles) -> NDArray[np.float32]:
    """Return [16 rows, 4 columns, directions, fields] as kernels/ssdo/ssdo_points.cl reads.

    Args:
        sets: the directions of each pixel of a tile.
        turn: [3, 3] world to view.
    """
    fields = [sets.direction @ turn.T, sets.length[..., None], sets.solid_angle[..., None]]
    if sets.light is not None:
        fields += [sets.light[..., 0, :], sets.light[..., 1, :]]
    return np.ascontiguousarray(np.concatenate(fields, axis=-1), np.float32)


@dataclass(frozen=True, eq=False)
class DirectionSets:
    """The directions of each pixel of a tile.

    Attributes:
        direction: [16, 4, count, 3] world space, unit length, one of each pair of opposite ones.
        length: [16, 4, count] in (0, 1): the position of the taps along each direction.
        solid_angle: [16, 4, count] of either side, steradians.
        light: [16, 4, count, 2, 3] integral of the sky's radiance over the solid angle of the
            direction and of its opposite, W/m^2; None without a sky.
    """

    direction: Doubles
    length: Doubles
    solid_angle: Doubles
    light: Doubles | None


def direction_sets(count: int, sky: Doubles | None = None, *, equal: bool = False) -> DirectionSets:
    """Return the directions of a tile.

    Args:
        count: directions of a pixel.
        sky: [rows, columns, 3] radiance, a latitude-longitude image as `Environment` has it, or
            None.
        equal: whether directions are evenly distributed under any sky, each with the solid angle
            2 pi / count, as in equation 1 of Ritschel, Grosch and Seidel 2009.
    """
    return _even_sets(count, equal) if sky is None else _sets(count, sky, equal)


@lru_cache(maxsize=8)
def _even_sets(count: int, equal: bool) -> DirectionSets:
    return _sets(count, None, equal)


def _sets(count: int, sky: Doubles | None, equal: bool) -> DirectionSets:
    rows, columns = CELLS
    flux = None if sky is None else cell_flux(sky)
    density = np.ones((rows // 2, columns))
    if flux is not None and not equal:
        bright = flux.sum(axis=-1)
        # A direction and its opposite: turned by half a turn, and from above to below.
        bright = bright + np.roll(bright[::-1], columns // 2, axis=1)
        half = bright[: rows // 2]
        if half.sum() > 0.0:
            density = EVEN + (1.0 - EVEN) * half / half.mean()
    sets = SETS[0] * SETS[1]
    first = np.concatenate([4 * TILE_ORDER + block for block in BLOCK_ORDER])
    points = r_points(0, sets * count, 3)[first[..., None] + sets * np.arange(count)]
    direction = _directions(density, points[..., 0], points[..., 1])
    cells = cell_centres().reshape(-1, 3)
    solid_angle = np.full((*SETS, count), 2.0 * np.pi / count)
    light = None if flux is None else np.zeros((*SETS, count, 2, 3))
    for place in np.ndindex(SETS):
        along = cells @ direction[place].T
        nearest = np.argmax(np.abs(along), axis=1)
        if not equal:
            owned = np.maximum(np.bincount(nearest, minlength=count), LEAST_CELLS)
            solid_angle[place] = owned * (0.5 * (4.0 * np.pi / len(cells)))
        if light is not None and flux is not None:
            opposite = along[np.arange(len(cells)), nearest] < 0.0
            np.add.at(light[place], (nearest, opposite.astype(int)), flux.reshape(-1, 3))
    return DirectionSets(direction, points[..., 2] * (1.0 - 1e-3) + 5e-4, solid_angle, light)


def cell_centres() -> Doubles:
    """Return the directions of the centres of `CELLS` [rows, columns, 3], world space."""
    rows, columns = CELLS
    up = 1.0 - 2.0 * (np.arange(rows)[:, None] + 0.5) / rows
    return _towards(up, ((np.arange(columns) + 0.5) / columns - 0.5)[None])


def cell_flux(sky: Doubles) -> Doubles:
    """Return the integral of a sky's radiance over each of `CELLS` [rows, columns, 3], W/m^2."""
    rows, columns = CELLS
    again = [-(-2 * CELLS[axis] // sky.shape[axis]) for axis in (0, 1)]
    fine = np.repeat(np.repeat(sky, again[0], axis=0), again[1], axis=1)
    edges = np.cos(np.linspace(0.0, np.pi, fine.shape[0] + 1))
    solid_angle = (edges[:-1] - edges[1:]) * 2.0 * np.pi / fine.shape[1]
    up = 0.5 * (edges[:-1] + edges[1:])
    row = np.clip(((1.0 - up) * 0.5 * rows).astype(int), 0, rows - 1)
    column = np.arange(fine.shape[1]) * columns // fine.shape[1]
    at = (row[:, None] * columns + column).ravel()
    flux = [np.bincount(at, (fine[..., c] * solid_angle[:, None]).ravel(), minlength=rows * columns) for c in range(3)]
    return np.stack(flux, axis=-1).reshape(rows, columns, 3).astype(np.float64)


def _directions(density: Doubles, u: Doubles, v: Doubles) -> Doubles:
    """Return directions [..., 3] of the upper hemisphere, sampled by `density` with u, v in [0, 1)."""
    rows, columns = density.shape
    row, up = _inverted(density.sum(axis=1), u)
    shift = np.zeros(v.shape)
    for number in range(rows):
        here = row == number
        column, part = _inverted(density[number], v[here])
        shift[here] = (column + part) / columns - 0.5
    return _towards(1.0 - (row + up) / rows, shift)


def _inverted(density: Doubles, u: Doubles) -> tuple[NDArray[np.int_], Doubles]:
    """Return the element at which the cumulative sum reaches the fraction u, and how far into it."""
    ends = np.cumsum(density)
    wanted = u * ends[-1]
    part = np.minimum(np.searchsorted(ends, wanted, side="right"), len(density) - 1)
    before = ends[part] - density[part]
    return part, np.clip((wanted - before) / density[part], 0.0, 1.0)


def _towards(up: Doubles, turn: Doubles) -> Doubles:
    """Return directions by height above the horizon and by fraction of a turn from -z to +x."""
    ring = np.sqrt(np.maximum(1.0 - up * up, 0.0))
    angle = 2.0 * np.pi * turn
    return np.stack(np.broadcast_arrays(ring * np.sin(angle), up, -ring * np.cos(angle)), axis=-1)
