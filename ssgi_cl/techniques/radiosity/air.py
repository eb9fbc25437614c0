"""Air of an occupancy grid: which of its empty cells are connected, so that light may pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.constants import OCCUPANCY_BLOCK

Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Air:
    """Empty cells, numbered by the space that they are part of: cells that share a side connect.

    Attributes:
        numbers: [cells, cells, cells] int32 by z, y and x: 1 and up, 0 where a cell is occupied.
    """

    numbers: Ints

    @classmethod
    def of(cls, occupancy: NDArray[np.int32], cells: int) -> Air:
        """Return the air of a grid of cells^3.

        Args:
            occupancy: words as kernels/occupancy/grid.clh has them.
            cells: along a side.
        """
        from scipy import ndimage  # takes a fifth of a second, which other commands do without

        blocks, side = cells // OCCUPANCY_BLOCK, OCCUPANCY_BLOCK
        words = occupancy[: cells**3 // 32].astype("<i4", copy=False)
        bits = np.unpackbits(words.view(np.uint8), bitorder="little")
        # A block's layers come two to a word, rows and columns of four cells within.
        layered = bits.reshape(blocks, blocks, blocks, side, side, side)
        empty = layered.transpose(0, 3, 1, 4, 2, 5).reshape(cells, cells, cells) == 0
        numbers, _ = ndimage.label(empty, output=np.int32)
        return cls(numbers)

    def at(self, points: NDArray[np.floating]) -> Ints:
        """Return [n] the space of points [n, 3] in cells of the grid; 0 in occupied ones."""
        x, y, z = np.clip(points, 0, len(self.numbers) - 1).astype(np.intp).T
        found: Ints = self.numbers[z, y, x]
        return found

    @property
    def outside(self) -> frozenset[int]:
        """The spaces that reach the grid's boundary."""
        sides = [np.take(self.numbers, side, axis) for axis in range(3) for side in (0, -1)]
        return frozenset(int(one) for one in np.unique(np.stack(sides)) if one)
