"""Which setting has the least error within a time: a table made from the rows of a document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .document import groups
from .front import comparable, error_of
from .peers import PEERS
from .verdict import MOVING, STATIC, leader, verdict
from .wording import NOTHING, number, short_name

BUDGETS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Wall milliseconds."""

CASES: Mapping[str, tuple[str, ...]] = {
    "There is no mesh": (),
    "The mesh does not move": (*STATIC, *(name for name in PEERS if name not in MOVING)),
    "The mesh moves": tuple(name for name in PEERS if name not in STATIC),
}
"""What is known of the mesh -> the other programs that can be used then."""


@dataclass(frozen=True)
class Guide:
    """A table for one case.

    Attributes:
        case: key of `CASES`.
        scenes: headings of the columns.
        rows: budget in ms -> for each scene the setting of least error within it, and its RMSE.
    """

    case: str
    scenes: tuple[str, ...]
    rows: Mapping[float, tuple[str, ...]]


def guides(document: Mapping[str, Any]) -> list[Guide]:
    """Return the tables of a document; none unless it holds our A beside that of rays."""
    found = {
        key: results
        for key, results in groups(document["results"]).items()
        if key[0] == "occlusion" and verdict(results)
    }
    scenes = tuple(f"{key[1]}, {key[2][1]} x {key[2][0]}" for key in found)
    if not found:
        return []
    made = []
    for case, peers in CASES.items():
        kept = [
            comparable([r for r in results if r["family"] not in PEERS or r["family"] in peers])
            for results in found.values()
        ]
        rows = {ms: tuple(_cell(rows, ms) for rows in kept) for ms in BUDGETS}
        made.append(Guide(case, scenes, rows))
    return made


def _cell(rows: list[Any], ms: float) -> str:
    best = leader(rows, ms)
    return NOTHING if best is None else f"{short_name(best)} {number(error_of(best))}"
