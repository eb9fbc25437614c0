"""A grid of what the camera and the lights see, through which lines of sight are followed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.device_vpls import VPL, DeviceVpls
from ssgi_cl.memory import DeviceArray, Size
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, Struct, floats

TURN = Struct(
    "VplTurn", floats("xx", "xy", "xz", "x", "yx", "yy", "yz", "y", "zx", "zy", "zz", "z")
)
LIFT = 1.9
"""Cells above their surfaces at which lines begin and end, lest these block them."""


class SightGrid:
    """A bit for each of cells^3 cubes of view space: whether a surface was seen in it.

    It spans all that the camera sees and all lights. What neither camera nor light sees is air.

    Args:
        runtime: the device.
        cells: along a side: 32, 64, 128 or 256.
        steps: points at which a line of sight is looked at.

    Attributes:
        grid, box: see kernels/vpl/grid.clh.
        macros: of kernels that include it.
    """

    def __init__(self, runtime: Runtime, cells: int, steps: int) -> None:
        self.runtime = runtime
        self.cells = cells
        self.macros = {"VPL_GRID": cells, "VPL_STEPS": steps}
        self.grid = runtime.empty(cells**3 // 32, np.int32)
        self.box = runtime.empty(4, np.float32)
        self._clear = runtime.kernel("vpl/vpl_grid.cl", self.macros, (CAMERA, VPL))

    def fill(
        self, gbuffer: DeviceGBuffer, rsms: Sequence[DeviceRsm], boxes: DeviceArray,
        lights: DeviceVpls, size: Size, packed: Any,
    ) -> None:
        """Queue what marks the surfaces of all layers and of the reflective shadow maps.

        Args:
            gbuffer: of which the margin counts too.
            rsms: any number.
            boxes: bounds of the image's tiles; see kernels/vpl/vpl_boxes.cl.
            lights: the grid spans them too.
            size: (rows, columns) of the image.
            packed: the struct `VPL`, whose `count` is that of the lights' segments.
        """
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        self._clear.run(
            "vpl grid", size, reads=[boxes, lights.bounds], writes=[self.grid, self.box],
            values=[packed], grid=(self.cells, self.cells),
        )
        sources = [(gbuffer.depth, gbuffer.normal, gbuffer.layers, gbuffer.whole, np.eye(3, 4))]
        sources += [(rsm.position, rsm.normal, 0, rsm.size, rsm.to_view(camera)) for rsm in rsms]
        names = [name for name, _ in TURN.members]
        for points, normal, layers, whole, turn in sources:
            kernel = self.runtime.kernel(
                "vpl/vpl_occupy.cl", {**self.macros, "VPL_LAYERS": layers}, (CAMERA, VPL, TURN)
            )
            kernel.run(
                "vpl occupy", whole, reads=[points, normal, self.box], writes=[self.grid],
                values=[
                    gbuffer.camera_struct, packed,
                    TURN.pack(dict(zip(names, turn.ravel(), strict=True))),
                ],
            )
