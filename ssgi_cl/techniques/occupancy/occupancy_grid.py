"""Occupancy grid: the surfaces of a scene, or what is seen of them, that block shadow rays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.params import param
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.constants import VPL_BOX, VPL_CELLS
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.techniques.vpl_struct import VPL

TURN = Struct("VplTurn", floats("xx", "xy", "xz", "x", "yx", "yy", "yz", "y", "zx", "zy", "zz", "z"))
GRIDS = (32, 64, 128, 256)
MOST_CELLS = 128
"""That are chosen: with 256 view rays take twice the time, and few scenes gain."""
BLOCK = VPL_CELLS
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
    """Return how many cells along a side leave no holes in the surfaces that an image shows.

    The grid is as wide as what is seen, so its cells must be wider than pixels; surfaces that are
    seen at an angle take a half more.
    """
    fitting = [cells for cells in GRIDS if 1.5 * cells <= max(size) and cells <= MOST_CELLS]
    return max(fitting, default=GRIDS[0])


@dataclass(frozen=True, eq=False)
class Occupancy:
    """What blocks rays in the view space of one G-buffer.

    Attributes:
        grid, box: see kernels/vpl/grid.clh.
        cells: along a side.
        lift: cells above their surfaces at which rays begin and end.
        rays: the struct `VPL` of rays through it.
    """

    grid: DeviceArray
    box: DeviceArray
    cells: int
    lift: float
    rays: Any

    @property
    def macros(self) -> dict[str, int]:
        """Of kernels that include kernels/vpl/grid.clh."""
        return {"VPL_GRID": self.cells}


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
        self.macros = {"VPL_GRID": cells}
        self._own = self._empty(runtime.empty) if kept else None
        self._whole: DeviceArray | None = None
        self._clear = runtime.kernel("vpl/vpl_grid.cl", self.macros, (CAMERA, VPL))

    def fill(
        self,
        gbuffer: DeviceGBuffer,
        rsms: Sequence[DeviceRsm],
        boxes: DeviceArray,
        bounds: DeviceArray,
        segments: int,
        size: Size,
        values: dict[str, float],
        scene: DeviceScene | None = None,
    ) -> Occupancy:
        """Queue what marks the surfaces of all layers and of the reflective shadow maps.

        Args:
            gbuffer: of which the margin counts too.
            rsms: any number.
            boxes: bounds of the image's tiles; see kernels/vpl/vpl_boxes.cl.
            bounds, segments: of lights, see `DeviceVpls`; the grid spans them too.
            size: (rows, columns) of the image.
            values: members of the struct `VPL`, those of the lights among them.
            scene: whose triangles are marked in place of what is seen.
        """
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        grid, box = self._own or self._empty(self.runtime.transient.array)
        packed = VPL.pack({**values, "count": segments})
        self._clear.run(
            size, grid=(self.cells, self.cells), boxes=boxes, bounds=bounds, occupancy=grid, grid_box=box, params=packed
        )
        if scene is not None:
            self._voxelize(scene, camera.view, values["per_unit"], grid, box)
        else:
            self._mark_seen(gbuffer, rsms, camera, packed, grid, box)
        margin = {"margin_columns": gbuffer.margin[1], "margin_rows": gbuffer.margin[0]}
        return self._filled(grid, box, LIFT if scene is None else MESH_LIFT, {**values, **margin})

    def fill_scene(self, scene: DeviceScene, view: NDArray[np.float64], unit: float, half: float) -> Occupancy:
        """Queue what marks the triangles of a scene in a grid round the origin of a space.

        Args:
            scene: of which what lies within `half` of the origin along each axis is marked.
            view: [4, 4] from world space to that space.
            unit: scene units; kernels count in such lengths.
            half: scene units.
        """
        bounds = np.zeros(VPL_BOX, np.float32)
        bounds[:3], bounds[3:6] = -half / unit, half / unit
        self._whole = self.runtime.array(bounds)
        grid, box = self._own or self._empty(self.runtime.transient.array)
        none = dict.fromkeys((name for name, _ in VPL.members), 0)
        self._clear.run(
            (1, 1),
            grid=(self.cells, self.cells),
            boxes=self._whole,
            bounds=self._whole,
            occupancy=grid,
            grid_box=box,
            params=VPL.pack(none),
        )
        self._voxelize(scene, view, 1.0 / unit, grid, box)
        return self._filled(grid, box, MESH_LIFT, {**none, "per_unit": 1.0 / unit})

    def _empty(self, array: Callable[[int, type[np.generic]], DeviceArray]) -> tuple[DeviceArray, DeviceArray]:
        return array(self.cells**3 // 16, np.int32), array(4, np.float32)

    def _filled(self, grid: DeviceArray, box: DeviceArray, lift: float, values: dict[str, float]) -> Occupancy:
        """Queue the passes that find each block's nearest occupied one; return all that rays need."""
        blocks = self.cells // BLOCK
        reach = self.runtime.kernel("vpl/vpl_reach.cl", self.macros, (CAMERA, VPL))
        for axis in range(3):
            reach.run((axis, blocks**axis), grid=(1, -(-(blocks**3) // self.runtime.variant.lanes)), occupancy=grid)
        return Occupancy(grid, box, self.cells, lift, VPL.pack({**values, "lift": lift}))

    def _voxelize(
        self, scene: DeviceScene, view: NDArray[np.float64], per_unit: float, grid: DeviceArray, box: DeviceArray
    ) -> None:
        """Queue the pass that marks the triangles of a scene."""
        # In float64: origin and camera may be far from the world's and near each other.
        turn, shift = view[:3, :3], view[:3, 3]
        from_scene = per_unit * np.column_stack([turn, turn @ scene.origin + shift])
        macros = {**self.macros, "VOXEL_CUTOUT": int(scene.has_cutouts)}
        slices = SLICES if self.runtime.info.kind == "gpu" else 1
        self.runtime.kernel("vpl/vpl_voxelize.cl", macros, (CAMERA, VPL, TURN)).run(
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
            grid_box=box,
            occupancy=grid,
            turn=packed_turn(from_scene),
        )

    def _mark_seen(
        self,
        gbuffer: DeviceGBuffer,
        rsms: Sequence[DeviceRsm],
        camera: Camera,
        packed: Any,
        grid: DeviceArray,
        box: DeviceArray,
    ) -> None:
        """Queue the passes that mark what the camera and the lights see."""
        sources = [(gbuffer.depth, gbuffer.normal, gbuffer.layers, gbuffer.whole, np.eye(3, 4))]
        sources += [(rsm.position, rsm.normal, 0, rsm.size, rsm.to_view(camera)) for rsm in rsms]
        for points, normal, layers, whole, turn in sources:
            kernel = self.runtime.kernel(
                "vpl/vpl_occupy.cl", {**self.macros, "VPL_LAYERS": layers}, (CAMERA, VPL, TURN)
            )
            kernel.run(
                whole,
                points=points,
                normal=normal,
                grid_box=box,
                occupancy=grid,
                camera=gbuffer.camera_struct,
                params=packed,
                turn=packed_turn(turn),
            )


def packed_turn(turn: NDArray[np.float64]) -> Any:
    """Return the struct `TURN` of a [3, 4] matrix."""
    return TURN.pack(dict(zip((name for name, _ in TURN.members), turn.ravel(), strict=True)))
