"""Rays from the parts of surfels: light from surface to surface, found where it arrives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.lights import DirectionalLight, PunctualLight, SpotLight, light_extent
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene, mean_emission
from ssgi_cl.core.vpls import LUMINANCE, Vpls
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import DIRECT_LIGHT
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.light_volume import LightVolume, device_volume
from ssgi_cl.techniques.radiosity.surface_cells import Planes, SurfaceCells
from ssgi_cl.techniques.radiosity.surfels import Surfels
from ssgi_cl.techniques.radiosity.triangle_rays import REACH, ROW, diagonal_of
from ssgi_cl.techniques.sky_levels import SkyLevels

Doubles = NDArray[np.float64]

RAYS = 16
"""Of a part over the hemisphere: 256 of a surfel, one in each of as many strata."""
PLACES = 4
"""Of emissive surfaces that a part looks at."""
NO_CONE = -2.0
"""Cosine that every direction exceeds."""


@dataclass(frozen=True, eq=False)
class Sources:
    """Places that send light besides the parts of surfels.

    Attributes:
        position, normal: [n, 3] world space.
        area: [n] that each stands for, scene units squared.
        exitance: [n, 3] W/m^2.
        shown: [n] which share of it leaves the gap that it lies in.
        emits: [n] whether an emissive surface is there, which rays meet.
        near: distance within which the others give nothing, scene units.
        received: [parts, 3] what they give to parts of surfels as near to them, W/m^2.
    """

    position: Doubles
    normal: Doubles
    area: Doubles
    exitance: Doubles
    shown: Doubles
    emits: NDArray[np.bool_]
    near: float
    received: Doubles

    @classmethod
    def joined(
        cls,
        position: Doubles,
        normal: Doubles,
        area: Doubles,
        exitance: Doubles,
        shown: Doubles,
        lights: Vpls,
        near: float,
        received: Doubles,
    ) -> Sources:
        """Return places of emissive surfaces, then the parts of lights."""
        parts = lights.parts
        assert parts is not None  # noqa: S101  they have some
        return cls(
            np.concatenate([position, parts.position]),
            np.concatenate([normal, parts.normal]),
            np.concatenate([area, parts.area]),
            np.concatenate([exitance, parts.flux / parts.area[:, None]]),
            np.concatenate([shown, np.ones(len(parts))]),
            np.arange(len(area) + len(parts)) < len(area),
            near,
            received,
        )


class SurfelPoints:
    """The parts of surfels in device memory, as kernels/radiosity/points.clh reads them.

    Args:
        runtime: the device.
        scene: whose triangles rays meet.
        surfels: of the scene.
        sources: of light besides.

    Attributes:
        runtime, scene, surfels, sources: as given.
        count: of parts.
        numbers: [points] by which points have their rays: those of parts, then of sources and others.
        array: the points, of which there are a multiple of `ROW`.
    """

    def __init__(self, runtime: Runtime, scene: Scene, surfels: Surfels, sources: Sources | None = None) -> None:
        self.runtime, self.scene, self.surfels = runtime, scene, surfels
        self.count = count = len(surfels.part_area)
        self.sources = sources
        total = count + (0 if sources is None else len(sources.area))
        self.numbers = number = np.arange(-(-total // ROW) * ROW)
        number[:count] = surfels.part_number
        points = np.zeros((9, len(number)), np.float32)
        points[5] = 1.0
        if sources is not None:
            points[:3, count:total] = (sources.position - scene.origin).T
            points[3:6, count:total] = sources.normal.T
        points[:3, :count] = (surfels.part_position + (surfels.origin - scene.origin)).T
        points[3:6, :count] = surfels.part_normal.T
        place = self.places(2)
        ring, turn = np.sqrt(place[:, 0]), 2.0 * math.pi * place[:, 1]
        points[6:8] = ring * np.cos(turn), ring * np.sin(turn)
        points[8] = number % (TILE * TILE)
        self.array = runtime.array(points)

    def __len__(self) -> int:
        return len(self.numbers)

    def places(self, dimensions: int) -> Doubles:
        """Return [points, dimensions] places in [0, 1), even for any parts."""
        return r_points(0, int(self.numbers.max()) + 1, dimensions)[self.numbers]


def open_shares(points: SurfelPoints, length: float) -> Doubles:
    """Return [parts] which share of the rays over the hemisphere of a part goes farther than a length.

    Waits for the device.
    """
    return _by_hemispheres(points, "radiosity/radiosity_room.cl", "far", length)


def seen_parts(points: SurfelPoints) -> NDArray[np.bool_]:
    """Return [parts] whether any ray over the hemisphere of a part meets a surface, from which it is seen then.

    Waits for the device.
    """
    return _by_hemispheres(points, "radiosity/radiosity_seen.cl", "seen", REACH * diagonal_of(points.scene)) > 0.0


def _by_hemispheres(points: SurfelPoints, name: str, written: str, reach: float) -> Doubles:
    runtime, scene, ways = points.runtime, points.scene, hemisphere_ways(RAYS)
    bvh, found = scene_bvh(scene, runtime), runtime.empty(len(points), np.float32)
    outputs: dict[str, Any] = {written: found}
    runtime.kernel(name).run(
        (1, len(points)),
        points=points.array,
        ways=runtime.array(ways),
        nodes=bvh.nodes,
        triangles=bvh.triangles,
        rays=len(ways),
        lift=LIFT * diagonal_of(scene),
        reach=reach,
        **outputs,
    )
    return found.download()[: points.count].astype(np.float64)


def hiding_planes(points: SurfelPoints) -> Planes:
    """Return what finds the planes of what hides parts of surfels from others; each call waits for the device."""
    runtime, scene, stride = points.runtime, points.scene, len(points)
    bvh, planes = scene_bvh(scene, runtime), runtime.empty(4 * stride, np.float32)

    def found(partners: NDArray[np.intp], lift: float) -> Doubles:
        numbers = np.zeros(stride, np.int32)
        numbers[: len(partners)] = partners
        runtime.kernel("radiosity/radiosity_divide.cl").run(
            (1, stride),
            points=points.array,
            partners=runtime.array(numbers),
            nodes=bvh.nodes,
            triangles=bvh.triangles,
            planes=planes,
            lift=lift,
        )
        result = planes.download().reshape(4, stride)[:, : len(partners)].T.astype(np.float64)
        result[:, 3] += result[:, :3] @ np.asarray(scene.origin)
        return result

    return found


def _emission(radiance: Doubles, brightest: float, power: float) -> NDArray[np.float32]:
    """Return [n, 4] radiance over that of the brightest, and the density with which places are drawn."""
    return np.concatenate([radiance / brightest, (radiance @ LUMINANCE / power)[:, None]], axis=1).astype(np.float32)


class SurfelRays:
    """Irradiance at the parts of surfels.

    What rays over their hemispheres meet is found once. As no form factor is computed, no light is made or lost, in
    corners and narrow gaps neither.

    Args:
        points: the parts, in a scene without holes.
        cells: which they lie in.
    """

    def __init__(self, points: SurfelPoints, cells: SurfaceCells) -> None:
        self.runtime = runtime = points.runtime
        self._points, self._scene = points, points.scene
        self._unit = diagonal_of(points.scene)
        self._bvh = scene_bvh(points.scene, runtime)
        self._stride = stride = len(points)
        self._places = runtime.empty(RAYS * 3 * stride, np.int32)
        self._shares = runtime.empty(RAYS * 2 * stride, np.float32)
        self._found = runtime.empty(3 * stride, np.float32)
        areas = cells.light(np.zeros((points.count, 3)))
        in_cells, self._volume = device_volume(runtime, areas)
        self._ways = runtime.array(hemisphere_ways(RAYS))
        self.emitted = self._trace(areas, in_cells)

    def direct(self, lights: Sequence[PunctualLight]) -> Doubles:
        """Return irradiance [parts, 3] in W/m^2 by lights that no triangle hides. Waits for the device.

        Lights of some extent have penumbrae: parts with consecutive numbers look at other places of them.
        """
        if not lights:
            return np.zeros((self._points.count, 3))
        table = np.array([self._light(light) for light in lights])
        assert table.shape[1] == DIRECT_LIGHT  # noqa: S101  the kernel's
        brightest = max(float(table[:, 9:].max()), 1e-300)
        table[:, 9:] /= brightest
        self.runtime.kernel("radiosity/radiosity_direct.cl").run(
            (1, self._stride),
            points=self._points.array,
            lights=self.runtime.array(table.astype(np.float32)),
            nodes=self._bvh.nodes,
            triangles=self._bvh.triangles,
            irradiance=self._found,
            count=len(lights),
            lift=LIFT * self._unit,
            unit=self._unit,
        )
        return self._of_parts() * brightest

    def sky(self, sky: SkyLevels) -> Doubles:
        """Return irradiance [parts, 3] in W/m^2 by environments, along the rays that escape. Waits for the device."""
        if not sky.count:
            return np.zeros((self._points.count, 3))
        self.runtime.kernel("radiosity/radiosity_escape.cl").run(
            (1, self._stride),
            points=self._points.array,
            ways=self._ways,
            places=self._places,
            sky=sky.texels,
            images=sky.places,
            irradiance=self._found,
            rays=RAYS,
            texels_per_angle=sky.texels_per_angle,
            levels=sky.count,
        )
        return self._of_parts()

    def bounce(self, light: LightVolume) -> Doubles:
        """Return irradiance [parts, 3] in W/m^2 by the light of surfaces. Waits for the device.

        Args:
            light: of the cells that this was made with.
        """
        self._volume.upload(light.records.ravel())
        self.runtime.kernel("radiosity/radiosity_bounce.cl").run(
            (1, self._stride),
            volume=self._volume,
            places=self._places,
            shares=self._shares,
            received=self._found,
            rays=RAYS,
        )
        return self._of_parts()

    def _trace(self, areas: LightVolume, in_cells: DeviceArray) -> Doubles:
        """Find what rays meet, and return irradiance [parts, 3] in W/m^2 by emissive surfaces."""
        runtime, scene, surfels = self.runtime, self._scene, self._points.surfels
        glow = np.array([mean_emission(scene, material) for material in scene.materials]).reshape(-1, 3)
        brightest = max(float(glow.max(initial=0.0)), float(surfels.part_emission.max(initial=0.0)), 1e-300)
        # Density with which places are drawn: luminance over the power of all.
        table, weight = self._sending()
        more, power = self._points.sources, float(weight.sum())
        emits = power > 0.0
        shines = _emission(glow, brightest, power)[scene.material_ids] if emits else np.zeros(4, np.float32)
        side, first = areas.side, (np.asarray(scene.origin) - areas.low) / areas.side
        cell: dict[str, Any] = {f"cell_{axis}": float(first[i]) for i, axis in enumerate("xyz")}
        runtime.kernel("radiosity/radiosity_rays.cl", {"RADIOSITY_EMITS": int(emits), **self._bvh.first_macros}).run(
            (1, self._stride),
            points=self._points.array,
            ways=self._ways,
            **self._bvh.first,
            cells=in_cells,
            volume=self._volume,
            emission=runtime.array(shines),
            places=self._places,
            shares=self._shares,
            irradiance=self._found,
            rays=RAYS,
            count=float(PLACES),
            lift=LIFT * self._unit,
            reach=REACH * self._unit,
            per_cell=1.0 / side,
            **cell,
        )
        if emits:
            table[:, :3] /= brightest
            runtime.kernel("radiosity/radiosity_emission.cl").run(
                (1, self._stride),
                points=self._points.array,
                chosen=runtime.array(self._drawn(weight)),
                emission=runtime.array(table.astype(np.float32)),
                nodes=self._bvh.nodes,
                triangles=self._bvh.triangles,
                irradiance=self._found,
                count=PLACES,
                rays=float(RAYS),
                lift=LIFT * self._unit,
                near=0.0 if more is None else more.near**2,
            )
        received = self._of_parts() * brightest
        return received if more is None else received + more.received

    def _sending(self) -> tuple[Doubles, Doubles]:
        """Return radiance and density [n, 4] of places that send light, as the kernel takes them, and the weights with
        which they are drawn."""
        surfels, more = self._points.surfels, self._points.sources
        radiance, area = surfels.part_emission, surfels.part_area
        weight = area * (radiance @ LUMINANCE)
        if more is not None:
            sent = more.exitance / math.pi
            radiance, area = np.concatenate([radiance, sent]), np.concatenate([area, more.area])
            weight = np.concatenate([weight, more.shown * more.area * (sent @ LUMINANCE)])
        # That with which rays reckon, which meet emissive surfaces alone.
        total = max(float(weight.sum()), 1e-300)
        density = radiance @ LUMINANCE / total
        if more is not None:
            first = len(surfels.part_area)
            others = np.flatnonzero(~more.emits) + first
            density[others] = -PLACES / area[others]
            drawn = weight[first:] / total
            gain = np.where(drawn > 0.0, more.area / np.where(drawn > 0.0, drawn, 1.0), 0.0)
            radiance[first:] *= (gain * np.abs(density[first:]))[:, None]
        table = np.column_stack([radiance, density])
        return table, weight

    def _drawn(self, weight: Doubles) -> NDArray[np.int32]:
        """Return [PLACES, parts and padding] numbers of places that send light, in proportion to weights."""
        sending = np.flatnonzero(weight)
        ends = np.cumsum(weight[sending])
        wanted = np.mod(self._points.places(1)[:, 0] + np.arange(PLACES)[:, None] / PLACES, 1.0)
        number = np.searchsorted(ends, wanted * ends[-1], "right")
        drawn: NDArray[np.int32] = sending.astype(np.int32)[np.minimum(number, len(sending) - 1)]
        return drawn

    def _light(self, light: PunctualLight) -> list[float]:
        """Return a light as kernels/radiosity/radiosity_direct.cl reads it."""
        if isinstance(light, DirectionalLight):
            towards = -np.asarray(light.direction) / np.linalg.norm(light.direction)
            return [*towards, 1.0, 0.0, 0.0, 0.0, NO_CONE, light_extent(light), *np.broadcast_to(light.irradiance, 3)]
        axis, cosine = np.zeros(3), NO_CONE
        if isinstance(light, SpotLight):
            axis, cosine = np.asarray(light.direction) / np.linalg.norm(light.direction), math.cos(light.cone_angle)
        sent = np.broadcast_to(light.intensity, 3) / self._unit**2
        return [*(np.asarray(light.position) - self._scene.origin), 0.0, *axis, cosine, light.radius, *sent]

    def _of_parts(self) -> Doubles:
        return self._found.download().reshape(3, self._stride)[:, : self._points.count].T.astype(np.float64)
