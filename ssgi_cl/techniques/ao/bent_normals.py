"""Bent normals in world space, from the mean unoccluded direction of the slices of a pixel."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import VIEW_ROTATION, DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import rotation_values
from ssgi_cl.techniques.source import camera_of

LEAST_OPEN = 0.02
"""Least component of a bent normal along the normal, relative to an unoccluded surface: where less
is unoccluded than noise, it leans to the normal, and it never lies below the surface."""


class BentNormals:
    """Pass that adds bends to normals and normalises the sum, prepared for images of one size."""

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self._kernel = runtime.kernel("gtao/gtao_bent.cl", {}, (VIEW_ROTATION,))
        self._size = size
        self._bent = runtime.plane(4, size)

    def run(self, gbuffer: DeviceGBuffer, scanned: Plane) -> Plane:
        """Queue the pass; return A and x, y, z of unit length in world space, 0 where nothing is.

        Args:
            gbuffer: whose normals are bent.
            scanned: A, then 3 images of what bends the normal in view space; more may follow.
        """
        to_world = camera_of(gbuffer).view[:3, :3].T
        self._kernel.run(
            self._size,
            scanned=scanned,
            normal=gbuffer.normal,
            bent=self._bent,
            margin=gbuffer.margin,
            least=LEAST_OPEN,
            to_world=VIEW_ROTATION.pack(rotation_values(to_world)),
        )
        return self._bent
