"""Results as tables in a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .document import groups, metric
from .verdict import verdict
from .wording import (
    NOTHING,
    calibration_line,
    ceiling,
    device_milliseconds,
    milliseconds,
    number,
    quartiles,
    ratio,
    revision,
    rmse,
    short_name,
    star,
    title,
    unit,
)

Row = Mapping[str, Any]
Cell = Callable[[Row], str]

_LEGEND = (
    "ms: median wall time; device: by the device's clock; * nothing here is both faster and closer "
    "to the world's truth; + only what overlaps with it in time is; ~ unsteady, see below; "
    "ratio: wall time to that of the reference; ceiling: share of the nearer one; FLIP: of light "
    "HDR-FLIP, of frames that of pictures; streaks: root mean square of errors that repeat along a line on smooth "
    "surfaces; mottling: root mean square of a frame's relative "
    "errors on smooth surfaces, between Gaussians of 2 and 20 pixels; model: RMSE and bias against what "
    "the same screen-space model converges to; %: of the truth's mean"
)


def show(document: Mapping[str, Any], console: Console) -> None:
    """Print a document: what it was measured on, a table for each group, what was skipped.

    The console's width decides how many columns there are; 140 characters hold all.
    """
    device, machine = document["device"], document["machine"]
    for line in (
        f"{device['label']}, {device['variant']}; {machine['cpu']}, {machine['threads']} threads",
        f"{document['created']}, revision {revision(document)}",
        calibration_line(document["calibration"]),
        f"reference: {document['reference']['name']}, {number(document['reference']['ms'])} ms",
    ):
        console.print(escape(line), highlight=False)
    for key, results in groups(document["results"]).items():
        console.print()
        errors = unit(key[0]) and f", errors in{unit(key[0])}"
        console.print(_fitting(title(key) + errors, results, document, console))
        for said in verdict(results):
            console.print(escape(said), highlight=False)
    for result in document["results"]:
        if result["unsteady"]:
            console.print(escape(f"~ {result['name']}: {result['unsteady']}"), highlight=False)
    if document["results"]:
        console.print(escape(_LEGEND), style="dim", highlight=False)
    else:
        console.print("nothing was measured")
    for entry in document["skipped"]:
        console.print(escape(f"skipped {entry['name']}: {entry['reason']}"), highlight=False)


def _fitting(heading: str, results: list[dict[str, Any]], document: Mapping[str, Any], console: Console) -> Table:
    """Return the table with as many columns as the console is wide enough for."""
    columns = _columns(document["calibration"])
    # A column without a number in any row says nothing.
    columns = [column for column in columns if not column[1] or any(column[2](row) != NOTHING for row in results)]
    # Ranks from the most needed, 0, on.
    for last in range(max(rank for _, rank, _ in columns), -1, -1):
        table = Table(
            title=escape(heading), box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), title_justify="left", title_style="bold"
        )
        kept = [column for column in columns if column[1] <= last]
        for name, _, _ in kept:
            table.add_column(
                name, justify="left" if name in ("", "case") else "right", overflow="fold", no_wrap=name != "case"
            )
        for row in results:
            table.add_row(*(escape(cell(row)) for _, _, cell in kept))
        # Measured on a console without end, since a narrow one narrows what is measured.
        if console.measure(table, options=console.options.update(width=10_000)).maximum <= (console.width):
            break
    return table


def _columns(calibration: Mapping[str, float]) -> list[tuple[str, int, Cell]]:
    """Return (heading, rank, cell) of each column; the highest rank goes first."""

    def share(row: Row) -> str:
        reached, what = ceiling(row, calibration)
        return f"{100.0 * reached:.0f} % {what}" if what else NOTHING

    return [
        ("", 0, lambda row: star(row) or " "),
        ("case", 0, short_name),
        ("ms", 0, milliseconds),
        ("quartiles", 3, quartiles),
        ("device", 5, device_milliseconds),
        ("ratio", 2, ratio),
        ("G/s", 6, lambda row: number(row.get("samples_g_s"))),
        ("GB/s", 7, lambda row: number(row.get("moved_gb_s"))),
        ("ceiling", 4, share),
        ("RMSE", 1, lambda row: rmse(row, "world")),
        ("bias", 2, lambda row: number(metric(row, "world", "bias"), "+")),
        ("MRSE", 3, lambda row: number(metric(row, "world", "mrse"))),
        ("FLIP", 3, lambda row: number(metric(row, "world", "flip"))),
        ("streaks", 4, lambda row: number(metric(row, "world", "streaks"))),
        ("mottling", 3, lambda row: number(metric(row, "world", "mottling"))),
        ("model", 4, lambda row: rmse(row, "assumption")),
        ("its bias", 5, lambda row: number(metric(row, "assumption", "bias"), "+")),
    ]
