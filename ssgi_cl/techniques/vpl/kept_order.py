"""The order of lights in a tree, kept from frame to frame of a sequence."""

from __future__ import annotations

import numpy as np

from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime


class KeptOrder:
    """The axes that lights faced first, by which a tree orders them.

    Lights whose normals turn, or that a turning camera sees, would change the runs behind them in the order, and with
    these which lights share a shadow ray.
    """

    def __init__(self) -> None:
        self._axes: DeviceArray | None = None
        self._key: object = None

    def forget(self) -> None:
        """Begin anew with the next frame."""
        self._axes = None

    def axes(self, runtime: Runtime, size: int) -> tuple[DeviceArray, int]:
        """Return the axes in device memory, and CLUSTER_AXES of kernels/multires/cluster_order.cl.

        Args:
            runtime: the device.
            size: places of lights; with another the order begins anew.
        """
        key = runtime, size
        if self._axes is not None and self._key == key:
            return self._axes, 2
        self._key, self._axes = key, runtime.empty(size, np.int32)
        return self._axes, 1
