"""Triangles that may lie in front of surfels, in batches with a box each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.hilbert_curve import curve_numbers
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import START_BATCH, START_FEW
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.device_scene import DeviceScene, cutouts_of, planar, triangle_boxes

SPREAD = 0.15
"""Mean diagonal of boxes of 16 triangles over the scene's, from which on they are put in order:
those of a scan may follow each other anyhow."""
MANY = 16384
"""Triangles below which looking at all of them takes no longer than that."""


@dataclass(frozen=True, eq=False)
class StartTriangles:
    """Triangles in device memory as kernels/radiosity/radiosity_start.cl reads them.

    Attributes:
        corners: 3 x [triangles, rounded up to 16] vertices.
        boxes, few: [runs, 6] middle and half size of boxes round `START_BATCH` and `START_FEW`.
        cutouts: [triangles] material of those with holes, or -1.
    """

    corners: DeviceArray
    boxes: DeviceArray
    few: DeviceArray
    cutouts: DeviceArray

    @classmethod
    def of(cls, runtime: Runtime, scene: Scene, solid: DeviceScene) -> StartTriangles:
        """Return those of a scene, along a curve through space if that makes boxes smaller.

        Args:
            runtime: the device.
            scene: whose triangles they are.
            solid: the same on the device.
        """
        if solid.spread < SPREAD or len(scene.triangles) < MANY:
            return cls(solid.corners, solid.boxes, solid.few_boxes, solid.cutouts)
        # Corners do as well as middles, and take a third of the time.
        at = scene.positions[scene.triangles[:, 0]].astype(np.float64)
        order = np.argsort(curve_numbers(at, at.min(axis=0), at.max(axis=0)), kind="stable")
        triangles = scene.triangles[order]
        boxes, few = triangle_boxes(scene.positions, triangles, (START_BATCH, START_FEW))
        arrays = planar(triangles), boxes, few, cutouts_of(scene)[order]
        return cls(*(runtime.array(array) for array in arrays))
