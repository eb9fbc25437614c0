"""Record the presets of a technique: `python -m ssgi_cl.bench.presets --help`.

Presets are steps of a ladder that the defaults stand on: each step takes longer and errs less than
the one before, on the scenes for tuning and on those for validation. The error on the tuning scenes
chooses, that on the validation scenes may only refuse, and the scenes that errors are reported on
have no say: what is recorded of them shows whether the choice holds there.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from ssgi_cl.core.atomic import replacement
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets.speed_model import measured
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.tuning.context import Progress as Report
from ssgi_cl.tuning.outcome import TuneError
from ssgi_cl.tuning.trials import Trial, Trials, geometric_mean
from ssgi_cl.tuning.tunables import described, entry_of
from ssgi_cl.version import __version__

from .options import device_option, meshes_option, progress_bar
from .scene_sets import OVERSCAN, SETS, SceneSets

WITHIN = {"low": 0.75, "medium": 1.0, "high": 2.6, "ultra": 8.0}
"""Time of each preset over that of the defaults, at most; "medium" is the defaults."""

GAIN = 0.998
"""Error of a step over that of the step before, at most, on each set that has a say."""

SLOWER = 1.05
"""Time of a step over that of the step before, at least."""

_SAMPLES = ("samples", "slices", "taps")
"""Parameters that only add work."""


@dataclass(frozen=True)
class Step:
    """A setting with its time and its errors.

    Attributes:
        parameters: those of the technique's `tunable`.
        ms: device time of a picture, mean over the tuning views, milliseconds.
        tuning, validation: geometric mean of the RMSE over the views of each set.
    """

    parameters: Mapping[str, Any]
    ms: float
    tuning: float
    validation: float

    def improves(self, other: Step) -> bool:
        """Return whether this errs less than `other` by `GAIN`, on both sets."""
        return self.tuning <= GAIN * other.tuning and self.validation <= GAIN * other.validation


def candidates(entry: Technique) -> Iterator[dict[str, Any]]:
    """Yield all combinations of the values in the entry's `tunable`."""
    for values in itertools.product(*entry.tunable.values()):
        yield dict(zip(entry.tunable, values, strict=True))


@dataclass(frozen=True)
class Chosen:
    """Steps that a record has for one number of layers.

    Attributes:
        default: that of the defaults.
        presets: those with names.
        curve: the ladder.
        better_than_default: those that are faster and err less than `default`.
    """

    default: Step
    presets: Mapping[str, Step]
    curve: Sequence[Step]
    better_than_default: Sequence[Step]

    @classmethod
    def of(cls, recorded: Mapping[str, Any], step: Callable[[Mapping[str, Any]], Step]) -> Chosen:
        """Return what `_written` returned, of which `step` makes steps."""
        return cls(
            step(recorded["default"]),
            {name: step(known) for name, known in recorded["presets"].items()},
            *([step(known) for known in recorded[key]] for key in ("curve", "better_than_default")),
        )


def ladder(steps: Sequence[Step], usual: Step) -> list[Step]:
    """Return steps of rising time and falling errors on both sets, `usual` among them.

    Faster steps that err less than `usual` on either set are left out, as `usual` would not
    improve on them; slower ones that are coarser too.
    """
    faster = [step for step in steps if SLOWER * step.ms <= usual.ms and usual.improves(step)]
    improving = [step for step in steps if step.improves(usual) and _every(step) <= _every(usual)]
    slower = [step for step in improving if step.ms >= SLOWER * usual.ms]
    result: list[Step] = []
    for group in (faster, [usual], slower):
        for step in sorted(group, key=lambda step: (step.ms, step.tuning)):
            before = result[-1] if result else None
            if before is None or step is usual or (step.ms >= SLOWER * before.ms and step.improves(before)):
                result.append(step)
    return result


def better_than(steps: Sequence[Step], usual: Step) -> list[Step]:
    """Return what is faster and errs less than `usual` on both sets: what should be the defaults."""
    return [step for step in steps if SLOWER * step.ms <= usual.ms and step.improves(usual)]


def without_noise(steps: Sequence[Step]) -> list[Step]:
    """Return steps of which none is faster than one with less samples that is equal otherwise.

    Where it was measured to be, the machine was busy: it gets the time of the one with less.
    """

    def less(one: Step, other: Step) -> bool:
        keys = [key for key in other.parameters if one.parameters[key] != other.parameters[key]]
        return all(key in _SAMPLES and one.parameters[key] < other.parameters[key] for key in keys)

    return [replace(step, ms=max(other.ms for other in steps if less(other, step))) for step in steps]


def named(steps: Sequence[Step], usual: Step) -> dict[str, Step]:
    """Return the preset of each name: of a `ladder`, the slowest step within its share of time.

    Raises:
        TuneError: the ladder has no step that is faster than `usual`, or fewer than two slower.
    """
    place = steps.index(usual)
    slower = list(steps[place + 1 :])
    if place < 1 or len(slower) < 2:
        raise TuneError(
            f"{place} steps are faster than the defaults and {len(slower)} slower: expected at "
            "least 1 and 2 among the candidates"
        )

    def within(name: str, part: Sequence[Step]) -> Step:
        fast = [step for step in part if step.ms <= WITHIN[name] * usual.ms]
        return fast[-1] if fast else part[0]

    low, high = within("low", steps[:place]), within("high", slower[:-1])
    ultra = within("ultra", slower[slower.index(high) + 1 :])
    return dict(zip(presets.NAMES, (low, usual, high, ultra), strict=True))


def record_presets(technique: str, sets: SceneSets, *, progress: Report | None = None) -> dict[str, Any]:
    """Choose a technique's presets for each of its numbers of layers; return the document.

    Args:
        technique: key in `TECHNIQUES`.
        sets: the scenes.
        progress: called with what is under way and the share of it that is done.

    Raises:
        ValueError, TuneError: the technique is unknown, or the candidates make no ladder.
    """
    entry = entry_of(technique)
    recorded = [_recorded(entry, sets, layers, progress) for layers in entry.layers]
    medium = recorded[0]["presets"]["medium"]["parameters"]
    speed, _ = measured(sets.runtime, entry.technique, medium)
    return {
        "format": "ssgi-presets 3",
        "recorded by": f"python -m ssgi_cl.bench.presets {technique}",
        "technique": technique,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "version": __version__,
        "device": sets.runtime.info.label,
        "variant": str(sets.runtime.variant),
        "size": list(sets.size),
        "overscan": OVERSCAN,
        "metric": "rmse",
        "truth": {"rays": sets.truth.rays, "attenuation": sets.truth.attenuation, "weighting": "cosine"},
        "scenes": {name: described(sets.views[name]) for name in SETS},
        "pace": {"parameters": medium, **{key: _rounded(value) for key, value in asdict(speed).items()}},
        "layers": recorded,
    }


def _recorded(entry: Technique, sets: SceneSets, layers: int, progress: Report | None) -> dict[str, Any]:
    """Return the presets and the ladder for one number of layers."""
    trials = sets.trials(entry, layers)
    every = list(candidates(entry))
    usual_values = {name: getattr(entry.params(), name) for name in entry.tunable}
    if usual_values not in every:
        raise ValueError(f"the defaults {usual_values} are none of the candidates in `tunable`")
    steps = []
    for number, values in enumerate(every):
        if progress is not None:
            progress(f"{layers} layers: settings", number / len(every))
        steps.append(_step(trials, values))
    # Rough times could keep a step off the ladder: all are timed again.
    for number, step in enumerate(steps):
        if progress is not None:
            progress(f"{layers} layers: times", number / len(steps))
        steps[number] = _timed_again(trials, step)
    steps = without_noise(steps)
    usual = steps[every.index(usual_values)]
    chain = ladder(steps, usual)
    return _written(sets, entry, layers, Chosen(usual, named(chain, usual), chain, better_than(steps, usual)))


def _written(sets: SceneSets, entry: Technique, layers: int, chosen: Chosen) -> dict[str, Any]:
    """Return what is recorded of the steps for one number of layers."""
    trials = sets.trials(entry, layers)
    whole = sets.trials(entry, layers, 0.0)["tuning"]

    def written(step: Step) -> dict[str, Any]:
        return {
            "parameters": dict(step.parameters),
            "ms": _rounded(step.ms),
            "error": _rounded(step.tuning),
            "error_cut": _rounded(whole.error(step.parameters)),
            "validation": _rounded(step.validation),
            "reporting": _rounded(geometric_mean(trials["reporting"].errors(step.parameters))),
        }

    def by_scene(step: Step) -> dict[str, float]:
        errors = sets.errors(trials, step.parameters, "reporting")
        return {name: _rounded(error) for name, error in errors.items()}

    return {
        "layers": layers,
        "default": written(chosen.default),
        "presets": {name: {**written(step), "by_scene": by_scene(step)} for name, step in chosen.presets.items()},
        "curve": [written(step) for step in chosen.curve],
        "better_than_default": [written(step) for step in chosen.better_than_default],
    }


def errors_anew(document: Mapping[str, Any], sets: SceneSets) -> dict[str, Any]:
    """Return a record with the errors of its settings found anew, and choice and times as they are.

    Args:
        document: what `record_presets` returned.
        sets: the scenes.
    """
    entry = entry_of(document["technique"])

    def anew(recorded: Mapping[str, Any]) -> dict[str, Any]:
        trials = sets.trials(entry, recorded["layers"])

        def step(known: Mapping[str, Any]) -> Step:
            values = known["parameters"]
            return Step(values, known["ms"], trials["tuning"].error(values), trials["validation"].error(values))

        return _written(sets, entry, recorded["layers"], Chosen.of(recorded, step))

    layers = [anew(recorded) for recorded in document["layers"]]
    return {**document, "scenes": {name: described(sets.views[name]) for name in SETS}, "layers": layers}


def _step(trials: Mapping[str, Trials], values: Mapping[str, Any]) -> Step:
    trial = trials["tuning"].measure(values)
    assert trial.error is not None  # noqa: S101  no limit was given
    return Step(values, trial.ms, trial.error, trials["validation"].error(values))


def _timed_again(trials: Mapping[str, Trials], step: Step) -> Step:
    careful = trials["tuning"].confirm(Trial(step.parameters, step.ms, step.tuning))
    return replace(step, ms=careful.ms)


def _every(step: Step) -> int:
    """Return every how many pixels a step computes."""
    return RESOLUTIONS[step.parameters.get("resolution", "full")]


def _rounded(value: Any) -> Any:
    """Return a number to 4 digits: no more than that can be told apart."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


def written_as(value: Any, indent: str = "") -> str:
    """Return a document as JSON in which each setting, scene or view is one line.

    An object or list is broken into lines only if it does not fit in one or holds settings.
    """
    line = json.dumps(value)
    is_one = isinstance(value, dict) and not value.keys().isdisjoint(("parameters", "digest"))
    if not isinstance(value, (dict, list)) or len(line) <= 100 or is_one:
        return line
    inner = indent + " "
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {written_as(item, inner)}" for key, item in value.items()]
        return "{\n" + ",\n".join(parts) + f"\n{indent}}}"
    return "[\n" + ",\n".join(inner + written_as(item, inner) for item in value) + f"\n{indent}]"


@click.command()
@click.argument("technique", type=click.Choice(sorted(TECHNIQUES)))
@device_option
@meshes_option
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The JSON file; by default the one that the library reads.",
)
@click.option("--keep-times", is_flag=True, help="Find the errors of the recorded settings anew, and nothing else.")
def main(technique: str, device: str | None, meshes: Path | None, output: Path | None, *, keep_times: bool) -> None:
    """Record the presets of TECHNIQUE: tuned on generated scenes, validated with others.

    Takes some minutes. Nothing else should keep the machine busy meanwhile.
    """
    with progress_bar() as report:
        sets = SceneSets(Runtime.open(device), meshes=meshes, progress=report)
        if keep_times:
            result = errors_anew(presets.record(technique), sets)
        else:
            result = record_presets(technique, sets, progress=report)
    path = output or Path(presets.__file__).parent / f"{technique}.json"
    with replacement(path) as file:
        file.write_text(written_as(result) + "\n", encoding="utf-8")
    table = Table("layers", "preset", "ms", *SETS, "parameters", title=result["device"])
    for entry in result["layers"]:
        rows = {
            **entry["presets"],
            **{f"better than the defaults {number}": step for number, step in enumerate(entry["better_than_default"])},
        }
        for name, step in rows.items():
            table.add_row(
                str(entry["layers"]),
                name,
                f"{step['ms']:.2f}",
                f"{step['error']:.4f}",
                f"{step['validation']:.4f}",
                f"{step['reporting']:.4f}",
                ", ".join(f"{key} {value}" for key, value in step["parameters"].items()),
            )
    Console().print(table)


if __name__ == "__main__":
    main()
