"""When to cast rays instead: an image-space technique against rays that reach the same error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from .document import clock, metric
from .peers import PEERS
from .wording import number, short_name

RAYS = ("embree", "embree-blur")
"""Families of rays against the mesh."""


def rays_ms(results: Sequence[Mapping[str, Any]], rmse: float) -> float | None:
    """Return the least time in which rays have at most this error against the world's truth.

    Between two settings of a family time is a power of the error; where one ray already has less
    error, it is the time of that. None where no number of rays that was measured reaches it.
    """
    best = None
    for family in RAYS:
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


def verdict(results: Sequence[Mapping[str, Any]]) -> str:
    """Return from which error on rays are the better choice, in a sentence.

    "" where a group has no rays, or nothing of this library, to compare; unsteady results don't
    count.
    """
    results = [result for result in results if not result["unsteady"]]
    mine = [
        (error, clock(result)["median"], short_name(result))
        for result in results
        if result["family"] not in PEERS
        and (error := metric(result, "world", "rmse")) is not None
    ]
    if not mine or not any(result["family"] in RAYS for result in results):
        return ""
    ahead = [
        (error, time, name)
        for error, time, name in sorted(mine)
        if (rays := rays_ms(results, error)) is None or time < rays
    ]
    if not ahead:
        return (
            "Rays against the mesh reach every error measured here in less time, the building of "
            "their tree not counted."
        )
    error, time, name = ahead[0]
    rays = rays_ms(results, error)
    if rays is None:
        return (
            f"No rays measured reach an RMSE of {number(error)}, which {name} has in "
            f"{number(time)} ms: from where on they are the better choice can't be told."
        )
    return (
        f"Rays against the mesh are the better choice below an RMSE of {number(error)}, which "
        f"{name} has in {number(time)} ms (rays need {number(rays)} ms), the building of their "
        "tree not counted."
    )
