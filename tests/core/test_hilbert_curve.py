"""The Hilbert curve visits each cell once, and steps to a cell beside it."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.hilbert_curve import CURVE_BITS, curve_numbers

MOST = (1 << CURVE_BITS) - 1


def test_it_steps_from_cell_to_neighbouring_cell() -> None:
    """In corners of the cube and at its middle, where blocks of 32^3 are whole parts of the curve."""
    block = np.stack(np.meshgrid(*[np.arange(32.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for corner in ((0, 0, 0), (MOST - 31, 0, 0), (512, 480, 512), (512, 512, 512), (MOST - 31,) * 3):
        cells = block + corner
        number = curve_numbers(cells, np.zeros(3), np.full(3, float(MOST)))
        assert len(np.unique(number)) == len(cells)
        assert number.max() - number.min() == len(cells) - 1
        steps = np.abs(np.diff(cells[np.argsort(number)], axis=0))
        assert (steps.sum(axis=1) == 1.0).all()


def test_it_begins_and_ends_at_corners_and_takes_all_numbers() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    number = curve_numbers(corners, np.zeros(3), np.ones(3))
    assert (number.min(), number.max()) == (0, (1 << 3 * CURVE_BITS) - 1)


def test_octants_are_those_of_skilling() -> None:
    """Of his curve, x first: 0, 1, 3, 2, 7, 6, 4, 5 by x, y and z."""
    corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    number = curve_numbers(0.25 + 0.5 * corners, np.zeros(3), np.ones(3))
    assert (number >> 3 * (CURVE_BITS - 1)).tolist() == [0, 1, 3, 2, 7, 6, 4, 5]


def test_points_outside_of_the_box_and_flat_boxes_have_numbers() -> None:
    points = np.array([[-5.0, 0.5, 0.5], [0.0, 0.5, 0.5], [9.0, 0.5, 0.5], [1.0, 0.5, 0.5]])
    number = curve_numbers(points, np.zeros(3), np.ones(3))
    assert number[0] == number[1]
    assert number[2] == number[3]
    assert (curve_numbers(points[:1], points[0], points[0]) == 0).all()
    assert len(curve_numbers(np.zeros((0, 3)), np.zeros(3), np.ones(3))) == 0
