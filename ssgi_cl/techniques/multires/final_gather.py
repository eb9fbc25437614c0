"""Final gather: irradiance at the points of a level by rays over the hemisphere to lit surfaces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.constants import SSGI_GROUP
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.rasterize.raster.scene_bvh import MANY
from ssgi_cl.techniques.multires.multires_grid import Level
from ssgi_cl.techniques.occupancy.scene_rays import SCENE_RAYS, SceneRays
from ssgi_cl.techniques.radiosity.light_volume import LightVolume, device_volume
from ssgi_cl.techniques.vpl.packed_vpls import VPL, packed_params
from ssgi_cl.techniques.vpl.vpl_tree import CPU_ITEMS

GATHER = Struct(
    "GatherParams", (*floats("per_cell", "cell_x", "cell_y", "cell_z", "reach"), *ints("columns_on", "rows_on"))
)
REACH = 1.01
"""Length of rays, in diagonals of the scene's box."""
PLACES = 16
"""Places along a pixel's side that differ in their rays."""
LEAST = 3
"""Rays of a point, at least."""


class Effort(NamedTuple):
    """How much a scene's rays are worth.

    Attributes:
        shares: parts of the rays asked for that points of the coarsest level have, of those of the next ones, the last
            of all finer, whose values frames blur.
        between: error of interpolation allowed, in parts of that of lights. More points with fewer rays err less in the
            same time: with 1 foots of walls had dark and light lumps.
    """

    shares: tuple[float, ...]
    between: float


OF_FEW = Effort((1.0, 0.45, 0.18, 0.1, 0.06), 0.15)
"""In scenes of up to `MANY` triangles. With .3 and the last two shares .042 and .03 FLIP of `cornell_box`,
`window-300` and `cornell_box-spot` is .0497, .0606 and .0423 in place of .0484, .0599 and .0408 (400 x 300, 256
paths), and the foot of the dark box has lumps; kept frames take .85 to 1 times as long."""
OF_MANY = Effort((0.7, 0.315, 0.126, 0.0294, 0.021), 0.3)
"""In others, where a ray takes several times as long. With .71, 1 and 1.4 times these shares FLIP at 400 x 300
against 256 paths is .123, .119 and .115 in `hall`, .095, .094 and .092 in `workshop`; kept frames take .95 and 1.18
times the processor time of those with 1 in `hall`, .93 and 1.16 times in `workshop`."""
DEALT, MOST_DEALT, MOST_RAYS = 16, 1 << 14, 256
"""Work-items of a GPU that share a point's rays, where there are no more points and rays: these would not fill it."""
RAYS_AT_ONCE = 1 << 24
"""Rays of a launch on a GPU: at 1,800 operations, those of a ray among 36 triangles, .03 s at 1 TFLOP/s. A display's
driver ends what takes 2 s, and large scenes take several times as long."""
FOUND = 5
"""Images of what rays find at points that are smoothed: irradiance, the mean of 1 / distance, and how many rays."""


def tile_turn(camera: Camera) -> tuple[int, int]:
    """Return the columns and rows that tiles are moved by.

    Pictures of other places within the pixels have other rays, so that their mean has less noise; a camera that
    moves keeps them.
    """
    place = 0.5 * np.array([camera.width, camera.height]) * camera.projection[:2, 2]
    right, down = np.rint(place * PLACES).astype(int).tolist()
    turn = (right * 5 + down * 11) % (TILE * TILE)
    return turn % TILE, turn // TILE


class FinalGather:
    """Irradiance at points by rays to the surfaces that they meet first, whose radiance a volume has.

    After Reichert 1992, "A Two-Pass Radiosity Method Driven by Lights and Viewer Position". Departs: radiance is the
    mean of the surfaces in a cell of a volume that face the same way.

    Args:
        runtime: the device.
        rays: that points have shares of, `LEAST` or more (`hemisphere_ways`).

    Attributes:
        effort: that of the scene entered.
    """

    def __init__(self, runtime: Runtime, rays: int) -> None:
        self.runtime = runtime
        self._rays = rays
        self._ways: dict[int, tuple[int, DeviceArray]] = {}
        self.effort = OF_FEW
        self._volume: LightVolume | None = None
        self._found: dict[int, Plane] = {}
        self._cells = self._records = runtime.array(np.zeros(1, np.float32))

    def enter(self, scene: Scene, volume: LightVolume, camera: Camera) -> None:
        """Upload the light of a scene's surfaces, unless it is that of the latest call."""
        if volume is not self._volume:
            self._volume = volume
            self._cells, self._records = device_volume(self.runtime, volume)
        self.effort = OF_MANY if len(scene.triangles) > MANY else OF_FEW
        x, y, z = ((np.asarray(scene.origin) - volume.low) / volume.side).tolist()
        columns_on, rows_on = tile_turn(camera)
        self._params = GATHER.pack(
            {
                "per_cell": 1.0 / volume.side,
                "cell_x": x,
                "cell_y": y,
                "cell_z": z,
                "reach": REACH * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))),
                "columns_on": columns_on,
                "rows_on": rows_on,
            }
        )

    def shine(self, level: Level, rays: SceneRays, per_unit: float) -> None:
        """Queue the passes that add shares of the irradiance of a level's points to its values.

        What is found at points of all levels but the last is smoothed by a line fitted to neighbours that this
        level or a coarser one computes too (kernels/multires/gather_smooth.cl).

        Args:
            level: of the points.
            rays: through the scene, from view space in units of which scene units have `per_unit`.
            per_unit: see `rays`.
        """
        shares = self.effort.shares
        kept = level.step > 1 and level.number < len(shares) - 1
        found = self._found.get(level.number)
        if kept and (found is None or found.size != level.size):
            found = self._found[level.number] = self.runtime.plane(FOUND, level.size)
        if kept and level.number > 0:
            coarser = self._found[level.number - 1]
            self.runtime.kernel("multires/gather_nested.cl", {"GATHER_FOUND": FOUND}).run(
                level.size, coarser=coarser, found=found, coarse=coarser.size
            )
        values = found if kept else level.values
        most = max(int(shares[min(level.number, len(shares) - 1)] * self._rays), LEAST)
        if most not in self._ways:
            directions = hemisphere_ways(most)
            self._ways[most] = len(directions), self.runtime.array(directions)
        count, ways = self._ways[most]
        few = self.runtime.info.kind == "gpu" and level.most <= MOST_DEALT and count <= MOST_RAYS
        pieces = -(-level.most // self.runtime.variant.lanes)
        at_once = max(RAYS_AT_ONCE // count, 1) if self.runtime.info.kind == "gpu" else pieces
        for begin in range(0, pieces, at_once):
            own = min(at_once, pieces - begin)
            self._run(
                level,
                "multires/final_gather.cl",
                {
                    "GATHER_RAYS": count,
                    "GATHER_KEPT": int(kept),
                    "GATHER_ITEMS": DEALT if few else 1,
                    **rays.bvh.first_macros,
                },
                (SCENE_RAYS, GATHER),
                per_unit,
                own * (DEALT if few else 1),
                SSGI_GROUP if few else 1,
                ways=ways,
                **{**rays.arguments, **rays.bvh.first},
                cells=self._cells,
                volume=self._records,
                values=values,
                gather=self._params,
                begin=begin,
                most=own,
            )
        if kept:
            more = {"found": found, "values": level.values}
            self._run(level, "multires/gather_smooth.cl", {}, (), per_unit, pieces, 1, **more)

    def _run(
        self,
        level: Level,
        name: str,
        macros: dict[str, int],
        structs: tuple[Struct, ...],
        per_unit: float,
        wanted: int,
        group: int,
        **more: Any,
    ) -> None:
        """Queue a kernel that takes points on a level's list, by so many work-items in groups of a size; 1: any."""
        runtime, source = self.runtime, level.source
        is_gpu = runtime.info.kind == "gpu"
        items = 1 << 30 if is_gpu else CPU_ITEMS * runtime.device.max_compute_units
        runtime.kernel(name, macros, (CAMERA, VPL, *structs)).run(
            source.size,
            grid=(1, min(wanted, items)),
            local=runtime.small_groups(1) if group == 1 else (1, group),
            depth=source.depth,
            normal=source.normal,
            list=level.list,
            fractions=level.fractions,
            camera=source.camera_struct,
            params=packed_params({"per_unit": per_unit}, source.margin),
            **more,
        )
