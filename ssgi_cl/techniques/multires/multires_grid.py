"""Multiresolution grid: the points at which a mostly smooth result is computed, and interpolation between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.constants import MULTIRES_TILE, SSGI_GROUP
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.techniques.vpl.vpl_light import camera_of

MULTIRES = Struct(
    "MultiresParams",
    (
        *floats("scale", "depth_scale", "normal_scale", "begins", "ends", "no_second_difference", "beyond"),
        *ints("margin_columns", "margin_rows"),
    ),
)
TILE = MULTIRES_TILE
CHUNK = 16
"""Tiles that a work-item lists, with more than one lane."""
MOST_LISTING = 256
"""Work-groups with one lane, each of which adds up what is listed before its own."""
COUNTED = 4096
"""Tiles from which on they are counted by a pass of its own with one lane too: it then fills a GPU."""
POINTS = (SSGI_GROUP // TILE, TILE)
"""Work-groups with one lane, a point each: rows of tiles."""
SPARE = 64
"""Places after the longest list, so that what is read of it with its end is there."""
STEPS = (1, 2, 4, 8, 16, 32)
COARSE_BOUND = 4.0
"""Error allowed at step 1, in parts of that which is asked for; see `bound_scale`."""
BOUND_POWER = -1.0
"""Power of the step by which coarser levels are allowed less."""
BEGINS, ENDS = 0.8, 1.1
"""Estimated errors at which a point begins to be computed, and from which on nothing of it is
interpolated, in parts of the bound. Neither a pixel nor its light jumps in between."""
NO_SECOND_DIFFERENCE = 0.15
"""Estimated error where no second difference is known, in largest differences between corners."""
BEYOND = 1.4
"""Estimated slope next to corners that do not fit, in slopes beyond those that do."""
MOST_CHANNELS = 16


@dataclass(frozen=True, kw_only=True)
class MultiresGridParams(Params):
    """Parameters of the levels of points and of the weights of interpolation."""

    coarsest: int = param(
        16,
        "between the points of the coarsest level, all of which are computed: 1, 2, 4, 8, 16 or 32",
        unit="px",
        low=1,
        high=32,
    )
    plane_tolerance: float = param(
        0.005,
        "distance from the tangent plane at which a point counts nothing "
        "(orthographic cameras: in heights of the view)",
        unit="depths",
        low=1e-6,
        high=1.0,
    )
    normal_tolerance: float = param(
        0.32, "angle between normals at which it counts nothing", unit="radians", low=1e-3, high=3.0
    )

    def __post_init__(self) -> None:
        Params.__post_init__(self)
        if self.coarsest not in STEPS:
            raise ValueError(f"coarsest is {self.coarsest}: expected one of {STEPS} (px)")

    @property
    def spacings(self) -> tuple[int, ...]:
        """Pixels between the points of each level, from the coarsest to 1."""
        return tuple(step for step in reversed(STEPS) if step <= self.coarsest)


def bound_scale(step: int) -> float:
    """Return the largest error at a level, of that which is asked for.

    A point of a coarse level moves the result at many pixels round it, and costs no more than one
    of the finest: of step^-2/3, step^-5/6 and step^-1 the last makes the least RMSE of as many
    lights looked at, on generated scenes (docs/limits.md).
    """
    return COARSE_BOUND * math.pow(step, BOUND_POWER)


def tile_order(size: Size) -> NDArray[np.int32]:
    """Return the tiles of an image of `size` points along a Z-curve, row << 16 | column each."""
    rows, columns = -(-size[0] // TILE), -(-size[1] // TILE)
    row, column = (axis.ravel() for axis in np.indices((rows, columns)))
    key = sum(((column >> bit & 1) << 2 * bit) | ((row >> bit & 1) << (2 * bit + 1)) for bit in range(12))
    return (row << 16 | column)[np.argsort(key)].astype(np.int32)


class Points:
    """Every second pixel of a finer source, as a G-buffer without margin.

    Has the attributes of `DeviceGBuffer` that techniques read: runtime, size, margin, whole,
    layers, depth, linear, normal, camera_struct. `gradient` is how values change between the
    points.
    """

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self.runtime = runtime
        self.size = self.whole = size
        self.margin = (0, 0)
        self.layers = 1
        self.depth = runtime.plane(1, size, math.inf)
        self.linear = runtime.plane(1, size, math.inf)
        self.normal = runtime.plane(3, size)
        self.gradient = runtime.plane(2, size)
        self.camera_struct: Any = None

    def update(self, fine: Source) -> None:
        """Take the camera of a finer source, whose pixels `reduce` picks."""
        struct = fine.camera_struct.copy()
        band = getattr(fine, "band", None)
        rows = fine.margin[0] if band is None else band.margin[0]
        struct["rows_above"] = (float(struct["rows_above"]) + fine.margin[0] - rows) / 2
        for axis, margin in (("x", fine.margin[1]), ("y", rows)):
            # Centre of point i, at i + 0.5, is the centre of fine pixel margin + 2 i.
            to = float(struct[f"to_{axis}"])
            struct[f"at_{axis}"] = float(struct[f"at_{axis}"]) + to * (margin - 0.5)
            struct[f"to_{axis}"] = 2.0 * to
            struct[f"from_{axis}"] = 0.5 / to
            struct[f"centre_{axis}"] = -float(struct[f"at_{axis}"]) * 0.5 / to
        self.camera_struct = struct

    def reduce(self, fine: Source, coarser: Points | None = None) -> None:
        """Queue the pass that picks the pixels, and those of a coarser level too, which so needs no other launch."""
        kernel = self.runtime.kernel(
            "multires/multires_reduce.cl", {"MULTIRES_LEVELS": 1 if coarser is None else 2}, (CAMERA,)
        )
        kernel.run(
            self.size,
            fine_depth=fine.depth,
            fine_normal=fine.normal,
            depth=self.depth,
            linear=self.linear,
            normal=self.normal,
            next_depth=coarser and coarser.depth,
            next_linear=coarser and coarser.linear,
            next_normal=coarser and coarser.normal,
            next=coarser and coarser.size,
            fine_size=fine.whole,
            margin=fine.margin,
            camera=self.camera_struct,
        )


Source = DeviceGBuffer | Points


class Level:
    """The points of one level.

    Attributes:
        number, step: 0 for the coarsest; pixels between points.
        size: (rows, columns) of points.
        source: a G-buffer whose image is the points: the one given, for step 1.
        values: of all points; to those on the list the caller adds what it computes, times its
            share.
        shares: 0 to 1, of points on the list alone; others hold anything.
        list: how many points are to be computed, and so many times row << 16 | column. 16 points in
            a row lie in a block of 4 x 4 where all are on the list, 64 in one of 8 x 8.
        most: how many points there are, and thus the longest that the list can be.
    """

    source: Source  # known when the level is planned

    def __init__(self, runtime: Runtime, number: int, step: int, size: Size, channels: int) -> None:
        self.number = number
        self.step = step
        self.size = size
        self.most = size[0] * size[1]
        self.values = runtime.plane(channels, size)
        self.fractions = runtime.plane(1, size)
        self.list = runtime.array(np.zeros(1 + self.most + SPARE, np.int32))
        order = tile_order(size)
        self._tiles = runtime.array(order)
        self._tile_count = len(order)
        # Which points are on the list, see kernels/multires/list.clh.
        self._masks = runtime.array(np.zeros(len(order) * TILE, np.int32))
        self._counts = runtime.array(np.zeros(-(-len(order) // TILE) * TILE, np.int32))
        self._count = runtime.kernel("multires/multires_count.cl")
        lanes = runtime.variant.lanes
        self._counts_first = lanes > 1 or self._tile_count >= COUNTED
        self._fill = runtime.kernel("multires/multires_list.cl", {"MULTIRES_COUNTED": int(self._counts_first)})
        # Of a work-item; with one lane of a work-group, which takes four at a time.
        four = SSGI_GROUP // 16
        self._own_tiles = CHUNK if lanes > 1 else four * -(-self._tile_count // (four * MOST_LISTING))
        self._items = 1 if lanes > 1 else SSGI_GROUP

    def mark(self, kernel: Kernel, grid: Size, local: Size | None = None, **arguments: Any) -> None:
        """Queue a pass that writes values, shares and marks, and those that make the list."""
        kernel.run(
            self.size,
            grid=grid,
            local=local,
            values=self.values,
            fractions=self.fractions,
            masks=self._masks,
            **arguments,
        )
        if self._counts_first:
            self._count.run(
                self.size,
                grid=(1, self._tile_count),
                masks=self._masks,
                tiles=self._tiles,
                counts=self._counts,
                tile_count=self._tile_count,
            )
        self._fill.run(
            self.size,
            grid=(1, -(-self._tile_count // self._own_tiles) * self._items),
            local=(1, self._items),
            masks=self._masks,
            counts=self._counts if self._counts_first else None,
            tiles=self._tiles,
            list=self.list,
            tile_count=self._tile_count,
            own_tiles=self._own_tiles,
        )

    def listed(self) -> NDArray[np.int32]:
        """Return (row, column) of each point on the list, in its order. Waits for the device."""
        values = self.list.download()
        points = values[1 : 1 + values[0]]
        return np.stack([points >> 16, points & 0xFFFF], axis=1)


class MultiresGrid(Prepared[MultiresGridParams]):
    """Levels of points, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `MultiresGridParams`.
        channels: images of the result, whose values are >= 0.
    """

    def __init__(
        self, runtime: Runtime, size: Size, params: MultiresGridParams | None = None, channels: int = 3
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or MultiresGridParams()
        if not 1 <= channels <= MOST_CHANNELS:
            raise ValueError(f"channels is {channels}: expected 1 to {MOST_CHANNELS}")
        self._levels = [
            Level(runtime, number, step, (-(-size[0] // step), -(-size[1] // step)), channels)
            for number, step in enumerate(params.spacings)
        ]
        self._points = [Points(runtime, level.size) for level in self._levels[:-1]]
        self._macros = {"MULTIRES_CHANNELS": channels}

    @property
    def result(self) -> Plane:
        """Values of all pixels, once all levels are done; 0 where nothing is."""
        return self._levels[-1].values

    def half(self, gbuffer: DeviceGBuffer) -> Source:
        """Return every second pixel, once a level is planned; all if there is one level alone."""
        return self._points[-1] if self._points else gbuffer

    def levels(self, gbuffer: DeviceGBuffer, bound: DeviceArray) -> Iterator[Level]:
        """Queue the passes that plan a level, and yield it, from the coarsest to the finest.

        The caller queues what computes the points on the level's list before it asks for the next.

        Args:
            gbuffer: what the camera sees; only the image counts, not its margin.
            bound: [1] float32, the largest error that interpolation may make in any channel;
                INFINITY leaves the decision to geometry. Read from the second level on.

        Raises:
            ValueError: a G-buffer of another size, or an empty one.
        """
        camera_of(gbuffer, self.size)
        sources: list[Source] = [*self._points, gbuffer]
        for points, finer in zip(reversed(self._points), reversed(sources), strict=False):
            points.update(finer)
        at_once = 2 if self.runtime.variant.lanes == 1 else 1
        for last in range(len(self._points), 0, -at_once):
            *coarse, points = self._points[max(last - at_once, 0) : last]
            points.reduce(sources[last], *coarse)
        coarser: Level | None = None
        for level, source in zip(self._levels, sources, strict=True):
            level.source = source
            if coarser is None:
                level.mark(
                    self.runtime.kernel("multires/multires_start.cl", self._macros),
                    (level.size[0], -(-level.size[1] // TILE)),
                    depth=source.depth,
                    whole=source.whole,
                    margin=source.margin,
                )
            else:
                self._interpolate(coarser, level, bound)
            yield level
            coarser = level

    def counts(self) -> dict[int, int]:
        """Return the number of points computed for each step. Waits for the device."""
        return {level.step: int(level.list.download()[0]) for level in self._levels}

    def computed(self) -> NDArray[np.int32]:
        """Return [rows, columns] the step of the level that computed a pixel; 0: interpolated."""
        steps = np.zeros(self.size, np.int32)
        for level in self._levels:
            row, column = level.listed().T * level.step
            steps[row, column] = level.step
        return steps

    def _interpolate(self, coarser: Level, level: Level, bound: DeviceArray) -> None:
        """Queue the passes that make a level's values from those of a coarser one."""
        known, source = self._points[coarser.number], level.source
        params = self.params
        values = {
            "depth_scale": 1.0 / params.plane_tolerance,
            "normal_scale": 1.0 / (1.0 - math.cos(params.normal_tolerance)),
            "scale": bound_scale(level.step),
            "margin_columns": 0,
            "margin_rows": 0,
            "begins": BEGINS,
            "ends": ENDS,
            "no_second_difference": NO_SECOND_DIFFERENCE,
            "beyond": BEYOND,
        }
        self.runtime.kernel("multires/multires_gradient.cl", self._macros, (CAMERA, MULTIRES)).run(
            coarser.size,
            linear=known.linear,
            normal=known.normal,
            values=coarser.values,
            bound=bound,
            gradient=known.gradient,
            camera=known.camera_struct,
            params=MULTIRES.pack(values),
        )
        values["margin_rows"], values["margin_columns"] = source.margin
        kernel = self.runtime.kernel("multires/multires_interpolate.cl", self._macros, (CAMERA, MULTIRES))
        lanes = self.runtime.variant.lanes
        level.mark(
            kernel,
            level.size if lanes == 1 else (coarser.size[0], -(-coarser.size[1] // lanes)),
            POINTS if lanes == 1 else None,
            coarse_linear=known.linear,
            coarse_normal=known.normal,
            coarse_values=coarser.values,
            coarse_gradient=known.gradient,
            linear=source.linear,
            normal=source.normal,
            bound=bound,
            coarse=coarser.size,
            camera=source.camera_struct,
            params=MULTIRES.pack(values),
        )
