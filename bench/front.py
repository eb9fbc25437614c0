"""The Pareto front: results that no other beats in both time and error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .document import clock, groups, metric, timed

Result = Mapping[str, Any]


def mark(results: list[dict[str, Any]]) -> None:
    """Set "front" and "near" of every result.

    A result is on the front if none of its group (quantity, scene, size) has both no greater
    median wall time and no greater RMSE against the world's reference, with one of the two less.
    Of results that are equal in both, all are on it. It is near the front if it is off it only
    because of results whose quartiles of time overlap with its own: whether they are faster is not
    certain. Unsteady results count like any other. A result without quantity, error or time is
    neither.
    """
    for result in results:
        result["front"] = result["near"] = False
    for (quantity, _, _), group in groups(results).items():
        if not quantity:
            continue
        points = comparable(group)
        for result, rivals in zip(points, rivals_of(points), strict=True):
            result["front"] = not rivals
            result["near"] = bool(rivals) and all(overlap(other, result) for other in rivals)


def comparable(results: Sequence[Result]) -> list[Any]:
    """Return the results that have both a time and an error, the fastest first."""
    found = [r for r in results if timed(r) and metric(r, "world", "rmse") is not None]
    return sorted(found, key=lambda r: (clock(r)["median"], error_of(r)))


def error_of(result: Result) -> float:
    """Return a result's RMSE against the world's reference, which it has."""
    error = metric(result, "world", "rmse")
    assert error is not None  # noqa: S101  see `comparable`
    return error


def rivals_of(results: Sequence[Result]) -> list[list[Result]]:
    """Return for each result those that beat it: no greater time and error, and one is less."""
    points = np.array([(clock(r)["median"], error_of(r)) for r in results]).reshape(-1, 2)
    no_greater = (points <= points[:, None]).all(axis=-1)
    is_beaten_by = np.logical_and(no_greater, (points < points[:, None]).any(axis=-1))
    return [[results[int(k)] for k in np.flatnonzero(is_beaten_by[row])] for row in range(len(results))]


def overlap(one: Result, other: Result) -> bool:
    """Return whether the quartiles of two results' times overlap."""
    a, b = clock(one), clock(other)
    return a["low"] <= b["high"] and b["low"] <= a["high"]
