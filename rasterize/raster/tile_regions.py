"""Active regions of a drawn image: the rectangles round the tiles that have triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import RASTER_TILE
from ssgi_cl.device.kernel import CPU_WIDTH

WIDE = 256
"""Columns of which a region has a multiple at least; work-groups on CPUs may be wider, and none may
go beyond."""
WORTH = 0.75
"""Share of an image up to which an active region is used."""


def busy_region(busy: NDArray[np.bool_], whole: Size, lanes: int) -> Region | None:
    """Return the active region of the tiles that are `busy`, None if it is most of the image."""
    rows, columns = (np.flatnonzero(busy.any(axis=axis)) for axis in (1, 0))
    if rows.size == 0:
        return Region(0, 0, 0, 0)
    first = int(rows[0]) * RASTER_TILE, int(columns[0]) * RASTER_TILE
    end = int(rows[-1] + 1) * RASTER_TILE, int(columns[-1] + 1) * RASTER_TILE
    region = widened(Region.between(first, end), whole, lanes)
    return region if region.rows * region.columns <= WORTH * whole[0] * whole[1] else None


def widened(region: Region, whole: Size, lanes: int) -> Region:
    """Return a region with columns for whole work-groups, within the image."""
    group = max(WIDE, CPU_WIDTH * lanes)
    end = region.end[0], region.column + -(-region.columns // group) * group
    return Region.between(region.first, end).inside(whole)
