"""The narrowing search, on costs whose least is known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.tuning.search import Axis, Cost, Narrowing, narrow, spread


def test_spread_points_fill_the_cube_evenly() -> None:
    points = spread(64, 2, seed=0)
    assert points.min() >= 0.0
    assert points.max() < 1.0
    # Each of 16 cells would have 4 points on average; the sequence leaves none empty.
    cells, counts = np.unique((points * 4).astype(int), axis=0, return_counts=True)
    assert len(cells) == 16
    assert counts.max() <= 6
    assert np.abs(spread(8, 3, seed=0) - spread(8, 3, seed=1)).max() > 0.05


@pytest.mark.parametrize(
    "axis",
    [
        Axis("x", -1.0, 3.0),
        Axis("x", 0.01, 100.0),
        Axis("x", 2, 9, whole=True),
        Axis("x", values=(4, 8, 16, 64)),
        Axis("x", values=("full", "half", "quarter")),
    ],
    ids=["linear", "logarithmic", "whole", "grid", "choices"],
)
def test_place_of_a_value_gives_the_value_back(axis: Axis) -> None:
    values = {axis.at(u) for u in np.linspace(0.0, 1.0, 41)}
    for value in values:
        again = axis.at(axis.place(value))
        # Floats to rounding, everything else exactly.
        assert again == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value)


def test_whole_numbers_have_equal_shares_and_both_ends() -> None:
    axis = Axis("x", 0, 4, whole=True)
    values = [axis.at(u) for u in (np.arange(1000) + 0.5) / 1000]
    assert all(isinstance(value, int) for value in values)
    assert np.bincount(values).tolist() == [200] * 5


def test_wide_ranges_are_searched_by_ratio_and_words_and_switches_without_order() -> None:
    # The middle of 0.01 to 100 is then 1, their geometric mean.
    assert Axis("x", 0.01, 100.0).at(0.5) == pytest.approx(1.0)
    assert Axis("x", 1.0, 2.0).at(0.5) == pytest.approx(1.5)
    kinds = ((1, 2.5, 4), ("a", "b"), (False, True))
    assert [Axis("x", values=values).ordered for values in kinds] == [True, False, False]


AXES = [
    Axis("x", 0.0, 1.0),
    Axis("y", 0.1, 10.0),
    Axis("n", 1, 40, whole=True),
    Axis("grid", values=(4, 8, 16, 32)),
    Axis("word", values=("a", "b", "c")),
]


def bowl(values: dict[str, Any]) -> Cost:
    """Least, 0, at x 0.37, y 2, n 23, grid 16, word b."""
    return (
        (values["x"] - 0.37) ** 2
        + math.log(values["y"] / 2.0) ** 2
        + 0.001 * (values["n"] - 23) ** 2
        + 0.02 * abs(math.log2(values["grid"] / 16))
        + 0.1 * (values["word"] != "b"),
    )


def test_least_of_a_bowl_is_found_in_ranges_grids_and_choices() -> None:
    best = narrow(AXES, bowl)[0]
    assert best["word"] == "b"
    assert best["grid"] == 16
    assert abs(best["n"] - 23) <= 1
    # The last steps are a 64th of a range, so that the least is nearer than that.
    assert best["x"] == pytest.approx(0.37, abs=1 / 64)
    assert math.log(best["y"] / 2.0) == pytest.approx(0.0, abs=math.log(100.0) / 64)


def test_search_is_the_same_each_time_sorted_by_cost_and_tries_no_point_twice() -> None:
    seen = []

    def counted(values: dict[str, Any]) -> Cost:
        seen.append(tuple(values.values()))
        return bowl(values)

    found = narrow(AXES, counted)
    assert len(seen) == len(set(seen))
    assert found == narrow(AXES, bowl)
    costs = [bowl(values) for values in found]
    assert costs == sorted(costs)


def test_points_that_are_not_allowed_are_left_out() -> None:
    def half(values: dict[str, Any]) -> Cost | None:
        return bowl(values) if values["x"] > 0.5 else None

    ranked = narrow(AXES, half)
    assert all(values["x"] > 0.5 for values in ranked)
    # The least that is allowed lies at the border.
    assert ranked[0]["x"] == pytest.approx(0.5, abs=1 / 32)
    assert narrow(AXES, lambda values: None) == []


def test_start_is_tried_first_and_may_win() -> None:
    best = {"x": 0.37, "y": 2.0, "n": 23, "grid": 16, "word": "b"}
    assert narrow(AXES, bowl, start=[best], rounds=1, points=4)[0] == best


def test_further_rounds_come_closer() -> None:
    def cost(values: dict[str, Any]) -> Cost:
        return ((values["x"] - 0.371) ** 2 + (values["y"] - 0.613) ** 2,)

    search = Narrowing([Axis("x", 0.0, 1.0), Axis("y", 0.0, 1.0)], cost)
    search.survey(16)
    found = [cost(search.ranked()[0])]
    for number in range(1, 4):
        search.closer(0.5**number, 4, keep=3)
        found.append(cost(search.ranked()[0]))
    assert found == sorted(found, reverse=True)
    assert found[-1] < found[0]
