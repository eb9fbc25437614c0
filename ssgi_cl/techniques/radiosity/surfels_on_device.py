"""Surfels in device memory: their visibility and irradiance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PunctualLight
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
from ssgi_cl.techniques.radiosity.landings import landings
from ssgi_cl.techniques.radiosity.light_volume import CELLS
from ssgi_cl.techniques.radiosity.lit_points import LitPoints
from ssgi_cl.techniques.radiosity.many_lights import traced_lights
from ssgi_cl.techniques.radiosity.sky_directions import sky_directions
from ssgi_cl.techniques.radiosity.start_triangles import StartTriangles
from ssgi_cl.techniques.radiosity.surface_cells import Pieces
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.radiosity.surfels import Surfels, TriangleShares, lit_surfels, scene_surfels
from ssgi_cl.techniques.radiosity.triangle_rays import TriangleRays
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
"""Part of the pilot's surfels that a space has at least of which what punctual lights shine on tells whether light
enters it: lights that move would open and close the smaller ones."""
RAYS = 1024
"""Rays to virtual point lights that a surfel traces, about."""
OPEN = 0.9999
"""Unoccluded share of the hemisphere from which on a surfel sees no surface."""
LEAST_LIT = 0.1
"""Part of a surfel that light reaches, at least, after its triangles have moved."""
MOST_ROW = 1.5
"""Factor by which form factors of what a surfel sees are raised, at most. Where less of what covers
its hemisphere is visible, the grid is too coarse for the place, and what is visible may be seen
through a leak."""


class Spaces(NamedTuple):
    """Spaces of a scene's air.

    Attributes:
        lit: those that light certainly enters.
        dark: those of many surfaces that no light enters, by the grid.
    """

    lit: frozenset[int]
    dark: frozenset[int]


class _Sight(NamedTuple):
    """What surfels see.

    Attributes:
        sees: [surfels] whether they see any surface.
        part: [surfels] above which of their parts rays start, -1 where there is no room above any.
        starts: [surfels, 3] where rays start, in cells.
    """

    sees: NDArray[np.bool_]
    part: NDArray[np.int32]
    starts: Floats


class DeviceSurfels:
    """The surfels of a scene, which of them see which, and irradiance.

    Args:
        runtime: the device.
        cells: of the occupancy grid, along a side.

    Attributes:
        surfels: what is in device memory; `fill` sets it.
        camera: at the middle of the scene, along the world's axes: kernels count from there.
        unit: scene units of the length in which they count.
        unlit: of surfaces that no light reaches.
        narrow: emissive ones left out as they have no room in front of them.
        cramped: [surfels] which of those in device memory have none either, or are landings.
    """

    surfels: Surfels
    unlit: Pieces
    narrow: Surfels
    cramped: NDArray[np.bool_]
    camera: Camera
    unit: float
    _lit: LitPoints | None = None  # of scenes without holes alone
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
        self._lit = None
        if exact:
            low = self._box[:3] * self.unit - self._shift
            side = self.unit / float(self._box[3])
            self._lit = LitPoints(TriangleRays(self.runtime, scene), self._air, low.astype(np.float64), side, self.room)
        self._pilot = pilot = scene_surfels(scene, PILOT, self._shares)
        sight = self._look(pilot, solid)
        there = np.flatnonzero(sight.sees & (sight.part >= 0))
        spaces = self._air.at(sight.starts[there])
        emits = pilot.emission[there].any(axis=1)
        self._emitting = frozenset(spaces[emits].tolist())
        self._of_pilot = np.bincount(spaces, minlength=int(self._air.numbers.max()) + 1)
        self._pilot_sees = sight.sees

    @property
    def room(self) -> float:
        """Scene units that surfels have in front of them."""
        return float(self._box[4] / self._box[3]) * self.unit

    def is_lit(self, points: Doubles, dark: frozenset[int]) -> NDArray[np.bool_]:
        """Return which of points [n, 3] of world space lie in empty cells of spaces other than `dark`."""
        lit = np.ones(len(self._of_pilot), np.bool_)
        lit[[0, *dark]] = False
        return lit[self._spaces_at(points)]

    def spaces(self, lights: Floats | None, punctual: Sequence[PunctualLight], *, sky: bool) -> Spaces:
        """Return which spaces of the scene's air light enters.

        Args:
            lights: records of those that `camera` sees, counted in `unit`: what punctual lights
                shine on.
            punctual: those lights, as far as they are known.
            sky: whether environments shine.
        """
        places = np.array([light.position for light in punctual if not isinstance(light, DirectionalLight)])
        beside = self._spaces_at(places) if len(places) else np.zeros(0, np.int32)
        outside = sky or any(isinstance(light, DirectionalLight) for light in punctual)
        certain = self._emitting | frozenset(beside.tolist()) | (self._air.outside if outside else frozenset())
        lit = self._emitting | (self._air.outside if sky else frozenset())
        if lights is not None:
            where = self._air.at(self._lit_points(lights))
            if np.count_nonzero(where) <= len(where) // 2:  # the grid is too coarse to tell
                return Spaces(frozenset(range(1, len(self._of_pilot))), frozenset())
            lit |= frozenset(np.unique(where).tolist())
        large = frozenset(np.flatnonzero(self._of_pilot >= ROOM * PILOT).tolist())
        return Spaces(certain | (large & lit) - {0}, large - lit - {0})

    def _spaces_at(self, points: Doubles) -> NDArray[np.int32]:
        """Return [n] the spaces that points [n, 3] of world space lie in, 0 in occupied cells."""
        return self._air.at(self._in_cells((points - self.camera.position) / self.unit))

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

    def fill(self, scene: Scene, count: int, spaces: Spaces, history: SurfelHistory) -> None:
        """Replace the contents by about `count` surfels of the scene, and some where rays from these land.

        Args:
            scene: that `enter` took.
            count: of surfels.
            spaces: which of them get surfels.
            history: that `enter` took, whose surfels follow the scene.
        """
        solid = device_scene(scene, self.runtime)
        if self._lit is not None:
            self._lit.enter(spaces.lit, self._pilot.part_position, self._pilot.part_normal)
        moved = history.moved(scene)
        if moved is not None:
            lit = None if self._lit is None else self._lit_share(moved) >= LEAST_LIT
            surfels, there, sight = self._chosen(moved, solid, spaces, lit)
            if history.suits(there):
                if self._lit is None:
                    return self._enter(surfels.chosen(there), sight.starts[there])
                # Rays start from surfaces, so that surfels that see nothing now need no room in front of them.
                there = history.joined(there)
                return self._enter(surfels.chosen(there), None, sight.part[there] < 0)
        wanted = int(count / max(self._share(spaces), LEAST_SHARE))
        if self._lit is None:
            tried, there, sight = self._chosen(scene_surfels(scene, wanted, self._shares), solid, spaces)
            return self._enter(history.begin(scene, tried, there), sight.starts[there])
        made = lit_surfels(scene, wanted, self._lit.reached, self._shares, others=history.follows)
        own = made.surfels.chosen(np.flatnonzero(made.lit))
        tried, there, sight = self._chosen(own, solid, spaces, np.ones(len(own), np.bool_))
        low, side = self.camera.position - self.half, 2.0 * self.half / CELLS
        more = landings(self._lit.rays, tried.chosen(there), low, side, self._lit.closed)
        cramped = np.concatenate([sight.part[there] < 0, np.ones(len(more), np.bool_)])
        there = np.concatenate([there, len(tried) + np.arange(len(more))])
        self.unlit = Pieces(made.unlit_position, made.unlit_normal, made.unlit_area)
        tried = tried.with_more(more).with_more(made.surfels.chosen(np.flatnonzero(~made.lit))).numbered()
        return self._enter(history.begin(scene, tried, there), None, cramped)

    def _share(self, spaces: Spaces) -> float:
        """Return the part of the pilot's surfels that take part."""
        if self._lit is None:
            return float(self._of_pilot.sum() - self._of_pilot[list(spaces.dark)].sum()) / PILOT
        return float((self._pilot_sees * self._lit_share(self._pilot)).sum()) / PILOT

    def _lit_share(self, surfels: Surfels) -> Doubles:
        """Return which part of surfels light reaches, by area."""
        assert self._lit is not None  # noqa: S101  asked for of scenes without holes alone
        lit = self._lit.reached(surfels.part_position, surfels.part_normal, surfels.part_number)
        return surfels.mean_of_parts(lit[:, None].astype(np.float64))[:, 0]

    def _enter(self, surfels: Surfels, starts: Floats | None, cramped: NDArray[np.bool_] | None = None) -> None:
        """Take surfels, the starts of their rays where these are known, and which are cramped."""
        self.surfels = surfels
        self.cramped = np.zeros(len(surfels), np.bool_) if cramped is None else cramped
        self._upload(surfels, starts)
        self._visible = None

    def _chosen(
        self, surfels: Surfels, solid: DeviceScene, spaces: Spaces, lit: NDArray[np.bool_] | None = None
    ) -> tuple[Surfels, NDArray[np.intp], _Sight]:
        """Return surfels that begin with the parts from which rays start, the numbers of those that take part, and
        what all see.

        Those that see no surface do not, as no light reaches them nor leaves them, and those that no light reaches. In
        scenes with holes these face a space that is dark, or have no room in front of them; in others `lit` says which
        it does reach. Emissive ones without room take no part either.
        """
        if not len(surfels):
            self.unlit, self.narrow = Pieces.none(), surfels
            none = np.zeros(0, np.intp)
            return surfels, none, _Sight(none > 0, none.astype(np.int32), np.zeros((0, 3), np.float32))
        sight = self._look(surfels, solid)
        room, emits = sight.part >= 0, surfels.emission.any(axis=1)
        self.narrow = surfels.chosen(np.flatnonzero(~room & emits))
        sees = sight.sees & (room if lit is None else room | ~emits)
        kept = sees & (~np.isin(self._air.at(sight.starts), list(spaces.dark)) if lit is None else lit)
        self.unlit = Pieces.of(surfels.chosen(np.flatnonzero(sees & ~kept)))
        return surfels.centred(np.maximum(sight.part, 0)), np.flatnonzero(kept), sight

    def _look(self, surfels: Surfels, solid: DeviceScene) -> _Sight:
        """Return what surfels see."""
        self._upload(surfels)
        part = self._find_starts(surfels, solid)
        self.look_up(*sky_directions((), PILOT_DIRECTIONS))
        opened = self._seen.download().reshape(4, -1)[3, : len(surfels)]
        starts = self._rows.download().reshape(ROWS, -1)[START_ROWS, : len(surfels)]
        return _Sight(opened < OPEN, part, starts.T)

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
