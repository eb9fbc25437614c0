"""Depth bounds of the visible surfaces of each tile of an image."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import SEEN_SIDE
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.source import camera_of

Doubles = NDArray[np.float64]

_ROUNDING = 1e-5
"""Relative widening of the bounds, for roundings of float32."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Tiles that show a surface.

    Attributes:
        camera: that sees them.
        sides: [n, 4] left, right, top and bottom edge, pixels.
        nearest, farthest: [n] depths, scene units.
    """

    camera: Camera
    sides: Doubles
    nearest: Doubles
    farthest: Doubles

    @property
    def pixels(self) -> Doubles:
        """Pixels of each tile, [n]."""
        return np.asarray((self.sides[:, 1] - self.sides[:, 0]) * (self.sides[:, 3] - self.sides[:, 2]))

    def widths(self) -> Doubles:
        """Return the width of a pixel half way between each tile's depths, [n] scene units."""
        to_x, to_y, _, _ = self.camera.pixel_to_view
        width = math.sqrt(abs(to_x * to_y))
        if self.camera.is_orthographic:
            return np.full(len(self.nearest), width)
        return np.asarray(width * np.sqrt(self.nearest * self.farthest))

    def corners(self) -> Doubles:
        """Return the corners of the hull of each tile's surfaces, [n, 8, 3] world space."""
        to_x, to_y, at_x, at_y = self.camera.pixel_to_view
        corners = np.empty((len(self.nearest), 8, 3))
        for number in range(8):
            depth = self.farthest if number & 4 else self.nearest
            k = 1.0 if self.camera.is_orthographic else depth
            corners[:, number, 0] = (to_x * self.sides[:, number & 1] + at_x) * k
            corners[:, number, 1] = (to_y * self.sides[:, 2 + (number >> 1 & 1)] + at_y) * k
            corners[:, number, 2] = -depth
        view = self.camera.view
        return np.asarray((corners - view[:3, 3]) @ view[:3, :3])


class SeenDepths:
    """Reduction of depth to bounds of tiles, prepared for G-buffers of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the camera's image.
    """

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self.runtime = runtime
        self._pixels = size
        self._size: Size = (-(-size[0] // SEEN_SIDE), -(-size[1] // SEEN_SIDE))
        self._tiles = runtime.plane(2, self._size)
        self._kernel = runtime.kernel("direct/seen_depths.cl")

    def find(self, gbuffer: DeviceGBuffer) -> Seen:
        """Queue the pass and read its result back, 8 bytes a tile."""
        self._kernel.run(
            self._size,
            grid=self._size,
            depth=gbuffer.depth,
            tiles=self._tiles,
            pixels=self._pixels,
            margin=gbuffer.margin,
        )
        nearest, farthest = self._tiles.download().astype(np.float64)
        there = np.isfinite(nearest)
        row, column = np.nonzero(there)
        rows, columns = self._pixels
        left, top = column * SEEN_SIDE, row * SEEN_SIDE
        sides = np.stack(
            [left, np.minimum(left + SEEN_SIDE, columns), top, np.minimum(top + SEEN_SIDE, rows)], axis=-1
        ).astype(np.float64)
        near, far = nearest[there] * (1.0 - _ROUNDING), farthest[there] * (1.0 + _ROUNDING)
        return Seen(camera_of(gbuffer), sides, near, far)
