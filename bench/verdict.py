"""When to cast rays instead: an image-space technique against rays that reach the same error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from .document import clock, metric, timed
from .peers import PEERS
from .peers.embree import MOVING, STATIC
from .wording import number, short_name

_Result = Mapping[str, Any]


def rays_ms(
    results: Sequence[_Result], rmse: float, families: Iterable[str] = tuple(STATIC)
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
    """Return from which error on rays are the better choice, in a sentence or two.

    One for geometry that stands still, one for geometry that moves, so that the rays' search tree
    is built again. "" where a group has no rays, or nothing of this library, to compare; unsteady
    results don't count.
    """
    results = [result for result in results if not result["unsteady"]]
    mine = sorted(
        (error, clock(result)["median"], short_name(result))
        for result in results
        if result["family"] not in PEERS and timed(result)
        and (error := metric(result, "world", "rmse")) is not None
    )
    said = []
    for families, where in (
        (STATIC, "the building of their tree not counted"),
        (MOVING, "the building of their tree counted"),
    ):
        if mine and any(result["family"] in families for result in results):
            said.append(_crossing(results, mine, tuple(families), where))
    return " ".join(said)


def _crossing(
    results: Sequence[_Result], mine: Sequence[tuple[float, float, str]],
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
