"""Active regions: rectangles of an image outside which nothing is seen, so that passes run there alone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ssgi_cl.device.arrays import Size


@dataclass(frozen=True)
class Region:
    """Pixels of an image outside which nothing is seen; None in place of one is all.

    Attributes:
        row, column: first pixel.
        rows, columns: how many; an empty region has none.
    """

    row: int
    column: int
    rows: int
    columns: int

    @classmethod
    def between(cls, first: Size, end: Size) -> Self:
        """Return the region from (row, column) `first` to before `end`, empty if that is no pixel."""
        rows, columns = (max(e - f, 0) for f, e in zip(first, end, strict=True))
        return cls(*first, rows, columns) if rows and columns else cls(0, 0, 0, 0)

    @property
    def first(self) -> Size:
        """(row, column) of the first pixel."""
        return self.row, self.column

    @property
    def end(self) -> Size:
        """(row, column) behind the last pixel."""
        return self.row + self.rows, self.column + self.columns

    @property
    def empty(self) -> bool:
        """Whether it has no pixel."""
        return self.rows == 0

    def union(self, other: Region) -> Region:
        """Return the least region that holds both."""
        if self.empty or other.empty:
            return other if self.empty else self
        first = min(self.row, other.row), min(self.column, other.column)
        end = max(self.end[0], other.end[0]), max(self.end[1], other.end[1])
        return Region.between(first, end)

    def inside(self, size: Size, margin: Size = (0, 0)) -> Region:
        """Return what of it lies in an image of this size, whose first pixel is at `margin`."""
        first = max(self.row - margin[0], 0), max(self.column - margin[1], 0)
        end = min(self.end[0] - margin[0], size[0]), min(self.end[1] - margin[1], size[1])
        return Region.between(first, end)

    def grown(self, by: int) -> Region:
        """Return the region with so many more pixels on every side; of an empty one an empty one."""
        if self.empty:
            return self
        return Region(self.row - by, self.column - by, self.rows + 2 * by, self.columns + 2 * by)

    def cells(self, cell: Size) -> tuple[Size, Size]:
        """Return the first cell of (rows, columns) pixels that it meets, and how many it meets."""
        first = self.row // cell[0], self.column // cell[1]
        if self.empty:
            return first, (0, 0)
        return first, (-(-self.end[0] // cell[0]) - first[0], -(-self.end[1] // cell[1]) - first[1])

    def reduced(self, step: int) -> Region:
        """Return the region of every step-th pixel of the image, from the first on."""
        first, (rows, columns) = self.cells((step, step))
        return Region(*first, rows, columns)

    def beyond(self, size: Size) -> Size | None:
        """Return a pixel of an image of this size that lies outside, None if there is none."""
        corners = [(row, column) for row in (0, size[0] - 1) for column in (0, size[1] - 1)]
        return next((c for c in corners if not self._holds(c)), None)

    def _holds(self, pixel: Size) -> bool:
        return all(f <= p < e for f, p, e in zip(self.first, pixel, self.end, strict=True))


def copy_region(source: NDArray[Any], target: NDArray[Any], region: Region | None, beyond: Size | None) -> None:
    """Copy an image [rows, columns, channels].

    Where `beyond` is a pixel outside the region, it stands for all of them.
    """
    if region is None or beyond is None:
        np.copyto(target, source)
        return
    target[0] = source[beyond]
    target[1:] = target[0]
    part = slice(region.row, region.end[0]), slice(region.column, region.end[1])
    # One channel by one: numpy is slow where strides are in different order.
    for channel in range(target.shape[2]):
        np.copyto(target[(*part, channel)], source[(*part, channel)])


class PreviousRegion:
    """The region that the latest run of a pass wrote, which the next one has to cover too.

    Where a run works in a region, all pixels beyond hold the background already. So it has to work
    where the run before did, as well.
    """

    def __init__(self) -> None:
        self._left: Region | None = None
        self._background: object = None

    @contextmanager
    def over(self, region: Region | None, background: object = None) -> Iterator[Region | None]:
        """Give where a run works that shows anything in `region` alone, and note that it did so.

        `background` tells the value beyond: where it changes, the run works everywhere. It does
        too after a run that raised.
        """
        known = region is not None and self._left is not None and background == self._background
        over = region.union(self._left) if known and region and self._left else None
        self._left = None
        yield over
        self._background = background
        self._left = region
