"""Record the presets of a technique: `python -m ssgi_cl.bench.presets --help`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ssgi_cl import presets
from ssgi_cl.atomic import replacement
from ssgi_cl.presets.pace import measured
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques import TECHNIQUES
from ssgi_cl.techniques.occlusion import RESOLUTIONS

from .context import Progress as Report
from .trials import Trial
from .tunables import entry_of, views_of
from .tune import Session, error_of
from .tuning import Bound, TuneError, front

BUDGETS = {"low": 0.6, "medium": 1.0, "high": 2.0, "ultra": 5.0}
"""Time of each preset over that of the technique's default parameters, at most."""

OVERSCAN = 0.1
"""Of the G-buffers tuned on; the error without it is recorded too."""

ROUNDS = {"high": 2, "ultra": 0, "medium": 0, "low": 0}
"""Of the searches with the fewest layers: the first looks all over, the others near its best."""
FURTHER_ROUNDS = {"high": 0, "medium": 0, "low": 0}
"""Of those with more layers, which begin with the settings that are best for fewer; there the
dearest budget finds nothing that a cheaper one does not."""

SPACING = 1.2
"""Times of neighbours on a recorded curve differ by about this factor."""


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
    entry, views = entry_of(technique), views_of(options.pop("scenes", None))
    runtime = runtime or Runtime.open()
    recorded: list[dict[str, Any]] = []
    for layers in entry.layers:
        session = Session(entry, views, layers=layers, overscan=OVERSCAN, runtime=runtime,
                          progress=progress, **options)
        for setting in recorded[-1]["curve"] if recorded else ():
            session.trials.measure(setting["parameters"])
        recorded.append({
            "layers": layers,
            **search(session, FURTHER_ROUNDS if recorded else ROUNDS, progress),
        })
    parameters = recorded[0]["presets"]["medium"]["parameters"]
    pace, _ = measured(runtime, technique, parameters)
    common = session.setting()
    del common["layers"]
    return {
        "format": "ssgi-presets 2",
        "recorded by": f"python -m ssgi_cl.bench.presets {technique}",
        **common,
        "pace": {
            "parameters": parameters,
            **{name: _rounded(value) for name, value in asdict(pace).items()},
        },
        "layers": recorded,
    }


def search(
    session: Session, rounds: Mapping[str, int], progress: Report | None = None
) -> dict[str, Any]:
    """Return the curve of a session, and the presets on it.

    Each search begins with all that is known, so that what one found serves the others too.

    Args:
        session: of one number of layers.
        rounds: of the search for each budget, in this order; see `Session.explore`.
        progress: called with what is under way.

    Raises:
        TuneError: nothing keeps a budget.
    """
    usual = session.trials.confirm(session.trials.measure({}))
    budgets = {name: _rounded(share * usual.ms) for name, share in BUDGETS.items()}
    for name, number in rounds.items():
        if progress is not None:
            progress(f"preset {name}", 0.0)
        session.explore(Bound(budgets[name], None), rounds=number)
    curve = session.front(SPACING)
    # The curve is thinned out: what the search begins with may be better than what it has of that
    # time, which is the defaults', however unsteady the machine is.
    start = session.trials.measure(session.usual)
    choice = [*curve, replace(start, ms=usual.ms)]
    choice = front([replace(trial, ms=_rounded(trial.ms)) for trial in choice])
    presets = {}
    best: Trial | None = None
    for name, budget in budgets.items():
        bound = Bound(budget, None)
        kept = [trial for trial in choice if bound.kept_by(trial)]
        if not kept:
            raise TuneError(bound.unreachable(curve, "error"))
        best = _blurred_no_wider(session, kept[-1], best)
        presets[name] = {**_written(session, best), "budget_ms": budget}
    return {
        "default": {"ms": _rounded(usual.ms), "error": _rounded(usual.error)},
        "presets": presets,
        "curve": [_written(session, trial) for trial in curve],
    }


def _blurred_no_wider(session: Session, trial: Trial, cheaper: Trial | None) -> Trial:
    """Return a dearer preset's trial, with a cheaper one's blur if that is narrower.

    More samples need less blur. Where the errors of two widths hardly differ on what is tuned on
    (`presets.AS_GOOD`), the wider one errs more on other scenes, where edges are thin.
    """
    if cheaper is None or "blur_radius" not in trial.parameters:
        return trial
    before, step = (
        RESOLUTIONS[each.parameters.get("resolution", "full")] for each in (cheaper, trial)
    )
    pixels = before * cheaper.parameters["blur_radius"]
    if step * trial.parameters["blur_radius"] <= pixels:
        return trial
    narrower = {**trial.parameters, "blur_radius": max(pixels // step, 1)}
    found = session.trials.confirm(session.trials.measure(narrower))
    if error_of(found) > presets.AS_GOOD * error_of(trial):
        return trial
    return replace(found, ms=min(found.ms, trial.ms))  # it takes no longer, however unsteady


def _written(session: Session, trial: Trial) -> dict[str, Any]:
    """Return parameters, time and errors of a trial as `presets.Setting` has them."""
    return {
        "parameters": {key: _rounded(value) for key, value in trial.parameters.items()},
        "ms": _rounded(trial.ms),
        "error": _rounded(trial.error),
        "error_cut": _rounded(session.error_cut(trial.parameters)),
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
    table = Table("layers", "preset", "ms", result["metric"], "parameters",
                  title=result["device"])
    for entry in result["layers"]:
        usual, layers = entry["default"], str(entry["layers"])
        table.add_row(layers, "(default)", f"{usual['ms']:.2f}", f"{usual['error']:.4f}", "")
        for name, preset in entry["presets"].items():
            table.add_row(
                layers, name, f"{preset['ms']:.2f}", f"{preset['error']:.4f}",
                ", ".join(f"{key} {value}" for key, value in preset["parameters"].items()),
            )
    Console().print(table)


if __name__ == "__main__":
    main()
