"""Light volume: radiance of a scene's surfaces by place and direction, for rays that leave the image."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import VOLUME_CELLS
from ssgi_cl.device.runtime import Runtime

Doubles = NDArray[np.float64]

CELLS = VOLUME_CELLS
FACES = 6
"""Directions that surfaces of a cell face: +x, -x, +y, -y, +z, -z."""


@dataclass(frozen=True, eq=False)
class LightVolume:
    """Mean radiance of the surfaces in cells of a cube, by the six sides that they face.

    A ray takes the mean of the three sides that it sees, weighted by how large the surfaces that face them appear to
    it.

    Attributes:
        cells: [CELLS by z, CELLS by y, CELLS by x] int32: the number of a record, or -1 - k, which stands for
            record 2 k before plane k and 2 k + 1 behind it.
        records: [count, FACES, 4] float32: radiance, W m^-2 sr^-1, and area, in sides of cells squared.
        low: [3] float64, the corner of least coordinates of the cube, scene units.
        extent: of its side, scene units.
        planes: [planes, 4] float32 that divide cells: normals, and where they are along these, in cells from `low`.
    """

    cells: NDArray[np.int32]
    records: NDArray[np.float32]
    low: Doubles
    extent: float
    planes: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 4), np.float32))

    @property
    def side(self) -> float:
        """Side of a cell, scene units."""
        return self.extent / CELLS


def device_volume(runtime: Runtime, volume: LightVolume) -> tuple[DeviceArray, DeviceArray]:
    """Return the cells and records of a volume in device memory, as kernels/radiosity/volume.clh reads them."""
    return device_cells(runtime, volume.cells, volume.planes), runtime.array(volume.records.ravel())


def device_cells(runtime: Runtime, cells: NDArray[np.int32], planes: NDArray[np.float32]) -> DeviceArray:
    """Return cells and the planes that divide them likewise, without records."""
    return runtime.array(np.concatenate([cells.ravel(), planes.view(np.int32).ravel()]))


def cells_at(place: Doubles) -> NDArray[np.intp]:
    """Return the numbers of the cells at places [n, 3] in cells, of the nearest for places outside of the cube."""
    x, y, z = np.clip(place.astype(np.intp), 0, CELLS - 1).T
    found: NDArray[np.intp] = (z * CELLS + y) * CELLS + x
    return found
