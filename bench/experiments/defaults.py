"""Scan constants of a technique's defaults: `python -m ssgi_cl.bench.experiments.defaults --help`.

Of techniques of ambient occlusion, the error against rays; of those in `SCANS`, what
`ssgi_cl.bench.experiments.scan.Scan` says: error and counted work, which no other load on the machine changes.
Errors on the scenes for tuning decide, those on the scenes for validation confirm; those on the
scenes that are reported are shown, and must decide nothing.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from ssgi_cl.bench.options import device_option
from ssgi_cl.bench.scene_sets import SETS, SIZE, SceneSets
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import KINDS
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.tuning.trials import geometric_mean
from ssgi_cl.tuning.tunables import entry_of

from . import scan_lights, scan_shadows, scan_views
from .scan import LEAST_ERROR, Measured, Scan

SCANS: Mapping[str, Scan] = {**scan_lights.SCANS, **scan_shadows.SCANS, **scan_views.SCANS}
"""Scans beside those of techniques of ambient occlusion, by name."""


def settings(given: Sequence[str], *, grid: bool) -> list[dict[str, Any]]:
    """Return what to try: the defaults, then each value of NAME=VALUE,VALUE,... alone.

    Args:
        given: of the form NAME=VALUE,VALUE; values are numbers or words.
        grid: all combinations in place of one at a time.

    Raises:
        ValueError: something is not of this form.
    """
    axes: list[tuple[str, list[Any]]] = []
    for text in given:
        name, mark, values = text.partition("=")
        if not mark or not name or not values:
            raise ValueError(f"{text!r}: expected NAME=VALUE,VALUE,...")
        axes.append((name, [_value(value) for value in values.split(",")]))
    if grid:
        names = [name for name, _ in axes]
        combined = itertools.product(*(values for _, values in axes))
        return [{}, *(dict(zip(names, values, strict=True)) for values in combined)]
    return [{}, *({name: value} for name, values in axes for value in values)]


def scan(technique: str, tried: Sequence[Mapping[str, Any]], sets: SceneSets, layers: int) -> list[dict[str, float]]:
    """Return, for each of `tried`, the geometric mean of the RMSE over the views of each set."""
    trials = sets.trials(entry_of(technique), layers)
    return [{name: geometric_mean(trial.errors(values)) for name, trial in trials.items()} for values in tried]


def scan_work(way: Scan, tried: Sequence[Mapping[str, Any]], sets: SceneSets) -> list[dict[str, Measured]]:
    """Return, for each of `tried` and each set, the geometric mean of the error over its views,
    and the mean of what is counted beside."""
    rows = []
    for values in tried:
        row = {}
        for name, contexts in sets.contexts.items():
            found = [way.measure(context, values) for context in contexts if context.punctual_lights]
            row[name] = Measured(
                geometric_mean([max(each.error, LEAST_ERROR) for each in found]),
                statistics.fmean(each.beside for each in found),
            )
        rows.append(row)
    return rows


def front(rows: Sequence[Mapping[str, Measured]], of: str) -> list[bool]:
    """Return whether no other of `rows` has both less error and less beside in the set `of`."""
    points = [(row[of].error, row[of].beside) for row in rows]
    return [
        not any(a <= error and b <= beside and (a, b) != (error, beside) for a, b in points) for error, beside in points
    ]


def _value(text: str) -> Any:
    if text in ("True", "False"):
        return text == "True"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


@click.command()
@click.argument("technique", type=click.Choice(sorted({*TECHNIQUES, *SCANS})))
@click.argument("values", nargs=-1, required=True, metavar="NAME=VALUE,VALUE...")
@click.option("--grid", is_flag=True, help="All combinations, in place of one constant at a time.")
@click.option(
    "--layers",
    multiple=True,
    type=int,
    default=(1,),
    show_default=True,
    help="Depth layers of the G-buffers, of ambient occlusion alone; may be given several times.",
)
@click.option(
    "--meshes",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="The folder of the meshes of docs/views; without, the built-in reported scenes alone are shown.",
)
@click.option(
    "--size", type=(int, int), default=(SIZE[1], SIZE[0]), show_default=True, help="Columns and rows of the pictures."
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    type=click.Choice(tuple(KINDS)),
    help="A kind of generated scenes to tune on and validate with; may be given several times. By default all.",
)
@device_option
def main(
    technique: str,
    values: tuple[str, ...],
    grid: bool,
    layers: tuple[int, ...],
    meshes: Path | None,
    size: tuple[int, int],
    kinds: tuple[str, ...],
    device: str | None,
) -> None:
    """Print the error of TECHNIQUE with other constants than its defaults."""
    tried = settings(values, grid=grid)
    sets = SceneSets(Runtime.open(device), meshes=meshes, size=(size[1], size[0]), kinds=kinds or tuple(KINDS))
    table = work_table(technique, tried, sets) if technique in SCANS else error_table(technique, tried, sets, layers)
    Console(width=40 + 20 * len(table.columns)).print(table)


def error_table(technique: str, tried: Sequence[Mapping[str, Any]], sets: SceneSets, layers: Sequence[int]) -> Table:
    """Return the RMSE of ambient occlusion by setting, numbers of layers and set."""
    table = Table(
        "setting",
        *(f"{name} {count}" for count in layers for name in SETS),
        title=f"{technique}: RMSE (percent of the defaults'), by depth layers",
    )
    found = [scan(technique, tried, sets, count) for count in layers]
    for index, setting in enumerate(tried):
        cells = [
            f"{rows[index][name]:.4f} ({100.0 * rows[index][name] / rows[0][name]:.1f})"
            for rows in found
            for name in SETS
        ]
        table.add_row(_label(setting), *cells)
    return table


def work_table(technique: str, tried: Sequence[Mapping[str, Any]], sets: SceneSets) -> Table:
    """Return error and what is counted beside it, by setting and set."""
    way = SCANS[technique]
    rows = scan_work(way, tried, sets)
    table = Table(
        "setting", *SETS, "on the front", title=f"{technique}: {way.error} (percent of the defaults'), {way.beside}"
    )
    for setting, row, best in zip(tried, rows, front(rows, "tuning"), strict=True):
        cells = [
            f"{row[name].error:.4f} ({100.0 * row[name].error / rows[0][name].error:.1f}), {row[name].beside:.3g}"
            for name in SETS
        ]
        table.add_row(_label(setting), *cells, "yes" if best else "")
    return table


def _label(setting: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for key, value in setting.items()) or "defaults"


if __name__ == "__main__":
    main()
