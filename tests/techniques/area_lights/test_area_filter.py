"""area_rows and area_filter on planes made by hand: penumbrae are blurred along a surface, and not over its edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.constants import AREA_CELL_COLUMNS, AREA_CELL_ROWS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, camera_values
from ssgi_cl.techniques.area_lights.area_lights import AREA

ROWS, COLUMNS, REACH = 24, 64, 8
MIDDLE = COLUMNS // 2
PIXEL = 1.0 / ROWS
"""Scene units, of an orthographic view of height 1."""


def share(
    runtime: Runtime,
    *,
    width: float = 100.0,
    turned: bool = False,
    stacked: bool = False,
    farther: float = 0.0,
    bits: int = 3,
    open_cells: tuple[slice, slice] | None = None,
) -> NDArray[np.float32]:
    """Return [ROWS, COLUMNS] the share of light that arrives: rays of the left half are blocked, of the right half not.

    Args:
        runtime: the device.
        width: of the penumbra, scene units.
        turned: whether the right half is at right angles to the left.
        stacked: whether the halves lie one above the other; the lower one is as the right one else.
        farther: by how much the right half lies farther away, scene units.
        bits: of all cells.
        open_cells: rows and columns of cells whose bits are 2 in their place.
    """
    camera = Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=1.0, width=COLUMNS, height=ROWS)
    ones = np.ones((ROWS, COLUMNS), np.float32)
    right = (np.arange(ROWS)[:, None] >= ROWS // 2 if stacked else np.arange(COLUMNS) >= MIDDLE) & (ones > 0.0)
    facing = np.zeros((3, ROWS, COLUMNS), np.float32)
    facing[2] = 1.0
    if turned:
        facing[:, right] = np.array([1.0, 0.0, 0.0], np.float32)[:, None]
    sampled = np.stack([ones * right, ones, ones * width * ~right, ones * ~right]).astype(np.float32)
    cells = np.full((-(-ROWS // AREA_CELL_ROWS), -(-COLUMNS // AREA_CELL_COLUMNS)), bits, np.int32)
    if open_cells is not None:
        cells[open_cells] = 2

    def plane(values: NDArray[np.float32]) -> Plane:
        made = runtime.plane(len(values), (ROWS, COLUMNS))
        made.upload(values)
        return made

    with runtime.frame():
        means, irradiance = runtime.plane(3, (ROWS, COLUMNS)), runtime.plane(3, (ROWS, COLUMNS))
        given: dict[str, Any] = {
            "depth": plane((2.0 * ones + farther * right)[None].astype(np.float32)), "normal": plane(facing),
            "cells": runtime.array(cells.ravel()), "camera": CAMERA.pack(camera_values(camera, (0, 0))),
            "params": AREA.pack({name: 0 for name, _ in AREA.members}),
        }  # fmt: skip
        rows, columns = (
            runtime.kernel(f"area_lights/{name}.cl", {"AREA_CHANNELS": 1, "AREA_REACH": REACH, **own}, (CAMERA, AREA))
            for name, own in (("area_rows", {}), ("area_filter", {"AREA_ADDS": 0}))
        )
        rows.run((ROWS, COLUMNS), sampled=plane(sampled), means=means, **given)
        light = plane(np.stack([ones] * 3))
        columns.run((ROWS, COLUMNS), sampled=means, light=light, irradiance=irradiance, **given)
        found: NDArray[np.float32] = irradiance.download()
    np.testing.assert_array_equal(found[0], found[1])
    return found[0]


def test_a_wide_penumbra_is_blurred_as_far_as_the_filter_reaches(variant_runtime: Runtime) -> None:
    row = share(variant_runtime)[ROWS // 2]
    assert (np.diff(row) >= 0.0).all()
    np.testing.assert_allclose(row + row[::-1], 1.0, atol=1e-6)  # as far on both sides
    assert 0.4 < row[MIDDLE - 1] < 0.5 < row[MIDDLE] < 0.6
    assert row[MIDDLE - REACH] > 0.0 == row[MIDDLE - REACH - 1]


def test_columns_are_blurred_as_rows_are(variant_runtime: Runtime) -> None:
    down = share(variant_runtime, stacked=True)
    across, half = share(variant_runtime)[ROWS // 2], ROWS // 2
    # The weights are the same numbers but for rounding; rows of one value have it as their mean.
    np.testing.assert_allclose(down - down[:, :1], 0.0, atol=1e-5)
    np.testing.assert_allclose(
        down[half - REACH // 2 : half + REACH // 2, 0], across[MIDDLE - REACH // 2 : MIDDLE + REACH // 2], atol=1e-5
    )


def test_a_blocker_at_hand_leaves_a_sharp_edge(runtime: Runtime) -> None:
    right = np.arange(COLUMNS) >= MIDDLE
    np.testing.assert_array_equal(share(runtime, width=PIXEL)[ROWS // 2], right)
    # A radius of half the width.
    row = share(runtime, width=6.0 * PIXEL)[ROWS // 2]
    assert row[MIDDLE - 2] > 0.0 == row[MIDDLE - 4]


@pytest.mark.parametrize("stacked", [False, True], ids=["beside", "above"])
@pytest.mark.parametrize("edge", [{"turned": True}, {"farther": 2.5 * PIXEL}], ids=["crease", "step"])
def test_nothing_crosses_an_edge(variant_runtime: Runtime, edge: dict[str, float], stacked: bool) -> None:
    right = np.arange(ROWS)[:, None] >= ROWS // 2 if stacked else np.arange(COLUMNS) >= MIDDLE
    found = share(variant_runtime, stacked=stacked, **edge)
    np.testing.assert_array_equal(found, np.broadcast_to(right, (ROWS, COLUMNS)))


def test_where_all_rays_about_agree_the_share_is_0_or_1(runtime: Runtime) -> None:
    assert not share(runtime, bits=1).any()
    assert (share(runtime, bits=2) == 1.0).all()
    assert (share(runtime, bits=0) == 1.0).all()
    # The cells beside those that disagree count as they do; one further they are on their own.
    row = share(runtime, open_cells=(slice(None), slice(2, 4)))[ROWS // 2]
    assert row[AREA_CELL_COLUMNS * 3 - 1] == row[AREA_CELL_COLUMNS * 3] == 1.0
    assert 0.0 < row[MIDDLE] < 1.0
    for cells, order in ((slice(0, 2), 1), (slice(1, 3), -1)):
        column = share(runtime, open_cells=(cells, slice(None)))[::order, MIDDLE]
        assert (column[:AREA_CELL_ROWS] == 1.0).all()
        assert (column[AREA_CELL_ROWS:] < 1.0).all()
