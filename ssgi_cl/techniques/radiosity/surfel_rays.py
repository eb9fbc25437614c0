"""Light from surface to surface along the rays of surfels' parts, found where it arrives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import DirectionalLight, PunctualLight, SpotLight, light_extent
from ssgi_cl.device.constants import DIRECT_LIGHT
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.radiosity.light_volume import LightVolume, device_volume
from ssgi_cl.techniques.radiosity.surface_cells import SurfaceCells
from ssgi_cl.techniques.radiosity.surfel_hits import RAYS, SurfelHits
from ssgi_cl.techniques.radiosity.triangle_rays import diagonal_of
from ssgi_cl.techniques.sky_levels import SkyLevels

Doubles = NDArray[np.float64]

NO_CONE = -2.0
"""Cosine that every direction exceeds."""


class SurfelRays:
    """Irradiance at the parts of surfels.

    What rays over their hemispheres meet is found once. As no form factor is computed, no light is made or lost, in
    corners and narrow gaps neither.

    Args:
        hits: of the parts' rays.
        cells: which the parts lie in.

    Attributes:
        emitted: see `SurfelHits`.
    """

    def __init__(self, hits: SurfelHits, cells: SurfaceCells) -> None:
        self._points, self.emitted = hits.points, hits.emitted
        self.runtime = runtime = hits.points.runtime
        scene = self._scene = hits.points.scene
        self._unit = diagonal_of(scene)
        self._bvh = scene_bvh(scene, runtime)
        self._stride = stride = len(hits.points)
        self._places = runtime.empty(RAYS * 3 * stride, np.int32)
        self._shares = runtime.empty(RAYS * 2 * stride, np.float32)
        self._found = runtime.empty(3 * stride, np.float32)
        self._ways, self._lift = hits.ways, hits.lift
        areas = cells.light(np.zeros((hits.points.count, 3)))
        in_cells, self._volume = device_volume(runtime, areas)
        first = (np.asarray(scene.origin) - areas.low) / areas.side
        cell: dict[str, Any] = {f"cell_{axis}": float(first[i]) for i, axis in enumerate("xyz")}
        runtime.kernel("radiosity/radiosity_places.cl").run(
            (1, stride),
            points=hits.points.array,
            ways=hits.ways,
            met=hits.met,
            where=hits.where,
            triangles=self._bvh.triangles,
            cells=in_cells,
            volume=self._volume,
            places=self._places,
            shares=self._shares,
            rays=RAYS,
            lift=hits.lift,
            reach=hits.reach,
            per_cell=1.0 / areas.side,
            **cell,
        )

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
            lift=self._lift,
            unit=self._unit,
        )
        return self._points.of_parts(self._found) * brightest

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
        return self._points.of_parts(self._found)

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
        return self._points.of_parts(self._found)

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
