"""Occupancy grid: cells that hold surfaces of a scene, or those seen, which block shadow rays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.params import param
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.constants import OCCUPANCY_BLOCK, VPL_BOX
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.rasterize.raster.device_scene import DeviceScene

OCCUPANCY = Struct("OccupancyParams", (*floats("lift"), *ints("boxes", "segments", "stride")))
TO_VIEW = Struct("ToViewParams", floats("xx", "xy", "xz", "x", "yx", "yy", "yz", "y", "zx", "zy", "zz", "z"))
"""Rows of a matrix to view space."""
GRIDS = (32, 64, 128, 256)
MOST_CELLS = 128
"""Cells chosen by default at most: with 256 shadow rays take twice the time, and few scenes gain."""
BLOCK = OCCUPANCY_BLOCK
BOX = 5
"""Floats that say where a grid is."""
LIFT, MESH_LIFT = 1.9, 1.5
"""Cells above their surfaces at which rays begin and end, lest these block them. Cells that pixels
touch reach sqrt(3) beyond their plane at most, those of triangles (sqrt(3) + sqrt(1/3)) / 2 = 1.15;
the rest is for surfaces that bend (parlour, workshop and terrace: 1.2 blocks more than there is,
1.8 lets more pass)."""
SLICES = 8
"""Work-items of a triangle on a GPU, so that none draws a large one alone."""


def grid_param() -> Any:
    """Declare the parameter `grid`."""
    return param(
        0,
        "cells along a side of the occupancy grid: 32, 64, 128, 256, or 0: as many as the "
        "image's pixels fill, at most 128; 128 with `scene`",
        low=0,
        high=256,
    )


def check_grid(cells: int) -> None:
    """Raise ValueError if a grid can't have so many cells along a side."""
    if cells not in (0, *GRIDS):
        raise ValueError(f"grid is {cells}: expected 0 or one of {GRIDS} (cells)")


def cells_for(size: Size) -> int:
    """Return the cells along a side that leave no holes in the surfaces of an image.

    The grid is as wide as what is seen, so its cells must be wider than pixels; surfaces that are
    seen at an angle take a half more.
    """
    fitting = [cells for cells in GRIDS if 1.5 * cells <= max(size) and cells <= MOST_CELLS]
    return max(fitting, default=GRIDS[0])


@dataclass(frozen=True, eq=False)
class Occupancy:
    """The surfaces that block rays, in the view space of one G-buffer.

    Attributes:
        grid, box: see kernels/occupancy/grid.clh.
        cells: along a side.
        unit: scene units of the length in which `box` counts.
    """

    grid: DeviceArray
    box: DeviceArray
    cells: int
    unit: float

    @property
    def macros(self) -> dict[str, int]:
        """Macros of kernels that include kernels/occupancy/grid.clh."""
        return {"OCCUPANCY_CELLS": self.cells}

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of kernels that follow rays through the grid."""
        return {"occupancy": self.grid, "grid_box": self.box}


class PlacedLights(Protocol):
    """Lights on the device, as `DeviceVpls` has them: a grid spans them too."""

    bounds: DeviceArray
    segments: int
    stride: int
    unit: float


class OccupancyGrid:
    """A bit for each of cells^3 cubes of view space: whether a surface is in it.

    It spans all that the camera sees and all lights. Its surfaces are the triangles of a scene, or,
    without one, what the camera and the lights see; then all else is air. That leaks where a
    blocker is seen by neither: under a camera that looks straight down, all light passes a thin
    upright wall. Elsewhere it blocks more, as pixels mark all cells that they touch: with 4096
    lights the mean irradiance is 0 to 10 % below that with all triangles in the built-in scenes,
    Sponza, country_kitchen and veach_ajar.

    Args:
        runtime: the device.
        cells: along a side: 32, 64, 128 or 256; 0: as `cells_for` says.
        size: (rows, columns) of the image.
        kept: whether what is filled is in memory of its own, the same each time; else it lives as
            long as somebody refers to it.
    """

    def __init__(self, runtime: Runtime, cells: int, size: Size, *, kept: bool = True) -> None:
        self.runtime = runtime
        self.cells = cells = cells or cells_for(size)
        self.macros = {"OCCUPANCY_CELLS": cells}
        self._own = self._empty(runtime.empty) if kept else None
        self._bounds: DeviceArray | None = None
        self._clear = runtime.kernel("occupancy/occupancy_clear.cl", self.macros, (OCCUPANCY,))

    def fill(
        self,
        gbuffer: DeviceGBuffer,
        rsms: Sequence[DeviceRsm],
        boxes: DeviceArray,
        box_count: int,
        lights: PlacedLights,
        scene: DeviceScene | None = None,
    ) -> Occupancy:
        """Queue the passes that mark the surfaces of all layers and of the reflective shadow maps.

        Args:
            gbuffer: of which the margin counts too.
            rsms: any number.
            boxes, box_count: bounds of the image's tiles, which the grid spans, and their number; see
                kernels/vpl/vpl_boxes.cl.
            lights: what the grid spans besides; lengths are counted in their unit.
            scene: whose triangles are marked in place of what is seen.
        """
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        values = {
            "lift": LIFT if scene is None else MESH_LIFT,
            "boxes": box_count,
            "segments": lights.segments,
            "stride": lights.stride,
        }
        empty = self._cleared(lights.unit, values, boxes, lights.bounds)
        if scene is not None:
            self._voxelize(scene, camera.view, empty)
        else:
            self._mark_seen(gbuffer, rsms, camera, empty)
        return self._filled(empty)

    def fill_scene(
        self,
        scene: DeviceScene,
        view: NDArray[np.float64],
        unit: float,
        low: float | NDArray[np.float64],
        high: float | NDArray[np.float64],
    ) -> Occupancy:
        """Queue the passes that mark the triangles of a scene in a grid that spans a box.

        Args:
            scene: of which what lies in the box is marked.
            view: [4, 4] from world space to the space of the box.
            unit: scene units; kernels count in such lengths.
            low, high: [3] corners of the box, or the same coordinate along each axis, scene units.
        """
        bounds = np.zeros(VPL_BOX, np.float32)
        bounds[:3], bounds[3:6] = low / unit, high / unit
        if self._bounds is None:
            self._bounds = self.runtime.empty(VPL_BOX, np.float32)
        self._bounds.upload(bounds)
        values = {"lift": MESH_LIFT, "boxes": 1, "segments": 0, "stride": 0}
        empty = self._cleared(unit, values, self._bounds)
        self._voxelize(scene, view, empty)
        return self._filled(empty)

    def _empty(self, array: Callable[[int, type[np.generic]], DeviceArray]) -> tuple[DeviceArray, DeviceArray]:
        return array(self.cells**3 // 16, np.int32), array(BOX, np.float32)

    def _cleared(
        self, unit: float, values: Mapping[str, float], boxes: DeviceArray, bounds: DeviceArray | None = None
    ) -> Occupancy:
        """Queue the pass that empties the grid and places it round boxes and lights."""
        empty = Occupancy(*(self._own or self._empty(self.runtime.transient.array)), self.cells, unit)
        params, cells = OCCUPANCY.pack(values), (self.cells, self.cells)
        self._clear.run(cells, grid=cells, boxes=boxes, bounds=bounds, params=params, **empty.arguments)
        return empty

    def _filled(self, marked: Occupancy) -> Occupancy:
        """Queue the passes that find each block's nearest occupied one."""
        blocks = self.cells // BLOCK
        reach = self.runtime.kernel("occupancy/occupancy_reach.cl", self.macros)
        groups = -(-(blocks**3) // self.runtime.variant.lanes)
        for axis in range(3):
            reach.run((axis, blocks**axis), grid=(1, groups), occupancy=marked.grid)
        return marked

    def _voxelize(self, scene: DeviceScene, view: NDArray[np.float64], into: Occupancy) -> None:
        """Queue the pass that marks the triangles of a scene."""
        # In float64: origin and camera may be far from the world's and near each other.
        turn, shift = view[:3, :3], view[:3, 3]
        from_scene = 1.0 / into.unit * np.column_stack([turn, turn @ scene.origin + shift])
        macros = {**self.macros, "VOXEL_CUTOUT": int(scene.has_cutouts)}
        slices = SLICES if self.runtime.info.kind == "gpu" else 1
        self.runtime.kernel("occupancy/occupancy_voxelize.cl", macros, (TO_VIEW,)).run(
            (scene.vertices, scene.triangles),
            grid=(slices, -(-scene.triangles // self.runtime.variant.lanes)),
            faces=scene.faces,
            vertices=scene.shading,
            uvs=scene.uvs,
            cutouts=scene.cutouts,
            materials=scene.materials,
            textures=scene.textures,
            texels=scene.texels,
            decode=scene.decode,
            turn=packed_to_view(from_scene),
            **into.arguments,
        )

    def _mark_seen(self, gbuffer: DeviceGBuffer, rsms: Sequence[DeviceRsm], camera: Camera, into: Occupancy) -> None:
        """Queue the passes that mark what the camera and the lights see."""
        sources = [(gbuffer.depth, gbuffer.normal, gbuffer.layers, gbuffer.whole, np.eye(3, 4))]
        sources += [(rsm.position, rsm.normal, 0, rsm.size, rsm.to_view(camera)) for rsm in rsms]
        for points, normal, layers, whole, turn in sources:
            macros = {**self.macros, "OCCUPANCY_LAYERS": layers}
            self.runtime.kernel("occupancy/occupancy_pixels.cl", macros, (CAMERA, TO_VIEW)).run(
                whole,
                points=points,
                normal=normal,
                camera=gbuffer.camera_struct,
                per_unit=1.0 / into.unit,
                turn=packed_to_view(turn),
                **into.arguments,
            )


def packed_to_view(matrix: NDArray[np.float64]) -> Any:
    """Return the struct `TO_VIEW` of a [3, 4] matrix."""
    return TO_VIEW.pack(dict(zip((name for name, _ in TO_VIEW.members), matrix.ravel(), strict=True)))
