"""Surfels in device memory: their visibility and irradiance."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import FIRST_GROUP, SURFEL_RECORD
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct, floats
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.occupancy.occupancy_grid import OccupancyGrid
from ssgi_cl.techniques.occupancy.scene_rays import SCENE_RAYS, SceneRays, rays_meet_triangles
from ssgi_cl.techniques.radiosity.air import Air
from ssgi_cl.techniques.radiosity.many_lights import traced_lights
from ssgi_cl.techniques.radiosity.sky_directions import sky_directions
from ssgi_cl.techniques.radiosity.start_triangles import StartTriangles
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.radiosity.surfels import Surfels, TriangleShares, scene_surfels
from ssgi_cl.techniques.vpl.packed_vpls import DeviceVpls, power_of_two

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

START = Struct("StartParams", (*floats("per_unit", "shift_x", "shift_y", "shift_z"), ("vertex_stride", "int")))
ROWS = 16
START_ROWS = slice(6, 9)
"""Rows of a surfel, and those of the start of its rays: kernels/radiosity/surfel.clh."""
PILOT = 512
"""Surfels from which the share of surface sides that take part is estimated."""
LEAST_SHARE = 0.25
"""Least such share."""
PILOT_DIRECTIONS = 32
"""Directions in which a surfel of the pilot looks for any surface."""
ROOM = 0.02
"""Part of the pilot's surfels that a space has at least which is left out where no light enters it: lights that
move would open and close the smaller ones, and light enters some of them through gaps that the grid closes. Without
those FLIP of `hall` is .005 lower, but that of `veach_ajar` .04 higher (400 x 300)."""
RAYS = 1024
"""Rays to virtual point lights that a surfel traces, about."""
OPEN = 0.9999
"""Unoccluded share of the hemisphere from which on a surfel sees no surface."""
MOST_ROW = 1.5
"""Factor by which form factors of what a surfel sees are raised, at most. Where less of what covers
its hemisphere is visible, the grid is too coarse for the place, and what is visible may be seen
through a leak."""


class DeviceSurfels:
    """The surfels of a scene, which of them see which, and irradiance.

    Args:
        runtime: the device.
        cells: of the occupancy grid, along a side.

    Attributes:
        surfels: what is in device memory; `fill` sets it.
        camera: at the middle of the scene, along the world's axes: kernels count from there.
        unit: scene units of the length in which they count.
        unlit: those left out as they face spaces that no light enters.
        narrow: emissive ones left out as they have no room in front of them.
    """

    surfels: Surfels
    unlit: Surfels
    narrow: Surfels
    camera: Camera
    unit: float
    _visible: DeviceArray | None = None

    def __init__(self, runtime: Runtime, cells: int) -> None:
        self.runtime = runtime
        self._grid = OccupancyGrid(runtime, cells, (1, 1))
        macros = self._grid.macros
        self._start = runtime.kernel("radiosity/radiosity_start.cl", macros, (START,))
        self._mirror = runtime.kernel("radiosity/radiosity_mirror.cl")
        self._see = runtime.kernel("radiosity/radiosity_visibility.cl", macros)
        self._first = runtime.kernel("radiosity/radiosity_first.cl", macros)
        self._gather = runtime.kernel("radiosity/radiosity_gather.cl", macros)

    def enter(self, scene: Scene, history: SurfelHistory) -> None:
        """Make the occupancy grid of a scene and the spaces of its air; surfels follow with `fill`.

        `history` says which cube they lie in.
        """
        history.enter(scene)
        middle, half = history.middle, history.half
        self.half = half
        self.unit = power_of_two(half)
        self.camera = Camera.look_at(middle, middle - [0.0, 0.0, half], width=1, height=1)
        self._shift = np.asarray(scene.origin) - middle
        solid = device_scene(scene, self.runtime)
        self._occupancy = occupancy = self._grid.fill_scene(solid, self.camera.view, self.unit, -half, half)
        self._box = occupancy.box.download()
        exact = rays_meet_triangles(scene)
        rays = SceneRays(self.runtime, scene, self.camera.view, self.unit) if exact else None
        self._rays = rays
        macros = {**self._grid.macros, "SURFEL_RAYS": int(rays is not None)}
        self._sky = self.runtime.kernel("radiosity/radiosity_sky.cl", macros, (SCENE_RAYS,))
        self._near = StartTriangles.of(self.runtime, scene, solid)
        self._shares = TriangleShares.of(scene)
        self._air = Air.of(occupancy.grid.download(), occupancy.cells)
        pilot = scene_surfels(scene, PILOT, self._shares)
        _, there, starts = self._seeing(pilot, solid)
        spaces = self._air.at(starts)
        emits = pilot.emission[there].any(axis=1)
        self._emitting = frozenset(spaces[emits].tolist())
        self._of_pilot = np.bincount(spaces, minlength=int(self._air.numbers.max()) + 1)

    @property
    def room(self) -> float:
        """Scene units that surfels have in front of them."""
        return float(self._box[4] / self._box[3]) * self.unit

    def is_lit(self, points: Doubles, dark: frozenset[int]) -> NDArray[np.bool_]:
        """Return which of points [n, 3] of world space lie in empty cells of spaces other than `dark`."""
        space = self._air.at(self._in_cells((points - self.camera.position) / self.unit))
        return (space > 0) & ~np.isin(space, list(dark))

    def dark(self, lights: Floats | None, *, sky: bool) -> frozenset[int]:
        """Return the spaces of the scene's air that no light enters, small ones left out.

        Args:
            lights: records of those that `camera` sees, counted in `unit`: what punctual lights
                shine on.
            sky: whether environments shine.
        """
        lit = self._emitting | (self._air.outside if sky else frozenset())
        if lights is not None:
            where = self._air.at(self._lit_points(lights))
            if np.count_nonzero(where) <= len(where) // 2:  # the grid is too coarse to tell
                return frozenset()
            lit |= frozenset(np.unique(where).tolist())
        large = np.flatnonzero(self._of_pilot >= ROOM * PILOT)
        return frozenset(large.tolist()) - lit - {0}

    def _lit_points(self, lights: Floats) -> Floats:
        """Return [n, 3] points above the lights that shine, in cells of the grid."""
        shining = lights[lights[:, 8:11].any(axis=1)]
        lift = self._box[4] * shining[:, 4:7]  # their normals, turned round
        points: Floats = self._in_cells(shining[:, :3]) - lift
        return points

    def _in_cells(self, points: NDArray[Any]) -> NDArray[Any]:
        """Return points [n, 3] that `camera` sees, counted in `unit`, in cells of the grid."""
        found: NDArray[Any] = (points - self._box[:3]) * self._box[3]
        return found

    def fill(self, scene: Scene, count: int, dark: frozenset[int], history: SurfelHistory) -> None:
        """Replace the contents by about `count` surfels of the scene.

        Args:
            scene: that `enter` took.
            count: of surfels.
            dark: spaces that get none.
            history: that `enter` took, whose surfels follow the scene.
        """
        solid = device_scene(scene, self.runtime)
        moved = history.moved(scene)
        if moved is not None:
            _, there, starts = self._seeing(moved, solid, dark)
            if history.suits(there):
                if self._rays is None:
                    return self._enter(moved.chosen(there), starts)
                # Rays start from surfaces, so that surfels that see nothing now need no room in front of them.
                return self._enter(moved.chosen(history.joined(there)), None)
        without = self._of_pilot[list(dark)].sum()
        share = max((self._of_pilot.sum() - without) / PILOT, LEAST_SHARE)
        tried, there, starts = self._seeing(scene_surfels(scene, int(count / share), self._shares), solid, dark)
        return self._enter(history.begin(scene, tried, there), starts)

    def _enter(self, surfels: Surfels, starts: Floats | None) -> None:
        """Take surfels, and the starts of their rays where these are known."""
        self.surfels = surfels
        self._upload(surfels, starts)
        self._visible = None

    def _seeing(
        self, surfels: Surfels, solid: DeviceScene, dark: frozenset[int] = frozenset()
    ) -> tuple[Surfels, NDArray[np.intp], Floats]:
        """Return surfels that begin with the parts from which rays start, the numbers of those that see any surface,
        and where the rays of these start: [n, 3] in cells.

        No light reaches the others, nor leaves them. Those without room in front of them are left
        out, too, and those that face a space in `dark`.
        """
        if not len(surfels):
            self.unlit = self.narrow = surfels
            return surfels, np.zeros(0, np.intp), np.zeros((0, 3), np.float32)
        self._upload(surfels)
        part = self._find_starts(surfels, solid)
        self.look_up(*sky_directions((), PILOT_DIRECTIONS))
        opened = self._seen.download().reshape(4, -1)[3, : len(surfels)]
        starts = self._rows.download().reshape(ROWS, -1)[START_ROWS, : len(surfels)]
        kept = (opened < OPEN) & (part >= 0)
        self.narrow = surfels.chosen(np.flatnonzero((part < 0) & surfels.emission.any(axis=1)))
        unlit = kept & np.isin(self._air.at(starts.T), list(dark))
        self.unlit = surfels.chosen(np.flatnonzero(unlit))
        kept &= ~unlit
        return surfels.centred(np.maximum(part, 0)), np.flatnonzero(kept), starts[:, kept].T

    def _upload(self, surfels: Surfels, starts: Floats | None = None) -> None:
        """Upload surfels, and the starts of their rays where these are known."""
        runtime, shift, count = self.runtime, self._shift, len(surfels)
        self._count = count
        self._stride = stride = max(-(-count // 32) * 32, 32)
        rows = np.zeros((ROWS, stride), np.float32)
        rows[0:3, :count] = ((surfels.position + shift) / self.unit).T
        rows[3:6, :count] = surfels.normal.T
        if starts is not None:
            rows[START_ROWS, :count] = starts.T
        rows[9, :count] = surfels.area / self.unit**2
        rows[10:13, :count] = surfels.albedo.T
        self._rows = runtime.array(rows)
        records = np.zeros((stride, SURFEL_RECORD), np.float32)
        records[:, 0:3], records[:, 3], records[:, 4:7] = rows[0:3].T, rows[9], -rows[3:6].T
        self._records = records
        self._flux = [runtime.array(records), runtime.array(records)]
        self._seen = runtime.empty(4 * stride, np.float32)
        self._values = runtime.empty(3 * stride, np.float32)
        self._received = runtime.empty(3 * stride, np.float32)

    def _find_starts(self, surfels: Surfels, solid: DeviceScene) -> NDArray[np.int32]:
        """Return above which part the rays of surfels start, or -1; the device has where, then."""
        runtime, occupancy, shift, count = self.runtime, self._occupancy, self._shift, len(surfels)
        stride, near = self._stride, self._near
        parts = np.zeros((6, PARTS * stride), np.float32)
        parts[:3, : PARTS * count] = ((surfels.part_position + shift) / self.unit).T
        parts[3:, : PARTS * count] = surfels.part_normal.T
        chosen = runtime.empty(stride, np.int32)
        values = {
            "per_unit": 1.0 / self.unit,
            "vertex_stride": solid.vertex_stride,
            **{f"shift_{axis}": float(shift[i]) for i, axis in enumerate("xyz")},
        }
        self._start.run(
            (solid.triangles, stride),
            grid=(1, stride // runtime.variant.lanes),
            parts=runtime.array(parts),
            corners=near.corners,
            positions=solid.positions,
            boxes=near.boxes,
            few=near.few,
            cutouts=near.cutouts,
            **occupancy.arguments,
            surfels=self._rows,
            part=chosen,
            params=START.pack(values),
        )
        part: NDArray[np.int32] = chosen.download()[:count]
        return part

    def look_up(self, ways: Doubles, solid: Doubles, radiance: Doubles) -> Floats:
        """Return irradiance [surfels, 3] by the sky; `gather` needs what is found out.

        Args:
            ways, solid, radiance: see `sky_directions`.
        """
        table = np.zeros((len(ways), 8), np.float32)
        table[:, :3], table[:, 3], table[:, 4:7] = ways, solid, radiance
        self._sky.run(
            (len(ways), self._stride),
            grid=(1, self._stride // self.runtime.variant.lanes),
            surfels=self._rows,
            directions=self.runtime.array(table),
            **({"occupancy": self._occupancy.grid} if self._rays is None else self._rays.arguments),
            sky=self._seen,
        )
        return self._of_surfels(self._seen.download())

    def gather_lights(self, lights: DeviceVpls, records: Floats, gain: float) -> Floats:
        """Return irradiance [surfels, 3] by lights that `camera` sees, counted in `unit`."""
        runtime, own_records = self.runtime, self._records[: self._count]
        own, weight = traced_lights(own_records[:, :3], -own_records[:, 4:7], records, RAYS)
        groups, most = own.shape
        # Past the last surfel the lanes have a group, too.
        numbers = np.full((self._stride // FIRST_GROUP, most), -1, np.int32)
        weights = np.zeros(numbers.shape, np.float32)
        numbers[:groups], weights[:groups] = own, weight
        self._first.run(
            (most, self._stride),
            grid=(1, self._stride // runtime.variant.lanes),
            surfels=self._rows,
            lights=lights.lights,
            numbers=runtime.array(numbers),
            weights=runtime.array(weights),
            **self._occupancy.arguments,
            values=self._values,
            gain=gain,
        )
        return self._of_surfels(self._values.download())

    def begin(self, exitance: Floats) -> None:
        """Set what surfels send to their emitted exitance [surfels, 3], once it is known which see each other."""
        if self._visible is None:
            words = self._stride // 32
            self._visible = self.runtime.empty(words * self._stride, np.int32)
            self._see.run(
                (words, self._stride),
                surfels=self._rows,
                records=self._flux[0],
                occupancy=self._occupancy.grid,
                visible=self._visible,
            )
            self._mirror.run((words, self._stride), visible=self._visible)
        own = np.zeros((3, self._stride), np.float32)
        own[:, : len(exitance)] = exitance.T
        rows = self._rows.download().reshape(ROWS, -1)
        rows[13:16] = own
        self._rows.send(rows)
        self._records[:, 8:11] = own.T * self._records[:, 3:4]
        self._flux[0].send(self._records)

    def gather(self, source: Floats) -> Floats:
        """Return irradiance [surfels, 3] by what surfels send now, and by a source besides.

        They then send what they emit, and what they reflect of it.
        """
        values = np.zeros((3, self._stride), np.float32)
        values[:, : len(source)] = source.T
        self._values.send(values)
        self._gather.run(
            (self._stride // 32, self._stride),
            grid=(1, self._stride // self.runtime.variant.lanes),
            surfels=self._rows,
            before=self._flux[0],
            visible=self._visible,
            sky=self._seen,
            source=self._values,
            after=self._flux[1],
            received=self._received,
            most=MOST_ROW,
        )
        self._flux.reverse()
        return self._of_surfels(self._received.download())

    def _of_surfels(self, rows: Floats) -> Floats:
        """Return [surfels, 3] of the first three rows."""
        return rows.reshape(-1, self._stride)[:3, : self._count].T.copy()
