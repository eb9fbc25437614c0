"""Air of an occupancy grid: its cells against kernels/occupancy/grid.clh, its spaces against a flood."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.techniques.radiosity.air import Air

CELLS = 32


def packed(occupied: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the words that kernels read, cell by cell as `occupancy_held` finds them."""
    blocks = CELLS // 4
    words = np.zeros(CELLS**3 // 16, np.uint32)
    for z, y, x in np.argwhere(occupied):
        block = ((z >> 2) * blocks + (y >> 2)) * blocks + (x >> 2)
        bit = ((z & 1) << 4) | ((y & 3) << 2) | (x & 3)
        words[block * 2 + ((z >> 1) & 1)] |= np.uint32(1) << np.uint32(bit)
    words[CELLS**3 // 32 :] = 7  # distances, which are no cells
    return words.view(np.int32)


def test_each_bit_is_its_cell() -> None:
    occupied = np.random.default_rng(5).random((CELLS,) * 3) < 0.6
    air = Air.of(packed(occupied), CELLS)
    np.testing.assert_array_equal(air.numbers == 0, occupied)


def test_spaces_are_what_a_flood_from_any_cell_fills() -> None:
    occupied = np.random.default_rng(6).random((CELLS,) * 3) < 0.6
    numbers = Air.of(packed(occupied), CELLS).numbers
    for start in np.argwhere(~occupied)[::4001]:
        filled = np.zeros_like(occupied)
        filled[tuple(start)] = True
        while True:
            grown = filled.copy()
            for axis in range(3):
                for step in (1, -1):
                    moved = np.roll(filled, step, axis)
                    edge = [slice(None)] * 3
                    edge[axis] = slice(0, 1) if step == 1 else slice(-1, None)
                    moved[tuple(edge)] = False
                    grown |= moved & ~occupied
            if (grown == filled).all():
                break
            filled = grown
        np.testing.assert_array_equal(numbers == numbers[tuple(start)], filled)


@pytest.mark.parametrize("axis", range(3))
def test_a_wall_parts_and_a_door_joins(axis: int) -> None:
    occupied = np.zeros((CELLS,) * 3, np.bool_)
    np.moveaxis(occupied, axis, 0)[10] = True
    parted = Air.of(packed(occupied), CELLS)
    assert len(np.unique(parted.numbers)) == 3
    assert len(parted.outside) == 2
    np.moveaxis(occupied, axis, 0)[10, 4, 5] = False
    assert len(np.unique(Air.of(packed(occupied), CELLS).numbers)) == 2


def test_points_lie_in_the_space_of_their_cell_by_x_y_z() -> None:
    occupied = np.zeros((CELLS,) * 3, np.bool_)
    shell = np.zeros_like(occupied)
    shell[4:9, 12:17, 20:25] = True  # z, y, x
    shell[5:8, 13:16, 21:24] = False
    air = Air.of(packed(occupied | shell), CELLS)
    inner, wall, outer, beyond = air.at(
        np.array([[22.5, 14.5, 6.5], [20.5, 14.5, 6.5], [1.0, 1.0, 1.0], [-9.0, 99.0, 0.0]])
    )
    assert wall == 0
    assert inner not in (0, outer)
    assert air.outside == {outer} == {beyond}
