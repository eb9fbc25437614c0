"""The Pareto front: results that no other beats in both time and error."""

from __future__ import annotations

import math
from typing import Any

from .document import clock, groups, metric, timed


def mark(results: list[dict[str, Any]]) -> None:
    """Set "front" of every result.

    A result is on the front if none of its group (quantity, scene, size) has both no greater
    median time and no greater RMSE against the world's truth, with one of the two less. Of results
    that are equal in both, all are on it. A result without quantity, error or time, or
    that is unsteady, never is.
    """
    for result in results:
        result["front"] = False
    for (quantity, _, _), group in groups(results).items():
        if not quantity:
            continue
        points = []
        for result in group:
            rmse = metric(result, "world", "rmse")
            if rmse is not None and not result["unsteady"] and timed(result):
                points.append((clock(result)["median"], rmse, result))
        points.sort(key=lambda point: point[:2])
        latest = (math.nan, math.inf)
        for time, rmse, result in points:
            if rmse < latest[1] or (time, rmse) == latest:
                result["front"] = True
                latest = (time, rmse)
