"""Record the presets of a technique: `python -m ssgi_cl.bench.presets --help`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ssgi_cl import presets
from ssgi_cl.atomic import replacement
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques import TECHNIQUES

from .context import Progress as Report
from .tunables import entry_of, views_of
from .tune import Session
from .tuning import Tuning

BUDGETS = {"low": 0.6, "medium": 1.0, "high": 2.0, "ultra": 5.0}
"""Time of each preset over that of the technique's default parameters, at most."""

SWEEPS = 2
"""Searches for each preset."""


def record_presets(
    technique: str, *, runtime: Runtime | None = None, progress: Report | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Tune a technique for each of `BUDGETS` and return the document that its presets are.

    Args:
        technique: key in `TECHNIQUES`.
        runtime, progress: as in `tune`.
        **options: `size`, `parameters`, `fixed` and `metric` of `tune`, and its `scenes`.

    Raises:
        ValueError, TuneError: as `tune`.
    """
    views = views_of(options.pop("scenes", None))
    session = Session(entry_of(technique), views, runtime=runtime, progress=progress, **options)
    usual = session.trials.measure({})
    usual_ms = session.trials.confirm(usual).ms
    found: dict[str, Tuning] = {}
    # Each search begins with all that is known: from dear to cheap, and a second time from other
    # points, so that what one of them found serves the others too.
    for seed in range(SWEEPS):
        for name in reversed(BUDGETS):
            if progress is not None:
                progress(f"preset {name}", 0.0)
            found[name] = session.tune(BUDGETS[name] * usual_ms, None, seed=seed)
    in_order = {name: found[name] for name in BUDGETS}
    return document(in_order, {"ms": usual_ms, "error": usual.error})


def document(found: Mapping[str, Tuning], usual: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is written to a file of presets."""
    any_ = next(iter(found.values()))
    return {
        "format": "ssgi-presets 1",
        "technique": any_.technique,
        "recorded by": f"python -m ssgi_cl.bench.presets {any_.technique}",
        "date": any_.date,
        "version": any_.version,
        "device": any_.device,
        "form": any_.form,
        "size": list(any_.size),
        "metric": any_.metric,
        "truth": dict(any_.truth),
        "scenes": [dict(scene) for scene in any_.scenes],
        "default": dict(usual),
        "presets": {
            name: {
                "parameters": {key: _rounded(value) for key, value in tuning.parameters.items()},
                "ms": _rounded(tuning.ms),
                "budget_ms": _rounded(tuning.budget_ms),
                "error": _rounded(tuning.error),
            }
            for name, tuning in found.items()
        },
    }


def _rounded(value: Any) -> Any:
    """Return a number to 4 digits: no more than that can be told apart."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


@click.command()
@click.argument("technique", type=click.Choice(sorted(TECHNIQUES)))
@click.option("--device", metavar="WORDS", help="Words of the device's label; by default the "
              "fastest found.")
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False),
              help="The JSON file; by default the one that the library reads.")
def main(technique: str, device: str | None, output: Path | None) -> None:
    """Record the presets of TECHNIQUE: parameters tuned on the built-in scenes for this purpose.

    Takes some minutes. Nothing else should keep the machine busy meanwhile.
    """
    console = Console(stderr=True)
    bar = Progress(TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(),
                   console=console, transient=True, disable=not console.is_terminal)
    with bar:
        task = bar.add_task("", total=1.0)
        result = record_presets(
            technique,
            runtime=Runtime.open(device),
            progress=lambda text, share: bar.update(task, description=text, completed=share),
        )
    path = output or Path(presets.__file__).parent / f"{technique}.json"
    with replacement(path) as file:
        file.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    usual = result["default"]
    table = Table("preset", "ms", result["metric"], "parameters", title=result["device"])
    table.add_row("(default)", f"{usual['ms']:.2f}", f"{usual['error']:.4f}", "")
    for name, preset in result["presets"].items():
        table.add_row(name, f"{preset['ms']:.2f}", f"{preset['error']:.4f}",
                      ", ".join(f"{key} {value}" for key, value in preset["parameters"].items()))
    Console().print(table)


if __name__ == "__main__":
    main()
