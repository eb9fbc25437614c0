"""Rays from the parts of surfels: light from surface to surface, found where it arrives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE, hemisphere_ways
from ssgi_cl.core.lights import DirectionalLight, PunctualLight, SpotLight, light_extent
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene, mean_emission
from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.device.constants import DIRECT_LIGHT
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.light_volume import LightVolume, Planes, SurfaceCells, device_volume
from ssgi_cl.techniques.radiosity.surfels import Surfels

Doubles = NDArray[np.float64]

RAYS = 16
"""Of a part over the hemisphere: 256 of a surfel, one in each of as many strata."""
PLACES = 4
"""Of emissive surfaces that a part looks at."""
REACH = 1.01
"""Length of rays, in diagonals of the scene's box."""
NO_CONE = -2.0
"""Cosine that every direction exceeds."""
ROW = 64
"""Points in whose multiples rows lie."""


def open_shares(runtime: Runtime, scene: Scene, surfels: Surfels, length: float) -> Doubles:
    """Return [parts] which share of the rays over the hemisphere of a part goes farther than a length.

    Waits for the device.
    """
    points, ways = _points(scene, surfels), hemisphere_ways(RAYS)
    stride, bvh = points.shape[1], scene_bvh(scene, runtime)
    far = runtime.empty(stride, np.float32)
    runtime.kernel("radiosity/radiosity_room.cl").run(
        (1, stride),
        points=runtime.array(points),
        ways=runtime.array(ways),
        nodes=bvh.nodes,
        triangles=bvh.triangles,
        far=far,
        rays=len(ways),
        lift=LIFT * _diagonal(scene),
        reach=length,
    )
    return far.download()[: len(surfels.part_area)].astype(np.float64)


def hiding_planes(runtime: Runtime, scene: Scene, surfels: Surfels) -> Planes:
    """Return what finds the planes of what hides parts of surfels from others; each call waits for the device."""
    rows, bvh = _points(scene, surfels), scene_bvh(scene, runtime)
    stride = rows.shape[1]
    points, planes = runtime.array(rows), runtime.empty(4 * stride, np.float32)

    def found(partners: NDArray[np.intp], lift: float) -> Doubles:
        numbers = np.zeros(stride, np.int32)
        numbers[: len(partners)] = partners
        runtime.kernel("radiosity/radiosity_divide.cl").run(
            (1, stride),
            points=points,
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


def _diagonal(scene: Scene) -> float:
    return max(float(np.linalg.norm(np.ptp(scene.bounds, axis=0))), 1e-30)


def _points(scene: Scene, surfels: Surfels) -> NDArray[np.float32]:
    """Return the parts of surfels as kernels/radiosity/points.clh says."""
    count = len(surfels.part_area)
    stride = -(-count // ROW) * ROW
    points = np.zeros((9, stride), np.float32)
    points[5] = 1.0
    points[:3, :count] = (surfels.part_position + (surfels.origin - scene.origin)).T
    points[3:6, :count] = surfels.part_normal.T
    number = np.arange(stride)
    number[:count] = surfels.part_number
    place = r_points(0, int(number.max()) + 1, 2)[number]
    ring, turn = np.sqrt(place[:, 0]), 2.0 * math.pi * place[:, 1]
    points[6:8] = ring * np.cos(turn), ring * np.sin(turn)
    points[8] = number % (TILE * TILE)
    return points


def _emission(radiance: Doubles, brightest: float, power: float) -> NDArray[np.float32]:
    """Return [n, 4] radiance over that of the brightest, and the density with which places are drawn."""
    return np.concatenate([radiance / brightest, (radiance @ LUMINANCE / power)[:, None]], axis=1).astype(np.float32)


class SurfelRays:
    """Irradiance at the parts of surfels.

    What rays over their hemispheres meet is found once. As no form factor is computed, no light is made or lost, in
    corners and narrow gaps neither.

    Args:
        runtime: the device.
        scene: whose triangles rays meet, without holes.
        surfels: of the scene.
        cells: which the parts lie in.
    """

    def __init__(self, runtime: Runtime, scene: Scene, surfels: Surfels, cells: SurfaceCells) -> None:
        self.runtime = runtime
        self._scene = scene
        self._unit = _diagonal(scene)
        self._bvh = scene_bvh(scene, runtime)
        self._count = len(surfels.part_area)
        points = _points(scene, surfels)
        self._stride = stride = points.shape[1]
        self._points = runtime.array(points)
        self._places = runtime.empty(RAYS * 3 * stride, np.int32)
        self._shares = runtime.empty(RAYS * 2 * stride, np.float32)
        self._found = runtime.empty(3 * stride, np.float32)
        areas = cells.light(np.zeros((self._count, 3)))
        self._volume = runtime.array(areas.records.ravel())
        self.emitted = self._trace(surfels, areas)

    def direct(self, lights: Sequence[PunctualLight]) -> Doubles:
        """Return irradiance [parts, 3] in W/m^2 by lights that no triangle hides. Waits for the device.

        Lights of some extent have penumbrae: parts with consecutive numbers look at other places of them.
        """
        if not lights:
            return np.zeros((self._count, 3))
        table = np.array([self._light(light) for light in lights])
        assert table.shape[1] == DIRECT_LIGHT  # noqa: S101  the kernel's
        brightest = max(float(table[:, 9:].max()), 1e-300)
        table[:, 9:] /= brightest
        self.runtime.kernel("radiosity/radiosity_direct.cl").run(
            (1, self._stride),
            points=self._points,
            lights=self.runtime.array(table.astype(np.float32)),
            nodes=self._bvh.nodes,
            triangles=self._bvh.triangles,
            irradiance=self._found,
            count=len(lights),
            lift=LIFT * self._unit,
            unit=self._unit,
        )
        return self._of_parts() * brightest

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

    def _trace(self, surfels: Surfels, areas: LightVolume) -> Doubles:
        """Find what rays meet, and return irradiance [parts, 3] in W/m^2 by emissive surfaces."""
        runtime, scene = self.runtime, self._scene
        glow = np.array([mean_emission(scene, material) for material in scene.materials]).reshape(-1, 3)
        brightest = max(float(glow.max(initial=0.0)), float(surfels.part_emission.max(initial=0.0)), 1e-300)
        # Density with which places are drawn: luminance over the power of all.
        power = float(surfels.part_area @ (surfels.part_emission @ LUMINANCE))
        emits = power > 0.0
        shines = _emission(glow, brightest, power)[scene.material_ids] if emits else np.zeros(4, np.float32)
        side, first = areas.side, (np.asarray(scene.origin) - areas.low) / areas.side
        cell: dict[str, Any] = {f"cell_{axis}": float(first[i]) for i, axis in enumerate("xyz")}
        runtime.kernel("radiosity/radiosity_rays.cl", {"RADIOSITY_EMITS": int(emits), **self._bvh.first_macros}).run(
            (1, self._stride),
            points=self._points,
            ways=runtime.array(hemisphere_ways(RAYS)),
            **self._bvh.first,
            cells=device_volume(runtime, areas)[0],
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
            runtime.kernel("radiosity/radiosity_emission.cl").run(
                (1, self._stride),
                points=self._points,
                chosen=runtime.array(self._drawn(surfels)),
                emission=runtime.array(_emission(surfels.part_emission, brightest, power)),
                nodes=self._bvh.nodes,
                triangles=self._bvh.triangles,
                irradiance=self._found,
                count=PLACES,
                rays=float(RAYS),
                lift=LIFT * self._unit,
            )
        return self._of_parts() * brightest

    def _drawn(self, surfels: Surfels) -> NDArray[np.int32]:
        """Return [PLACES, parts and padding] numbers of parts that emit, in proportion to their power."""
        power = surfels.part_area * (surfels.part_emission @ LUMINANCE)
        emitting = np.flatnonzero(power)
        ends = np.cumsum(power[emitting])
        number = np.arange(self._stride)
        number[: self._count] = surfels.part_number
        first = r_points(0, int(number.max()) + 1, 1)[number, 0]
        wanted = np.mod(first + np.arange(PLACES)[:, None] / PLACES, 1.0)
        number = np.searchsorted(ends, wanted * ends[-1], "right")
        drawn: NDArray[np.int32] = emitting.astype(np.int32)[np.minimum(number, len(emitting) - 1)]
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
        return self._found.download().reshape(3, self._stride)[:, : self._count].T.astype(np.float64)
