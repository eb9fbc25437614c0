"""Scan constants of a technique's defaults: `python -m ssgi_cl.bench.defaults --help`.

Errors on the scenes for tuning decide, those on the scenes for validation confirm; those on the
scenes that are reported are shown, and must decide nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques import TECHNIQUES

from .scene_sets import SETS, SceneSets, geometric_mean
from .tunables import entry_of


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


def scan(
    technique: str, tried: Sequence[Mapping[str, Any]], sets: SceneSets, layers: int
) -> list[dict[str, float]]:
    """Return, for each of `tried`, the geometric mean of the RMSE over the views of each set."""
    trials = sets.trials(entry_of(technique), layers)
    return [
        {name: geometric_mean(trial.errors(values)) for name, trial in trials.items()}
        for values in tried
    ]


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


@click.command()
@click.argument("technique", type=click.Choice(sorted(TECHNIQUES)))
@click.argument("values", nargs=-1, required=True, metavar="NAME=VALUE,VALUE...")
@click.option("--grid", is_flag=True, help="All combinations, in place of one constant at a time.")
@click.option("--layers", multiple=True, type=int, default=(1,), show_default=True,
              help="Depth layers of the G-buffers; may be given several times.")
@click.option("--meshes", type=click.Path(path_type=Path, file_okay=False, exists=True),
              help="The folder of the meshes of docs/views; without, the built-in reported scenes "
              "alone are shown.")
@click.option("--device", metavar="WORDS", help="Words of the device's label.")
def main(technique: str, values: tuple[str, ...], grid: bool, layers: tuple[int, ...],
         meshes: Path | None, device: str | None) -> None:
    """Print the RMSE of TECHNIQUE with other constants than its defaults."""
    tried = settings(values, grid=grid)
    sets = SceneSets(Runtime.open(device), meshes=meshes)
    table = Table("setting", *(f"{name} {count}" for count in layers for name in SETS),
                  title=f"{technique}: RMSE (percent of the defaults'), by depth layers")
    found = [scan(technique, tried, sets, count) for count in layers]
    for index, setting in enumerate(tried):
        cells = [
            f"{rows[index][name]:.4f} ({100.0 * rows[index][name] / rows[0][name]:.1f})"
            for rows in found for name in SETS
        ]
        label = ", ".join(f"{key} {value}" for key, value in setting.items()) or "defaults"
        table.add_row(label, *cells)
    Console(width=40 + 20 * len(layers) * len(SETS)).print(table)


if __name__ == "__main__":
    main()
