"""Choice of presets: steps of rising time and falling errors, on made-up times and errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.bench import presets as module
from ssgi_cl.bench.experiments.defaults import scan, settings
from ssgi_cl.bench.presets import (
    GAIN,
    SLOWER,
    Step,
    better_than,
    candidates,
    errors_anew,
    ladder,
    named,
    record_presets,
    without_noise,
)
from ssgi_cl.bench.scene_sets import SETS, SceneSets
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets import NAMES
from ssgi_cl.techniques.presets.speed_model import SpeedModel
from ssgi_cl.tuning import trials as bench_trials
from ssgi_cl.tuning.outcome import TuneError
from ssgi_cl.tuning.trials import geometric_mean

from .documents import boxes


def step(name: str, ms: float, tuning: float, validation: float, resolution: str = "full") -> Step:
    return Step({"name": name, "resolution": resolution}, ms, tuning, validation)


def names(steps: Sequence[Step]) -> list[str]:
    return [made.parameters["name"] for made in steps]


USUAL = step("usual", 10.0, 0.10, 0.12)


@pytest.mark.parametrize(
    ("steps", "kept"),
    [
        (  # a step must improve on both sets
            [step("good", 20.0, 0.09, 0.11), step("overfits", 25.0, 0.08, 0.115), step("better", 30.0, 0.085, 0.10),
             step("better only in validation", 40.0, 0.086, 0.09)],
            ["usual", "good", "better"],
        ),
        (  # and neither be as fast nor hardly better
            [step("as fast", 10.0 * SLOWER - 0.1, 0.05, 0.05), step("as good", 20.0, 0.1 * GAIN + 1e-6, 0.05),
             step("good", 21.0, 0.1 * GAIN - 1e-6, 0.12 * GAIN - 1e-6)],
            ["usual", "good"],
        ),
        (  # pictures get no coarser with time
            [step("half", 30.0, 0.05, 0.05, resolution="half"), step("full", 40.0, 0.06, 0.06)],
            ["usual", "full"],
        ),
    ],
)  # fmt: skip
def test_the_ladder_from_the_usual_on(steps: list[Step], kept: list[str]) -> None:
    assert names(ladder(steps, USUAL)) == kept


def test_the_usual_is_on_the_ladder_whatever_is_faster_and_better() -> None:
    steps = [
        step("fast", 2.0, 0.2, 0.2), step("dominates", 5.0, 0.05, 0.05),
        step("half", 6.0, 0.15, 0.15), step("better in one", 7.0, 0.09, 0.14), USUAL,
    ]  # fmt: skip
    assert names(ladder(steps, USUAL)) == ["fast", "half", "usual"]
    assert names(better_than(steps, USUAL)) == ["dominates"]


def test_presets_are_the_slowest_steps_within_their_times() -> None:
    chain = [
        step("a", 2.0, 0.3, 0.3), step("b", 7.0, 0.2, 0.2), step("c", 9.0, 0.15, 0.15), USUAL,
        step("d", 15.0, 0.09, 0.09), step("e", 25.0, 0.08, 0.08), step("f", 50.0, 0.07, 0.07),
        step("g", 200.0, 0.06, 0.06),
    ]  # fmt: skip
    found = named(chain, USUAL)
    assert tuple(found) == NAMES
    assert names(list(found.values())) == ["b", "usual", "e", "f"]
    # Where none is within its time, the fastest is taken; "high" leaves one for "ultra".
    few = [chain[2], USUAL, chain[6], chain[7]]
    assert names(list(named(few, USUAL).values())) == ["c", "usual", "f", "g"]


@pytest.mark.parametrize(
    "steps",
    [
        [USUAL],
        [step("fast", 1.0, 0.2, 0.2), USUAL, step("slow", 30.0, 0.01, 0.01)],
        [USUAL, step("x", 20, 0.01, 0.01), step("y", 40, 0.001, 0.001)],
    ],
)
def test_a_ladder_without_a_step_for_each_preset_is_refused(steps: list[Step]) -> None:
    with pytest.raises(TuneError, match="are faster than the defaults and"):
        named(steps, USUAL)


def test_more_samples_are_never_faster() -> None:
    def sampled(slices: int, ms: float, resolution: str = "full") -> Step:
        return Step({"slices": slices, "resolution": resolution}, ms, 0.1, 0.1)

    steps = [sampled(3, 4.0), sampled(2, 5.0), sampled(1, 2.0), sampled(4, 1.0, "half")]
    assert [made.ms for made in without_noise(steps)] == [5.0, 5.0, 2.0, 1.0]


def test_candidates_are_all_combinations_and_hold_the_defaults() -> None:
    for entry in TECHNIQUES.values():
        made = list(candidates(entry))
        assert {name: getattr(entry.params(), name) for name in entry.tunable} in made
        for values in made:
            entry.params(**values)


# ---- with scenes


@pytest.fixture
def sets(runtime: Runtime, monkeypatch: pytest.MonkeyPatch, own_store: Path) -> SceneSets:
    pytest.importorskip("embreex")
    # What is asserted here of times is made up.
    monkeypatch.setattr(bench_trials, "REFERENCE_RUNS", 2)
    chosen = {name: [boxes(f"{name} {i}", 0.3 + 0.3 * i) for i in range(2)] for name in SETS}
    return SceneSets(runtime, chosen=chosen, size=(24, 32), rays=64)


def test_errors_are_means_over_a_set(sets: SceneSets) -> None:
    trials = sets.trials(TECHNIQUES["ssao"], 1)
    errors = sets.errors(trials, {"samples": 4}, "reporting")
    assert list(errors) == ["reporting 0", "reporting 1"]
    (row,) = scan("ssao", [{"samples": 4}], sets, 1)
    assert row["reporting"] == pytest.approx(geometric_mean(list(errors.values())))
    assert geometric_mean([0.01, 0.04]) == pytest.approx(0.02)


@pytest.fixture
def _no_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of nothing that is run."""
    for name, value in (("prepare", None), ("error", 0.125), ("errors", [0.25, 0.5])):
        monkeypatch.setattr(bench_trials.Trials, name, lambda self, *_, value=value: value)


@pytest.mark.usefixtures("_no_trials")
def test_record_holds_a_ladder_for_each_number_of_layers(sets: SceneSets, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = replace(TECHNIQUES["ssao"], layers=(1, 2))
    monkeypatch.setitem(TECHNIQUES, "ssao", entry)
    monkeypatch.setattr(module, "measured", lambda *arguments: (SpeedModel(0.0123456, 7.0), True))
    usual = entry.params().samples

    def made_up(trials: Any, values: Mapping[str, Any]) -> Step:
        """Time by samples; error too, less at full resolution."""
        half = values["resolution"] == "half"
        error = 1.0 / values["samples"] + (0.3 if half else 0.0)
        ms = 0.1 * values["samples"] * (0.25 if half else 1.0)
        return Step(values, ms, error, 1.1 * error)

    monkeypatch.setattr(module, "_step", made_up)
    monkeypatch.setattr(module, "_timed_again", lambda trials, known: known)
    document = record_presets("ssao", sets)
    assert document["format"] == "ssgi-presets 3"
    assert {name: len(scenes) for name, scenes in document["scenes"].items()} == dict.fromkeys(SETS, 2)
    assert [recorded["layers"] for recorded in document["layers"]] == [1, 2]
    for recorded in document["layers"]:
        presets = recorded["presets"]
        assert tuple(presets) == NAMES
        assert presets["medium"]["parameters"] == recorded["default"]["parameters"]
        assert presets["medium"]["parameters"]["samples"] == usual
        for of in ("error", "validation"):
            values = [preset[of] for preset in presets.values()]
            assert all(a > b for a, b in pairwise(values)), of
        times = [preset["ms"] for preset in presets.values()]
        assert times == sorted(times)
        assert presets["high"]["by_scene"] == {"reporting 0": 0.25, "reporting 1": 0.5}
        assert (presets["high"]["reporting"], presets["high"]["error_cut"]) == (0.3536, 0.125)
        assert presets["low"]["parameters"] in [point["parameters"] for point in recorded["curve"]]
    assert document["pace"]["call_ms"] == 0.01235
    # Errors are found anew, .125 on any scene; choice and times stay.
    again = errors_anew(document, sets)
    for recorded, known in zip(again["layers"], document["layers"], strict=True):
        for name, preset in recorded["presets"].items():
            before = known["presets"][name]
            assert (preset["ms"], preset["parameters"]) == (before["ms"], before["parameters"])
            assert (preset["error"], preset["validation"]) == (0.125, 0.125)
        assert [point["ms"] for point in recorded["curve"]] == [point["ms"] for point in known["curve"]]
    assert {**again, "layers": None} == {**document, "layers": None}


@pytest.mark.usefixtures("_no_trials")
def test_defaults_that_are_no_candidate_are_refused(sets: SceneSets, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = TECHNIQUES["ssao"]
    monkeypatch.setitem(TECHNIQUES, "ssao", replace(entry, tunable={**entry.tunable, "samples": [5]}))
    with pytest.raises(ValueError, match=r"the defaults .*'samples': .* are none of the candid"):
        record_presets("ssao", sets)


# ---- what the scan of defaults takes


def test_scanned_settings_are_the_defaults_then_one_constant_at_a_time() -> None:
    given = ["taps=4,9", "thickness=0.1", "end=layer"]
    assert settings(given, grid=False) == [
        {}, {"taps": 4}, {"taps": 9}, {"thickness": 0.1}, {"end": "layer"},
    ]  # fmt: skip
    assert settings(given[:2], grid=True) == [
        {}, {"taps": 4, "thickness": 0.1}, {"taps": 9, "thickness": 0.1},
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["taps", "=3", "taps="])
def test_scanned_setting_of_another_form_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=rf"'{text}': expected NAME=VALUE,VALUE"):
        settings([text], grid=False)
