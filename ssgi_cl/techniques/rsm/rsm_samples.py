"""Samples of a reflective shadow map: all texels, those drawn by flux, and patterns in a disk."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import look_at_matrix
from ssgi_cl.core.sampling import TILE_ORDER
from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.constants import RSM_RECORD
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct, ints

Doubles = NDArray[np.float64]

SUMS = Struct("RsmSumsParams", ints("from", "to", "columns", "rows"))

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""Of a turn: the step of angle that spreads any number of points evenly."""


def square_points(count: int) -> Doubles:
    """Return [count, 2] points of the unit square, well spread (Hammersley)."""
    index = np.arange(count)
    bits, reversed_, place = index.copy(), np.zeros(count), 0.5
    while bits.any():
        reversed_ += place * (bits & 1)
        bits >>= 1
        place *= 0.5
    # Half a step on, so that no point lies on the border.
    return np.stack([(index + 0.5) / count, np.mod(reversed_ + 0.5 / count, 1.0)], axis=-1)


def _spiral(count: int) -> tuple[Doubles, Doubles]:
    """Return [count] radii in (0, 1), evenly spaced, and [count] angles in radians, well spread."""
    index = np.arange(count)
    return (index + 0.5) / count, 2.0 * np.pi * np.mod(index * GOLDEN, 1.0)


def disk_pattern(count: int, weights: str) -> Doubles:
    """Return [count, 4] places x, y in the unit disk, 0, and weights that add up to its area.

    As in Dachsbacher and Stamminger 2005, section 4.1, a sample lies at radius xi, xi uniform, so
    that the density of samples per area is 1 / (2 pi xi). An unbiased weight is one over it,
    proportional to xi ("unbiased"); the paper's is proportional to xi^2 ("paper").
    """
    xi, angle = _spiral(count)
    share = xi / xi.sum() if weights == "unbiased" else xi**2 / (xi**2).sum()
    return np.stack([xi * np.cos(angle), xi * np.sin(angle), np.zeros(count), np.pi * share], axis=-1)


def cap_pattern(count: int, weights: str, reach: float) -> Doubles:
    """Return [count, 4] directions within `reach` radians of +z, and their solid angles in sr.

    The counterpart of `disk_pattern` on the sphere of a point light's directions.
    """
    xi, angle = _spiral(count)
    polar = reach * xi
    density = np.sin(polar) if weights == "unbiased" else xi**2
    cap = 2.0 * np.pi * (1.0 - math.cos(reach))
    return np.stack(
        [np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar), cap * density / density.sum()],
        axis=-1,
    )


def tile_turns() -> Doubles:
    """Return [4, 4] angles in radians by which pixels of a 4 x 4 tile turn the pattern."""
    return TILE_ORDER * (2.0 * np.pi / 16.0)


def cube_turns() -> Doubles:
    """Return [6, 3, 3] the rotations from the world to the views of a point light's faces."""
    axes = np.eye(3)
    return np.stack(
        [
            look_at_matrix(np.zeros(3), sign * axes[i], axes[(i + 1) % 3])[:3, :3]
            for i in range(3)
            for sign in (1.0, -1.0)
        ]
    )


def pyramid_levels(size: Size) -> list[Size]:
    """Return (rows, columns) of each level of a pyramid of sums of 2 x 2, up to one of 1 x 1."""
    levels = [size]
    while levels[-1] != (1, 1):
        rows, columns = levels[-1]
        levels.append((-(-rows // 2), -(-columns // 2)))
    return levels


class TexelRecords:
    """Records of the texels of maps of one size, in the order in which they are gathered from.

    Attributes:
        records: [texels, RSM_RECORD] floats: position, area, normal, power, flux.
        count: texels.
    """

    def __init__(self, runtime: Runtime, size: Size) -> None:
        self.runtime = runtime
        self.size = size
        self.count = size[0] * size[1]
        self._levels = pyramid_levels(size)
        self._starts = np.cumsum([0, *(rows * columns for rows, columns in self._levels)])
        self.records = runtime.empty(self.count * RSM_RECORD, np.float32)
        self.sums = runtime.empty(int(self._starts[-1]), np.float32)
        self._kernel = runtime.kernel("rsm/rsm_gather_texels.cl")
        self._sums = runtime.kernel("rsm/rsm_gather_sums.cl", structs=(SUMS,))

    def update(self, rsm: DeviceRsm) -> None:
        """Queue the pass that writes the records, and the flux by which each is picked."""
        self._kernel.run(
            self.size,
            position=rsm.position,
            normal=rsm.normal,
            flux=rsm.flux,
            area=rsm.area,
            texels=self.records,
            powers=self.sums,
        )

    def add_up(self) -> None:
        """Queue the passes that build the pyramid of sums of flux, after `update`."""
        for level, size in enumerate(self._levels[1:], 1):
            below = self._levels[level - 1]
            values = {"from": self._starts[level - 1], "to": self._starts[level], "columns": below[1], "rows": below[0]}
            self._sums.run(size, grid=size, pyramid=self.sums, params=SUMS.pack(values))

    def level_table(self) -> NDArray[np.int32]:
        """Return [levels, 3] where each level begins, its columns, its rows; from the top down."""
        rows = [(start, size[1], size[0]) for start, size in zip(self._starts, self._levels, strict=False)]
        return np.array(rows[::-1], np.int32)


class FluxSamples:
    """Samples drawn in proportion to flux, prepared for one size of maps and number of samples.

    Attributes:
        records: [samples, RSM_RECORD] floats, each with the flux and area of all texels that it represents.
        count: samples.
    """

    def __init__(self, runtime: Runtime, texels: TexelRecords, count: int) -> None:
        self.count = count
        self._texels = texels
        self.records: DeviceArray = runtime.empty(count * RSM_RECORD, np.float32)
        table = texels.level_table()
        self._depth = len(table)
        self._table = runtime.array(table)
        self._points = runtime.array(square_points(count).astype(np.float32))
        self._kernel = runtime.kernel("rsm/rsm_gather_pick.cl")
        self._groups = runtime.small_groups(16)

    def update(self) -> None:
        """Queue the passes that draw the samples from the current texels."""
        self._texels.add_up()
        self._kernel.run(
            (1, self.count),
            grid=(1, self.count),
            local=self._groups,
            texels=self._texels.records,
            pyramid=self._texels.sums,
            levels=self._table,
            points=self._points,
            samples=self.records,
            level_count=self._depth,
        )
