"""Irradiance at every step-th pixel, interpolated where neighbours allow it, listed where not."""

from __future__ import annotations

import math

import numpy as np

from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.memory import Plane, Size
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.upsample import ReducedGBuffer, coarse_size

COARSE = Struct(
    "RsmCoarseParams",
    (
        *(
            (name, "int")
            for name in ("margin_columns", "margin_rows", "coarse_columns", "coarse_rows")
        ),
        *floats("off", "cosine", "spread"),
    ),
)


class Sparse:
    """The low-resolution road, prepared for one size of the result.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        step: 2, 4 or 8.
        plane_tolerance, normal_tolerance, spread: see `RsmGatherParams`.

    Attributes:
        coarse: 3 images of the coarse result, which the caller fills in between.
        list: how many pixels are left to be computed, and so many times row << 16 | column.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        step: int,
        *,
        plane_tolerance: float,
        normal_tolerance: float,
        spread: float,
    ) -> None:
        self.size = size
        self.step = step
        self._limits = {
            "off": plane_tolerance,
            "cosine": math.cos(min(normal_tolerance, math.pi)),
            "spread": spread,
        }
        rows, columns = size
        self.coarse = runtime.plane(3, coarse_size(size, step))
        self.list = runtime.array(np.zeros(1 + rows * columns, np.int32))
        self._left = runtime.empty(rows * (-(-columns // 16) * 16), np.int32)
        self._counts = runtime.empty(rows, np.int32)
        self._interpolate = runtime.kernel(
            "rsm_gather/rsm_gather_interpolate.cl", {"RSM_GATHER_STEP": step}, (CAMERA, COARSE)
        )
        self._count = runtime.kernel("rsm_gather/rsm_gather_count.cl")
        self._fill = runtime.kernel("rsm_gather/rsm_gather_list.cl")
        self._reduced: ReducedGBuffer | None = None

    def reduced(self, gbuffer: DeviceGBuffer) -> ReducedGBuffer:
        """Queue the passes that reduce the G-buffer, and return it: what `coarse` is made from."""
        if self._reduced is None:
            self._reduced = ReducedGBuffer(gbuffer, self.step)
        self._reduced.update(gbuffer)
        return self._reduced

    def interpolate(self, gbuffer: DeviceGBuffer, reduced: ReducedGBuffer, fine: Plane) -> None:
        """Queue the passes that write `fine` from `coarse` where they can, and `list` the rest."""
        values = {
            "margin_columns": gbuffer.margin[1],
            "margin_rows": gbuffer.margin[0],
            "coarse_columns": reduced.whole[1],
            "coarse_rows": reduced.whole[0],
            **self._limits,
        }
        self._interpolate.run(
            "interpolate", self.size,
            reads=[self.coarse, reduced.linear, reduced.normal, gbuffer.linear, gbuffer.normal],
            writes=[fine, self._left], values=[gbuffer.camera_struct, COARSE.pack(values)],
        )
        rows = self.size[0]
        grid, local = (1, rows), (1, min(rows, 16))
        self._count.run(
            "list", self.size, [self._left], [self._counts], grid=grid, local=local
        )
        self._fill.run(
            "list", self.size, [self._left, self._counts], [self.list], grid=grid, local=local
        )

    def share(self) -> float:
        """Return the share of all pixels that are on the list. Waits for the device."""
        return int(self.list.download()[0]) / (self.size[0] * self.size[1])
