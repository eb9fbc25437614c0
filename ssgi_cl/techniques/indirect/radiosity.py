"""All bounces of light, and light of emissive surfaces, carried by surfels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import PARTS, Vpls
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import SURFEL_RECORD
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.rasterize.view import device_scene
from ssgi_cl.techniques.indirect.occupancy_grid import GRIDS, SightGrid
from ssgi_cl.techniques.indirect.packed_vpls import VPL, DeviceVpls, VplChooser
from ssgi_cl.techniques.indirect.sky_directions import sky_directions
from ssgi_cl.techniques.indirect.surfels import Surfels, scene_surfels
from ssgi_cl.techniques.indirect.world_vpls import WorldVpls

Doubles = NDArray[np.float64]

START = Struct(
    "StartParams",
    (
        *floats("lift", "per_unit", "shift_x", "shift_y", "shift_z"), ("vertex_stride", "int"),
    ),
)
PILOT = 512
"""Surfels from which it is estimated how many sides of surfaces take part."""
MOST_ROW = 4.0
"""Factor by which form factors of what a surfel sees are raised, at most. Where less of what covers
its hemisphere is visible, the grid is too coarse for the place."""
CONVERGED = 2e-3
"""Of the flux, that bounces still to come have at most."""
MOST_BOUNCES = 1000


@dataclass(frozen=True, kw_only=True)
class RadiosityParams(Params):
    """Parameters of radiosity."""

    surfels: int = param(4096, "pieces that surfaces are divided into, about", low=16, high=1 << 16)
    bounces: int | str = param(
        "all", "reflections on the way from a light to a pixel: 1 or more, or 'all': until those "
        "to come have less than 0.2 % of the flux"
    )
    emission: bool = param(
        True, "the lights that are returned send what surfaces emit, too; False: only what they "
        "reflect, for pixels that emissive surfaces light in another way"
    )
    vpls: int = param(
        4096, "virtual point lights that are chosen from maps to light surfels", low=16,
        high=1 << 20,
    )
    directions: int = param(
        128, "in which a surfel looks for the sky", low=16, high=4096
    )
    grid: int = param(
        128, "cells along a side of the occupancy grid: 32, 64, 128 or 256", low=32, high=256
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.grid not in GRIDS:
            raise ValueError(f"grid is {self.grid}: expected one of {GRIDS} (cells)")
        good = isinstance(self.bounces, int) and not isinstance(self.bounces, bool)
        if not (self.bounces == "all" or (good and int(self.bounces) >= 1)):
            raise ValueError(
                f"bounces is {self.bounces!r}: expected 'all' or an integer >= 1 (reflections)"
            )


class Radiosity(Prepared[RadiosityParams]):
    """Light that surfels send when each has received that of all others.

    After Goral et al. 1984, "Modeling the Interaction of Light Between Diffuse Surfaces", with
    surfels for patches, one visibility ray for each pair, and rows of form factors that sum to
    what the sky leaves of a hemisphere. Surfaces reflect and emit on both sides.

    What depends on the scene alone (surfels, visibility) is kept until another scene comes; the
    light is kept as long as scene, lights and maps stay the same.

    Args:
        runtime: the device.
        params: see `RadiosityParams`.

    Attributes:
        surfels: those of the latest scene that see any surface, or None.
        bounces: reflections that were computed in the latest run.
    """

    def __init__(self, runtime: Runtime, params: RadiosityParams | None = None) -> None:
        self.runtime = runtime
        self._params = params = params or RadiosityParams()
        self._walls = SightGrid(runtime, params.grid, (1, 1))
        self._vpls = DeviceVpls(runtime, -(-params.vpls // 16) * 16)
        self._chooser = VplChooser(runtime, (self._vpls,))
        macros, structs = self._walls.macros, (CAMERA, VPL)

        def kernel(name: str):  # noqa: ANN202
            return runtime.kernel(f"radiosity/radiosity_{name}.cl", macros, structs)

        self._start = runtime.kernel("radiosity/radiosity_start.cl", macros, (CAMERA, VPL, START))
        self._see = kernel("visibility")
        self._sky, self._first = kernel("sky"), kernel("first")
        self._gather = runtime.kernel(
            "radiosity/radiosity_gather.cl", self._walls.macros, structs
        )
        self.surfels: Surfels | None = None
        self.bounces = 0

    @property
    def grid(self) -> SightGrid:
        """The occupancy grid of the latest scene, in the view space of `camera`."""
        return self._walls

    def _set(self, params: RadiosityParams) -> None:
        pass

    # --- the scene

    def _prepare(self, scene: Scene) -> None:
        low, high = scene.bounds
        middle = 0.5 * (low + high)
        half = max(0.5 * float((high - low).max()), 1e-30)
        self.unit = 2.0 ** round(math.log2(half))
        self.camera = Camera.look_at(middle, middle - [0.0, 0.0, 1.0], width=1, height=1)
        self._solid = device_scene(scene, self.runtime)
        self._walls.fill_scene(
            self._solid, self.camera.view, self.unit, half
        )
        self._shift = np.asarray(scene.origin) - middle
        pilot = self._seeing(scene_surfels(scene, PILOT))
        share = max(len(pilot) / PILOT, 0.25)
        self.surfels = self._seeing(
            scene_surfels(scene, max(int(self.params.surfels / share), 2))
        )
        self._upload(self.surfels)
        words = self.stride // 32
        self._visible = self.runtime.empty(words * self.stride, np.int32)
        self._see.run(
            "surfel visibility", (words, self.stride),
            surfels=self._surfels, records=self._flux[0], occupancy=self._walls.grid,
            visible=self._visible,
        )

    def _seeing(self, surfels: Surfels) -> Surfels:
        """Return those that see any surface; no light reaches the others, nor leaves them."""
        if not len(surfels):
            return surfels
        self._upload(surfels)
        self._look_up([])
        open_part = self._seen.download().reshape(4, -1)[3, : len(surfels)]
        part = self._chosen.download()[: len(surfels)]
        return surfels.centred(np.maximum(part, 0)).chosen((open_part < 0.9999) & (part >= 0))

    def _upload(self, surfels: Surfels) -> None:
        """Bring surfels to the device, and find where their rays start."""
        count = len(surfels)
        self.stride = stride = max(-(-count // 32) * 32, 32)
        rows = np.zeros((16, stride), np.float32)
        rows[0:3, :count] = ((surfels.position + self._shift) / self.unit).T
        rows[3:6, :count] = surfels.normal.T
        rows[9, :count] = surfels.area / self.unit**2
        rows[10:13, :count] = surfels.albedo.T
        self.scale = 1.0
        self._rows = rows
        records = np.zeros((stride, SURFEL_RECORD), np.float32)
        records[:, 0:3], records[:, 3], records[:, 4:7] = rows[0:3].T, rows[9], -rows[3:6].T
        self._records = records
        self._surfels = self.runtime.array(rows)
        self._flux = [self.runtime.array(records) for _ in range(2)]
        parts = np.zeros((6, PARTS * stride), np.float32)
        parts[:3, : PARTS * count] = ((surfels.part_position + self._shift) / self.unit).T
        parts[3:, : PARTS * count] = surfels.part_normal.T
        solid, shift = self._solid, self._shift
        chosen = self.runtime.empty(stride, np.int32)
        self._start.run(
            "surfel starts", (solid.triangles, stride), grid=(1, stride // self.runtime.form.lanes),
            parts=self.runtime.array(parts), corners=solid.corners, positions=solid.positions,
            boxes=solid.boxes, cutouts=solid.cutouts, occupancy=self._walls.grid,
            grid_box=self._walls.box, surfels=self._surfels, part=chosen,
            params=START.pack(
                {
                    "lift": self._walls.lift, "per_unit": 1.0 / self.unit, "shift_x": shift[0],
                    "shift_y": shift[1], "shift_z": shift[2],
                    "vertex_stride": solid.vertex_stride,
                }
            ),
        )
        self._chosen = chosen
        self._seen = self.runtime.empty(4 * stride, np.float32)
        self._source = self.runtime.empty(3 * stride, np.float32)
        self._received = self.runtime.empty(3 * stride, np.float32)

    # --- light

    def _look_up(self, environments: Sequence[Environment]) -> None:
        ways, solid, radiance = sky_directions(environments, self.params.directions)
        table = np.zeros((len(ways), 8), np.float32)
        table[:, :3], table[:, 3], table[:, 4:7] = ways, solid, radiance / self.scale
        self._sky.run(
            "surfel sky", (len(ways), self.stride),
            grid=(1, self.stride // self.runtime.form.lanes),
            surfels=self._surfels, directions=self.runtime.array(table),
            occupancy=self._walls.grid, sky=self._seen,
        )

    def solve(
        self, scene: Scene, lights: Sequence[Light], rsms: Sequence[DeviceRsm]
    ) -> Doubles:
        """Return irradiance [surfels, 3]."""
        self._prepare(scene)
        surfels = self.surfels
        assert surfels is not None
        environments = [light for light in lights if isinstance(light, Environment)]
        self._look_up(environments)
        count, stride = len(surfels), self.stride
        sky = self._seen.download().reshape(4, stride)
        self.open = sky[3, :count]
        source = np.zeros((3, stride), np.float32)
        self._source.send(source)
        if rsms:
            self._chooser.place(rsms, self.camera, kinds=1, unit=self.unit)
            self._first.run(
                "surfel first light", (self._vpls.count, stride),
                grid=(1, stride // self.runtime.form.lanes),
                surfels=self._surfels, lights=self._vpls.lights, occupancy=self._walls.grid,
                grid_box=self._walls.box, values=self._source, lift=self._walls.lift,
                gain=self._vpls.values["gain"] / self.scale, number=0,
            )
        source = self._source.download().reshape(3, stride)
        self.punctual = source[:, :count].T.copy()
        exitance = np.zeros((3, stride), np.float32)
        exitance[:, :count] = (math.pi * surfels.emission / self.scale).T
        self._rows[13:16] = exitance
        starts = self._surfels.download().reshape(16, stride)
        starts[13:16] = exitance
        self._surfels.send(starts)
        records = self._records
        records[:, 8:11] = exitance.T * records[:, 3:4]
        self._flux[0].send(records)
        first, later = sky[:3], sky[:3] + source
        most = MOST_BOUNCES if self.params.bounces == "all" else int(self.params.bounces)
        before, delta = None, []
        for bounce in range(1, most + 1):
            self._source.send(np.ascontiguousarray(first if bounce == 1 else later))
            self._gather.run(
                "surfel bounce", (stride // 32, stride),
                grid=(1, stride // self.runtime.form.lanes),
                surfels=self._surfels, before=self._flux[(bounce + 1) % 2], visible=self._visible,
                sky=self._seen, source=self._source, after=self._flux[bounce % 2],
                received=self._received, most=MOST_ROW,
            )
            now = self._received.download().reshape(3, stride)[:, :count].astype(np.float64)
            weight = (surfels.area[:, None] * surfels.albedo).T
            total = float((now * weight).sum())
            if before is not None:
                delta.append(float((np.abs(now - before) * weight).sum()) / max(total, 1e-300))
                if delta[-1] == 0 or (bounce > 3 and delta[-1] < CONVERGED * max(1 - delta[-1]/delta[-2], 0) ):
                    break
            before = now
        self.bounces = bounce
        self.delta = delta
        return now.T * self.scale

    def lights(self, irradiance: Doubles) -> Vpls:
        """Return what surfels send when they receive irradiance [surfels, 3] in W/m^2."""
        surfels = self.surfels
        assert surfels is not None
        origin = surfels.origin
        received = np.repeat(irradiance, PARTS, axis=0)
        exitance = surfels.part_albedo * received
        if self.params.emission:
            exitance += math.pi * surfels.part_emission
        parts = Vpls(
            surfels.part_position + origin, surfels.part_normal,
            surfels.part_area[:, None] * exitance, surfels.part_area,
        )
        flux = parts.flux.reshape(-1, PARTS, 3).sum(axis=1)
        return Vpls(surfels.position + origin, surfels.normal, flux, surfels.area, parts)

    def run(
        self, scene: Scene, lights: Sequence[Light], rsms: Sequence[DeviceRsm]
    ) -> WorldVpls | None:
        self.vpls = self.lights(self.solve(scene, lights, rsms))
        if not self.vpls.flux.any():
            return None
        return WorldVpls(self.runtime, self.vpls, 0.5 * (scene.bounds[0] + scene.bounds[1]))
