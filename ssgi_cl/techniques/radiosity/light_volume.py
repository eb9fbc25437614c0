"""Light volume: radiance of a scene's surfaces by place and direction, for rays that leave the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import VOLUME_CELLS
from ssgi_cl.device.runtime import Runtime

Doubles = NDArray[np.float64]

CELLS = VOLUME_CELLS
FAINT = 1e-3
"""Area that surfaces from another cell are given in one that has none, in sides of a cell squared."""
BRIGHTEST = 1e30
"""W m^-2 sr^-1: more counts as this."""
NEAR = 5.0
"""Cells within which surfaces that no light reaches give way to lit ones, as cells are thicker than some walls."""
LEAST_SHOWN = 0.01
"""What a piece counts at least, so that a cell has a mean where all of its pieces are in a gap."""
FACES = 6
"""Directions that surfaces of a cell face: +x, -x, +y, -y, +z, -z."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of surfaces, each on the side of its normal.

    Attributes:
        position: [count, 3] float64, scene units.
        normal: [count, 3], unit length.
        area: [count], scene units squared.
    """

    position: Doubles
    normal: Doubles
    area: Doubles

    @classmethod
    def none(cls) -> Pieces:
        """Return no piece."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True, eq=False)
class LightVolume:
    """Mean radiance of the surfaces in cells of a cube, by the six sides that they face.

    A ray takes the mean of the three sides that it sees, weighted by how large the surfaces that face them appear to
    it.

    Attributes:
        cells: [CELLS by z, CELLS by y, CELLS by x] int32: the number of a record.
        records: [count, FACES, 4] float32: radiance, W m^-2 sr^-1, and area, in sides of cells squared.
        low: [3] float64, the corner of least coordinates of the cube, scene units.
        extent: of its side, scene units.
    """

    cells: NDArray[np.int32]
    records: NDArray[np.float32]
    low: Doubles
    extent: float

    @property
    def side(self) -> float:
        """Side of a cell, scene units."""
        return self.extent / CELLS


def device_volume(runtime: Runtime, volume: LightVolume) -> tuple[DeviceArray, DeviceArray]:
    """Return the cells and records of a volume in device memory, as kernels/radiosity/volume.clh reads them."""
    return runtime.array(volume.cells.ravel()), runtime.array(volume.records.ravel())


class SurfaceCells:
    """The cells of a cube that surfaces lie in, and which sides they face there.

    Where a cell has no surface that faces a side, the nearest that has counts, as if it were `FAINT` of the cell's
    side.

    Args:
        lit: pieces that stand for all surfaces that light reaches.
        low, extent: of the cube, see `LightVolume`.
        unlit: of surfaces that no light reaches: black where no other within `NEAR` faces the same way.
        shown: [lit pieces] what each counts for its cell, 0 to 1: the part of its hemisphere that is open to beyond the
            cell. Rays from afar come to a piece in that proportion, seldom into a gap.
    """

    def __init__(
        self, lit: Pieces, low: Doubles, extent: float, unlit: Pieces | None = None, shown: Doubles | None = None
    ) -> None:
        self.low, self.extent = low, extent
        self._shown = np.ones(len(lit.area)) if shown is None else np.maximum(shown, LEAST_SHOWN)
        dark = Pieces.none() if unlit is None else unlit
        shape = (CELLS, CELLS, CELLS)
        own, others = self._cell(lit.position), self._cell(dark.position)
        there = np.zeros(CELLS**3, np.bool_)
        there[own] = there[others] = True
        there[0] |= not there.any()
        place = np.flatnonzero(there)
        number = np.cumsum(there) - 1
        nearest = _nearest(there)
        self.cells = number[np.ravel_multi_index(tuple(nearest), shape)].astype(np.int32).reshape(shape)
        self._slots = _Slots.of(number[own], lit.normal)
        black = _Slots.of(number[others], dark.normal).sums(dark.area, len(place))
        area = self._slots.sums(lit.area, len(place))
        # Slots are numbered record by record.
        self._near = np.arange(len(place) * FACES).reshape(-1, FACES)
        for face in range(FACES):
            known = area[:, face] > 1e-6 * area[:, face].max(initial=0.0)
            area[~known, face] = 0.0
            if known.all():
                continue
            alone = black[:, face] > 0.0
            if known.any():
                there = np.zeros(CELLS**3, np.bool_)
                there[place[known]] = True
                nearest = _nearest(there)[:, place]
                away = np.stack(np.unravel_index(place, shape)) - nearest
                alone &= (away**2).sum(axis=0) > NEAR**2
                given = ~known & ~alone
                found = number[np.ravel_multi_index(tuple(nearest[:, given]), shape)]
                self._near[given, face] = found * FACES + face
            area[alone, face] = black[alone, face]
        self._area = area
        self._seen = self._slots.sums(lit.area * self._shown, len(place))
        self.area = np.maximum(area / self.side**2, FAINT)

    @property
    def side(self) -> float:
        """Side of a cell, scene units."""
        return self.extent / CELLS

    def light(self, flux: Doubles, also: tuple[Pieces, Doubles] | None = None) -> LightVolume:
        """Return the light that surfaces send.

        Args:
            flux: [lit pieces, 3] W, that they send on their sides.
            also: pieces of some of the same surfaces, and what these send besides, [n, 3] W.
        """
        count = len(self.area)
        radiance = self._slots.mean(flux * self._shown[:, None], self._seen)
        if also is not None:
            pieces, sent = also
            slots = _Slots.of(self.cells.ravel()[self._cell(pieces.position)], pieces.normal)
            # Pieces are few: those of some surfaces may have missed a cell that others lie in.
            radiance += slots.mean(sent, np.maximum(self._seen, slots.sums(pieces.area, count)))
        records = np.empty((count, FACES, 4), np.float32)
        records[..., :3] = np.minimum(radiance, BRIGHTEST).astype(np.float32).take(self._near, axis=0)
        records[..., 3] = self.area
        return LightVolume(self.cells, records, self.low, self.extent)

    def _cell(self, position: Doubles) -> NDArray[np.intp]:
        x, y, z = np.clip(((position - self.low) / self.side).astype(np.intp), 0, CELLS - 1).T
        found: NDArray[np.intp] = (z * CELLS + y) * CELLS + x
        return found


def _nearest(there: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return [3, cells] the z, y and x of the nearest of the cells that are there, for each."""
    from scipy import ndimage  # takes a fifth of a second, which other commands do without

    shape = (CELLS, CELLS, CELLS)
    grid = ~there.reshape(shape)
    found: NDArray[np.int32] = ndimage.distance_transform_edt(grid, return_distances=False, return_indices=True)
    return found.reshape(3, -1)


@dataclass(frozen=True, eq=False)
class _Slots:
    """Sides of records that pieces face: [n] numbers of slots, pieces, and squares of cosines."""

    slot: NDArray[np.intp]
    piece: NDArray[np.intp]
    weight: Doubles

    @classmethod
    def of(cls, record: NDArray[np.intp], normal: Doubles) -> _Slots:
        faced = np.maximum(np.stack([normal, -normal], axis=-1).reshape(-1, FACES), 0.0) ** 2
        piece, face = np.nonzero(faced)
        return cls(record[piece] * FACES + face, piece, faced[piece, face])

    def mean(self, flux: Doubles, area: Doubles) -> Doubles:
        """Return [records FACES, 3] the radiance of the pieces' flux [pieces, 3] over areas [records, FACES]."""
        over = np.pi * np.where(area > 0.0, area, np.inf)
        return np.stack([(self.sums(channel, len(area)) / over).ravel() for channel in flux.T], axis=1)

    def sums(self, values: Doubles, records: int) -> Doubles:
        """Return [records, FACES] sums of a value of the pieces."""
        found: Doubles = np.bincount(self.slot, self.weight * values[self.piece], records * FACES).astype(np.float64)
        return found.reshape(records, FACES)
