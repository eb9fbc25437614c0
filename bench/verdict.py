"""When to cast rays instead, and what this library's own are worth beside what is published."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from .document import clock, metric, timed
from .peers import PEERS, mitsuba_path
from .peers.embree import MOVING, STATIC
from .wording import number, short_name

_Result = Mapping[str, Any]

PUBLISHED = {"xegtao": "XeGTAO's High setting"}
"""Families that measure what others chose, with this library's kernels."""

STILL = (*STATIC, *mitsuba_path.FAMILIES)
"""Families of rays and paths through geometry that stands still."""

ALIKE = 1.05
"""Times that differ by no more than this factor are called the same cost."""


def rays_ms(
    results: Sequence[_Result], rmse: float, families: Iterable[str] = STILL
) -> float | None:
    """Return the least time in which rays have at most this error against the world's truth.

    Between two settings of a family time is a power of the error; where one ray already has less
    error, it is the time of that. None where no number of rays that was measured reaches it.

    Args:
        results: of one group.
        rmse: the error, > 0.
        families: of rays against the mesh.
    """
    best = None
    for family in families:
        points = sorted(
            (error, clock(result)["median"])
            for result in results
            if result["family"] == family
            and (error := metric(result, "world", "rmse")) is not None
            and error > 0.0
        )
        if not points or rmse < points[0][0]:
            continue
        time = points[-1][1]
        for (low, slow), (high, fast) in pairwise(points):
            if low <= rmse < high:
                share = math.log(rmse / low) / math.log(high / low)
                time = slow * (fast / slow) ** share
        best = time if best is None else min(best, time)
    return best


def verdict(results: Sequence[_Result]) -> str:
    """Return from which error on rays are the better choice, in some sentences.

    Some for geometry that stands still, some for geometry that moves, so that the rays' search tree
    is built again; and one for each published setting. "" where a group has no rays, or nothing of
    this library, to compare; unsteady results don't count.
    """
    results = [result for result in results if not result["unsteady"]]
    mine = _points(
        result for result in results
        if result["family"] not in PEERS and result["family"] not in PUBLISHED and timed(result)
    )
    said = [
        _beside(PUBLISHED[result["family"]], point, mine)
        for result in results if result["family"] in PUBLISHED
        for point in _points([result]) if mine
    ]
    for families, where in (
        (STILL, "the building of their tree not counted"),
        (tuple(MOVING), "the building of their tree counted"),
    ):
        if mine and any(result["family"] in families for result in results):
            said.append(_crossing(results, mine, families, where))
            rays = _points(result for result in results if result["family"] in families)
            if rays:
                first = min(rays, key=lambda point: point[1])
                said.append(_beside(f"The fastest of these rays, {first[2]},", first, mine))
    return " ".join(said)


_Point = tuple[float, float, str]
"""Error, time and name of a result."""


def _points(results: Iterable[_Result]) -> list[_Point]:
    """Return those of results that have an error, by error."""
    return sorted(
        (error, clock(result)["median"], short_name(result))
        for result in results
        if (error := metric(result, "world", "rmse")) is not None
    )


def _beside(what: str, of: _Point, mine: Sequence[_Point]) -> str:
    """Return what this library reaches at the cost of something else."""
    error, time, _ = of
    said = f"{what} has an RMSE of {number(error)} in {number(time)} ms"
    within = [point for point in mine if point[1] <= ALIKE * time]
    if not within:
        return f"{said}; nothing of this library is as fast."
    least, took, name = within[0]
    return f"{said}; at that cost {name} has {number(least)}, in {number(took)} ms."


def _crossing(
    results: Sequence[_Result], mine: Sequence[_Point],
    families: tuple[str, ...], where: str,
) -> str:
    """Return where rays of some families overtake.

    Args:
        results: of one group.
        mine: (error, time, name) of this library's, by error.
        families: of rays.
        where: what their time is of.
    """
    ahead = [
        (error, time, name)
        for error, time, name in mine
        if (rays := rays_ms(results, error, families)) is None or time < rays
    ]
    if not ahead:
        return (
            "Rays against the mesh reach every error measured here in less time, "
            f"{where}."
        )
    error, time, name = ahead[0]
    rays = rays_ms(results, error, families)
    if rays is None:
        return (
            f"No rays measured reach an RMSE of {number(error)}, which {name} has in "
            f"{number(time)} ms: from where on they are the better choice can't be told, {where}."
        )
    return (
        f"Rays against the mesh are the better choice below an RMSE of {number(error)}, which "
        f"{name} has in {number(time)} ms (rays need {number(rays)} ms), {where}."
    )
