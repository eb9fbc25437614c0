"""The Pareto front of time and error."""

from __future__ import annotations

from typing import Any

import pytest

from ssgi_cl.bench import front

from .documents import entry


def marked(results: list[dict[str, Any]]) -> list[str]:
    front.mark(results)
    return [result["setting"] for result in results if result["front"]]


def case(setting: str, ms: float, rmse: float | None, **changes: Any) -> dict[str, Any]:
    return entry(f"a.{setting}.hall.8x6", ms, rmse, **changes)


def test_only_what_nothing_beats_is_on_the_front() -> None:
    results = [
        case("slow", 9.0, 0.01),
        case("beaten", 5.0, 0.3),
        case("fast", 1.0, 0.4),
        case("middle", 4.0, 0.2),
        case("worst", 10.0, 0.5),
    ]
    assert marked(results) == ["slow", "fast", "middle"]


def test_equals_are_on_it_together() -> None:
    results = [case("a", 1.0, 0.2), case("b", 1.0, 0.2), case("c", 2.0, 0.1), case("d", 2.0, 0.1)]
    assert marked(results) == ["a", "b", "c", "d"]


def test_as_much_error_in_more_time_is_beaten_and_so_is_more_error_in_as_much_time() -> None:
    assert marked([case("a", 1.0, 0.2), case("b", 2.0, 0.2), case("c", 1.0, 0.3)]) == ["a"]


def test_a_result_without_error_is_neither_on_it_nor_in_the_way() -> None:
    results = [case("none", 0.5, None), case("a", 1.0, 0.2), case("empty", 0.1, 0.1, errors={})]
    assert marked(results) == ["a"]


def test_a_pass_without_quantity_is_not_on_it() -> None:
    assert marked([case("a", 1.0, 0.2, quantity="")]) == []


@pytest.mark.parametrize("other", ["a.x.box.8x6", "a.x.hall.6x8"])
def test_other_scenes_and_sizes_do_not_compete(other: str) -> None:
    assert marked([case("y", 2.0, 0.2), entry(other, 1.0, 0.1)]) == ["y", "x"]


def test_other_quantities_do_not_compete() -> None:
    assert marked([case("a", 2.0, 0.2), case("b", 1.0, 0.1, quantity="direct")]) == ["a", "b"]


def test_wall_time_counts_whatever_the_device_says() -> None:
    slow = case("slow", 2.0, 0.2, device_ms={"median": 0.1, "low": 0.1, "high": 0.1})
    assert marked([slow, case("fast", 1.0, 0.1, device_ms=None)]) == ["fast"]


def test_old_marks_go_and_exact_results_count() -> None:
    assert marked([case("a", 1.0, 0.0), case("b", 2.0, 0.0, front=True)]) == ["a"]
    assert marked([]) == []


def test_what_is_unsteady_counts_like_any_other() -> None:
    results = [case("busy", 1.0, 0.1, unsteady="the machine was busy"), case("sure", 2.0, 0.2)]
    assert marked(results) == ["busy"]


def test_what_is_beaten_only_by_results_that_overlap_with_it_in_time_is_near() -> None:
    wide = {"median": 2.2, "low": 1.9, "high": 2.6}
    results = [case("best", 2.0, 0.1), case("near", 2.2, 0.2, wall_ms=wide), case("beaten", 2.2, 0.3)]
    assert marked(results) == ["best"]
    assert [result["setting"] for result in results if result["near"]] == ["near"]
