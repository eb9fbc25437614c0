"""Virtual point lights that stay in device memory, in world space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.vpls import PARTS, Vpls
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime

Doubles = NDArray[np.float64]

BRIGHTEST = 1e30
"""W: more counts as this."""


class WorldVpls:
    """Diffuse virtual point lights with parts, which any camera may see without an upload.

    Args:
        runtime: the device.
        vpls: at least one, with parts.
        origin: [3] world space, among the lights: positions on the device count from here.

    Attributes:
        count: of the lights.
        lights, parts: see kernels/vpl/vpl_to_view.cl.
        stride, part_stride: floats of a row of them.
        reach: greatest coordinate of a light from the origin, scene units.
        brightest: greatest flux, W.
    """

    def __init__(self, runtime: Runtime, vpls: Vpls, origin: Doubles) -> None:
        parts = vpls.parts
        if parts is None or len(parts) != PARTS * len(vpls) or not len(vpls):
            raise ValueError(
                f"vpls has {len(vpls)} lights and {0 if parts is None else len(parts)} parts: "
                f"expected {PARTS} parts for each of at least one light"
            )
        self.runtime = runtime
        self.origin = np.asarray(origin, np.float64)
        self.count = len(vpls)
        self.reach = float(np.abs(vpls.position - self.origin).max())
        self.brightest = min(float(vpls.flux.max()), BRIGHTEST)
        self.lights, self.stride = self._rows(vpls)
        self.parts, self.part_stride = self._rows(parts)

    def to_view(self, camera: Camera) -> Doubles:
        """Return [3, 4] from the origin and the world's axes to a camera's view space."""
        turn = camera.view[:3, :3]
        return np.column_stack([turn, turn @ self.origin + camera.view[:3, 3]])

    def _rows(self, vpls: Vpls) -> tuple[DeviceArray, int]:
        stride = -(-len(vpls) // 16) * 16
        rows = np.zeros((10, stride), np.float32)
        rows[0:3, : len(vpls)] = (vpls.position - self.origin).T
        rows[3:6, : len(vpls)] = vpls.normal.T
        rows[6, : len(vpls)] = vpls.area
        rows[7:10, : len(vpls)] = np.minimum(vpls.flux, BRIGHTEST).T / (self.brightest or 1.0)
        return self.runtime.array(rows), stride
