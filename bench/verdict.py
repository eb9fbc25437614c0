"""Verdict on the rows of a group: the Pareto front, and the side of least error within a time.

Every sentence follows from the rows alone, unsteady ones included, by their median wall times;
where quartiles overlap, the sentence says so. The front holds the results that no other beats in
both time and error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from .document import clock, groups, metric, timed
from .peers import PEERS, embree, mitsuba_frame, mitsuba_rays
from .wording import NOTHING, number, short_name

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


PUBLISHED = {"xegtao": "XeGTAO's High setting"}
"""Families that measure settings which others published, with this library's kernels."""

STATIC = (*embree.FAMILIES, *mitsuba_rays.STATIC, *mitsuba_frame.KEPT)
"""Families of rays and paths against a mesh that does not move: its tree is built once."""
MOVING = tuple(mitsuba_rays.MOVING)
"""Families of rays against a mesh that moves: its tree is built in every run."""

OWN = "this library"
RAYS = "rays against the mesh"
MOST_PAIRS = 3
"""Pairs of results that are named because their times overlap."""

BUDGETS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Wall milliseconds, of the tables."""
MESHES: Mapping[str, tuple[str, ...]] = {
    "There is no mesh": (),
    "The mesh does not move": (*STATIC, *(name for name in PEERS if name not in MOVING)),
    "The mesh moves": tuple(name for name in PEERS if name not in STATIC),
}
"""Knowledge of the mesh -> the other programs that can be used then."""


def verdict(results: Sequence[Result]) -> list[str]:
    """Return what the results of one group say, a statement each.

    One for each published setting; one for a mesh that does not move, and one for a mesh that
    moves, each over the rows of this library and of such rays. Empty where there is nothing of
    this library, or nothing to compare it with.
    """
    rows = comparable(results)
    if not any(_own(row) for row in rows):
        return []
    said = [_within(row, rows) for row in rows if row["family"] in PUBLISHED]
    for families, what in (
        (STATIC, "The mesh does not move (tree built once, not counted)"),
        (MOVING, "The mesh moves (tree built in every frame, counted)"),
    ):
        if any(row["family"] in families for row in rows):
            said.append(_sides([r for r in rows if _own(r) or r["family"] in families], what))
    return said


def leader(rows: Sequence[Result], ms: float) -> Any:
    """Return the row of least error among those whose median time is at most `ms`, or None.

    Of equal errors the fastest.
    """
    within = [row for row in rows if clock(row)["median"] <= ms]
    return min(within, key=lambda r: (error_of(r), clock(r)["median"]), default=None)


def told(row: Result) -> str:
    """Return a row's name with its RMSE and its time."""
    return f"{short_name(row)} (RMSE {number(error_of(row))}, {number(clock(row)['median'])} ms)"


def _own(row: Result) -> bool:
    return row["family"] not in PEERS and row["family"] not in PUBLISHED


def _within(published: Result, rows: Sequence[Result]) -> str:
    """Return what else can be had in the time of a published setting."""
    best = leader(rows, clock(published)["median"])
    said = f"{PUBLISHED[published['family']]}: {told(published)}. In that time"
    if best is published:
        return f"{said} no row has less error."
    tie = "; their times overlap" if overlap(best, published) else ""
    return f"{said} {told(best)} has the least error{tie}."


def _sides(rows: Sequence[Result], what: str) -> str:
    """Return which side has the least error from which time on.

    Args:
        rows: of both sides, the fastest first; see `comparable`.
        what: the case that is compared.
    """
    front = [row for row, rivals in zip(rows, rivals_of(rows), strict=True) if not rivals]
    runs = [list(run) for _, run in groupby(front, key=_own)]
    parts = []
    for run in runs:
        last = f" to {told(run[-1])}" if len(run) > 1 else ""
        side = OWN if _own(run[0]) else RAYS
        parts.append(f"{side} from {number(clock(run[0])['median'])} ms on, {told(run[0])}{last}")
    said = f"{what}. Least error: {'; then '.join(parts)}."
    pairs = _uncertain(rows, runs)
    if pairs:
        said += f" Their times overlap, so that their order is not certain: {'; '.join(pairs)}."
    return said


def _uncertain(rows: Sequence[Result], runs: Sequence[Sequence[Result]]) -> list[str]:
    """Return pairs of results of both sides whose order in time decides, and is not certain."""
    pairs = [(run[-1], following[0]) for run, following in pairwise(runs)]
    for row, rivals in zip(rows, rivals_of(rows), strict=True):
        if rivals and all(overlap(other, row) for other in rivals):
            pairs += [(other, row) for other in rivals if _own(other) != _own(row)][:1]
    names = [f"{short_name(a)} and {short_name(b)}" for a, b in pairs if overlap(a, b)]
    return list(dict.fromkeys(names))[:MOST_PAIRS]


def guides(document: Mapping[str, Any]) -> dict[str, list[tuple[str, ...]]]:
    """Return key of `MESHES` -> a table: budget in ms, and for each scene setting and RMSE.

    The first row is the heading. Empty unless the document holds our A beside that of rays.
    """
    found = {
        f"{scene}, {columns} x {rows}": results
        for (quantity, scene, (rows, columns)), results in groups(document["results"]).items()
        if quantity == "occlusion" and verdict(results)
    }

    def cell(rows: Sequence[Result], ms: float) -> str:
        best = leader(rows, ms)
        return NOTHING if best is None else f"{short_name(best)} {number(error_of(best))}"

    made = {}
    for case, peers in MESHES.items() if found else ():
        kept = [
            comparable([r for r in results if r["family"] not in PEERS or r["family"] in peers])
            for results in found.values()
        ]
        made[case] = [("ms", *found), *((f"{ms:g}", *(cell(rows, ms) for rows in kept)) for ms in BUDGETS)]
    return made
