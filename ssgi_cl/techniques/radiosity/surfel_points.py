"""The parts of surfels as points from which rays begin, and places of light besides."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.hemisphere import TILE
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.radiosity.surface_cells import Planes
from ssgi_cl.techniques.radiosity.surfels import Surfels
from ssgi_cl.techniques.radiosity.triangle_rays import row_length

Doubles = NDArray[np.float64]


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
        array: the points, as many as `row_length` says.
    """

    def __init__(self, runtime: Runtime, scene: Scene, surfels: Surfels, sources: Sources | None = None) -> None:
        self.runtime, self.scene, self.surfels = runtime, scene, surfels
        self.count = count = len(surfels.part_area)
        self.sources = sources
        total = count + (0 if sources is None else len(sources.area))
        self.numbers = number = np.arange(row_length(total))
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

    def of_parts(self, rows: DeviceArray) -> Doubles:
        """Return [parts, n] what a kernel has written for points, n rows of them. Waits for the device."""
        return rows.download().reshape(-1, len(self))[:, : self.count].T.astype(np.float64)


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
        result = points.of_parts(planes)
        result[:, 3] += result[:, :3] @ np.asarray(scene.origin)
        return result

    return found
