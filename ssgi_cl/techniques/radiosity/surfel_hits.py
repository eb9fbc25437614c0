"""What rays over the hemispheres of the parts of surfels meet first, and the light of emissive surfaces there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import hemisphere_ways
from ssgi_cl.core.scene import mean_emission
from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import LIFT
from ssgi_cl.techniques.radiosity.surfel_points import SurfelPoints
from ssgi_cl.techniques.radiosity.triangle_rays import REACH, diagonal_of

Doubles = NDArray[np.float64]

RAYS = 16
"""Of a part over the hemisphere: 256 of a surfel, one in each of as many strata."""
PLACES = 4
"""Of emissive surfaces that a part looks at."""


def _emission(radiance: Doubles, brightest: float, power: float) -> NDArray[np.float32]:
    """Return [n, 4] radiance over that of the brightest, and the density with which places are drawn."""
    return np.concatenate([radiance / brightest, (radiance @ LUMINANCE / power)[:, None]], axis=1).astype(np.float32)


class SurfelHits:
    """What the rays of parts meet. Waits for the device.

    Args:
        points: the parts, in a scene without holes.
        length: scene units.

    Attributes:
        points: as given.
        ways: directions of the rays, see `hemisphere_ways`.
        met, where: see kernels/radiosity/radiosity_rays.cl.
        lift, reach: height above surfaces at which rays begin, and their length, scene units.
        far: [parts] which share of them goes farther than `length`.
        seen: [parts] whether any meets a surface, from which the part is seen then.
        emitted: [parts, 3] irradiance by emissive surfaces, W/m^2.
    """

    def __init__(self, points: SurfelPoints, length: float) -> None:
        self.points = points
        runtime, stride, unit = points.runtime, len(points), diagonal_of(points.scene)
        self.lift, self.reach = LIFT * unit, REACH * unit
        self.ways = runtime.array(hemisphere_ways(RAYS))
        self.met, self.where = runtime.empty(RAYS * stride, np.int32), runtime.empty(RAYS * stride, np.float32)
        far, found = runtime.empty(stride, np.float32), runtime.empty(3 * stride, np.float32)
        scene, surfels, bvh = points.scene, points.surfels, scene_bvh(points.scene, runtime)
        glow = np.array([mean_emission(scene, material) for material in scene.materials]).reshape(-1, 3)
        brightest = max(float(glow.max(initial=0.0)), float(surfels.part_emission.max(initial=0.0)), 1e-300)
        # Density with which places are drawn: luminance over the power of all.
        table, weight = self._sending()
        more, power = points.sources, float(weight.sum())
        emits = power > 0.0
        shines = _emission(glow, brightest, power)[scene.material_ids] if emits else np.zeros(4, np.float32)
        runtime.kernel("radiosity/radiosity_rays.cl", {"RADIOSITY_EMITS": int(emits), **bvh.first_macros}).run(
            (1, stride),
            points=points.array,
            ways=self.ways,
            **bvh.first,
            emission=runtime.array(shines),
            met=self.met,
            where=self.where,
            far=far,
            irradiance=found,
            rays=RAYS,
            count=float(PLACES),
            lift=self.lift,
            reach=self.reach,
            length=length,
        )
        if emits:
            table[:, :3] /= brightest
            runtime.kernel("radiosity/radiosity_emission.cl").run(
                (1, stride),
                points=points.array,
                chosen=runtime.array(self._drawn(weight)),
                emission=runtime.array(table.astype(np.float32)),
                nodes=bvh.nodes,
                triangles=bvh.triangles,
                irradiance=found,
                count=PLACES,
                rays=float(RAYS),
                lift=self.lift,
                near=0.0 if more is None else more.near**2,
            )
        self.far: Doubles = points.of_parts(far)[:, 0]
        rays = self.met.download().reshape(RAYS, stride)[:, : points.count]
        self.seen: NDArray[np.bool_] = rays.max(axis=0) >= 0
        emitted = points.of_parts(found) * brightest
        self.emitted: Doubles = emitted if more is None else emitted + more.received

    def _sending(self) -> tuple[Doubles, Doubles]:
        """Return radiance and density [n, 4] of places that send light, as the kernel takes them, and the weights with
        which they are drawn."""
        surfels, more = self.points.surfels, self.points.sources
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
        place = self.points.places(1)[:, 0]
        order = np.argsort(place)  # a search is several times as fast in order
        wanted = np.mod(place[order] + np.arange(PLACES)[:, None] / PLACES, 1.0)
        number = np.minimum(np.searchsorted(ends, wanted * ends[-1], "right"), len(sending) - 1)
        drawn = np.empty(number.shape, np.int32)
        drawn[:, order] = sending[number]
        return drawn
