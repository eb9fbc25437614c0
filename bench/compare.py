"""Comparison of two runs of the benchmark: changes of time and error beyond noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .document import metric
from .wording import number

TIME_CHANGE = 0.1
"""Two runs of a case agree to this share of the ratio to the reference; less is noise."""
ERROR_CHANGE = 0.01
"""Other compilers and variants round differently: less than this share of an RMSE is noise."""
SIGMAS = 3.0
_NOT_OF_TRUTH = ("seconds", "repeats", "runs")
"""Options on which a truth does not depend."""


STYLES = {"slower": "bold red", "worse": "bold red", "faster": "green", "better": "green"}
"""Verdicts on changes beyond noise, of time and of an RMSE, in the order in which they are shown."""


@dataclass(frozen=True)
class Change:
    """A number of a case that moved: its ratio to the reference case, or an RMSE; `verdict`: of `STYLES`."""

    verdict: str
    name: str
    what: str
    before: float
    after: float


@dataclass
class Comparison:
    """Changes of the cases that two documents share, and the cases that they don't share.

    Attributes:
        changes: beyond noise.
        missing: cases of the first document alone, with the second's reason if it gives one. They
            do not count as failed: what was not measured can't be told.
        new: cases of the second document alone.
        notes: what limits the comparison.
        compared: how many cases are in both.
    """

    changes: list[Change] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    new: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    compared: int = 0

    @property
    def failed(self) -> bool:
        """Whether anything got slower or worse."""
        return bool(self.of("slower") or self.of("worse"))

    def of(self, verdict: str) -> list[Change]:
        """Return the changes of one verdict."""
        return [change for change in self.changes if change.verdict == verdict]


def compare(before: Mapping[str, Any], after: Mapping[str, Any]) -> Comparison:
    """Compare two documents, case by case.

    Wall times are compared as ratios to the reference measured beside them. A change counts if it
    is more than 10 % and the quartiles don't overlap, unsteady or not: the quartiles show it. An
    RMSE, of either truth, changed if it moved by more than `error_noise`. Errors are not compared
    if the truths were made with other options.

    Raises:
        ValueError: the documents have no case in common.
    """
    old = {result["name"]: result for result in before["results"]}
    new = {result["name"]: result for result in after["results"]}
    common = [name for name in old if name in new]
    if not common:
        raise ValueError(f"no case is in both, of {len(old)} before and {len(new)} after: nothing to compare")
    found = Comparison(compared=len(common), new=[name for name in new if name not in old])
    reasons = {entry["name"]: entry["reason"] for entry in after["skipped"]}
    for name in old:
        if name not in new:
            found.missing.append(f"{name}: {reasons[name]}" if name in reasons else name)
    same_truths = _note_differences(before, after, found.notes)
    for name in common:
        _compare_times(old[name], new[name], found)
        if same_truths:
            _compare_errors(old[name], new[name], found)
    return found


def error_noise(before: float, errors: tuple[float, float], pixels: int) -> float:
    """Return by how much an RMSE may move without meaning anything.

    A truth with the standard error s adds s^2 to the mean squared error M^2 that an exact one would
    show: an RMSE of sqrt(M^2 + s^2). So the RMSE moves if s does. Besides, the noise of two truths
    that were made independently moves it by at most hypot(s_before, s_after) / sqrt(N) for N
    pixels, of which 3 are allowed. The bound is the sum, or 1 % of the RMSE if that is more.

    Args:
        before: the first RMSE.
        errors: root mean square of the standard error of the first truth and of the second; 0 for
            one that is exact or unknown because every run makes the same one.
        pixels: N, all of the image.
    """
    squared = max(0.0, before**2 - errors[0] ** 2)
    moved = abs(math.sqrt(squared + errors[1] ** 2) - math.sqrt(squared + errors[0] ** 2))
    noise = moved + SIGMAS * math.hypot(*errors) / math.sqrt(pixels)
    return max(ERROR_CHANGE * before, noise)


def show(comparison: Comparison, console: Console) -> None:
    """Print a comparison: what limits it, every change, and the verdict last."""
    for note in comparison.notes:
        console.print(escape(f"note: {note}"), highlight=False)
    table = Table("", "case", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("before", "after", "change"):
        table.add_column(heading, justify="right")
    for verdict, style in STYLES.items():
        for change in comparison.of(verdict):
            table.add_row(
                f"[{style}]{verdict}[/]",
                escape(f"{change.name} ({change.what})"),
                number(change.before),
                number(change.after),
                _relative(change),
            )
    if table.row_count:
        console.print(table)
    for heading, names in (("no longer there, so not judged", comparison.missing), ("new", comparison.new)):
        for name in names:
            console.print(escape(f"{heading}: {name}"), highlight=False)
    slower, worse, faster, better = (len(comparison.of(verdict)) for verdict in STYLES)
    console.print(
        f"{comparison.compared} cases compared: {slower} slower, {worse} errors worse, {faster} faster, "
        f"{better} errors better beyond noise",
        highlight=False,
    )


def _relative(change: Change) -> str:
    if change.before == 0.0:
        return "from 0"
    return f"{100.0 * (change.after / change.before - 1.0):+.1f} %"


def _note_differences(before: Mapping[str, Any], after: Mapping[str, Any], notes: list[str]) -> bool:
    """Say what differs between two runs; return whether their errors can be compared."""
    for name, what in (("label", "devices"), ("variant", "kernel variants")):
        one, two = before["device"][name], after["device"][name]
        if one != two:
            notes.append(
                f"the {what} differ: {one} and {two}. Times are ratios to the reference case of "
                "each; a change may be theirs"
            )
    one, two = before["options"], after["options"]
    other = [
        f"{name} {one.get(name)} and {two.get(name)}"
        for name in sorted({*one, *two} - {*_NOT_OF_TRUTH})
        if one.get(name) != two.get(name)
    ]
    if other:
        notes.append(f"errors are not compared, the truths differ: {', '.join(other)}")
    return not other


def _compare_times(old: Mapping[str, Any], new: Mapping[str, Any], found: Comparison) -> None:
    one, two = old["ratio"], new["ratio"]
    slower = two["median"] > (1.0 + TIME_CHANGE) * one["median"] and two["low"] > one["high"]
    faster = one["median"] > (1.0 + TIME_CHANGE) * two["median"] and one["low"] > two["high"]
    if slower or faster:
        verdict = "slower" if slower else "faster"
        found.changes.append(Change(verdict, old["name"], "time ratio", one["median"], two["median"]))


def _compare_errors(old: Mapping[str, Any], new: Mapping[str, Any], found: Comparison) -> None:
    for truth in ("world", "assumption"):
        one, two = metric(old, truth, "rmse"), metric(new, truth, "rmse")
        if one is None and two is None:
            continue
        if one is None or two is None:
            side = "before" if one is None else "after"
            found.notes.append(f"the error of {old['name']} ({truth}) is not compared: there is none {side}")
            continue
        errors = (metric(old, truth, "truth_error") or 0.0, metric(new, truth, "truth_error") or 0.0)
        noise = error_noise(one, errors, math.prod(new["size"]))
        if abs(two - one) > noise:
            verdict = "worse" if two > one else "better"
            found.changes.append(Change(verdict, old["name"], f"RMSE, {truth}", one, two))
