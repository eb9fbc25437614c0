"""Tuning: bounds, records and bad input on a technique whose time and error are formulas, and SSAO
on a small scene."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import REPORTED, TUNED_ON, VALIDATED_ON, BuiltinScene, cornell_box, make_scene
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.tuning import tune as module
from ssgi_cl.tuning.outcome import TuneError, Tuning
from ssgi_cl.tuning.trials import Trial
from ssgi_cl.tuning.tunables import axis_of, views_of
from ssgi_cl.tuning.tune import Session

from .documents import boxes

Tuned = Callable[..., Tuning]

USUAL = {"samples": 16, "bias": 0.02, "resolution": "full"}
VARIED = {"samples": [4, 8, 16, 32, 64], "bias": (0.0, 0.1), "resolution": ["full", "half"]}


def time_of(parameters: Mapping[str, Any]) -> float:
    """0.1 ms a sample, at half resolution a quarter of that."""
    return 0.1 * parameters["samples"] * (0.25 if parameters["resolution"] == "half" else 1.0)


def error_of(parameters: Mapping[str, Any]) -> float:
    """Less with samples, least at bias 0.03, worse at half resolution."""
    worse = 0.15 if parameters["resolution"] == "half" else 0.0
    return worse + 1.0 / parameters["samples"] + 10.0 * (parameters["bias"] - 0.03) ** 2


class Formulas:
    """Stands in for `Trials`: what it measures is given by the formulas above."""

    def __init__(self, entry: Any, contexts: Any, fixed: Any, metric: str, layers: int, overscan: float) -> None:
        self.layers = layers
        self.entry = entry
        self.kept: dict[Any, Trial] = {}
        self.errors = 0

    def prepare(self) -> None:
        pass

    @property
    def tried(self) -> list[Trial]:
        return list(self.kept.values())

    def measure(self, parameters: Mapping[str, Any], limit_ms: float = math.inf) -> Trial:
        key = tuple(sorted(parameters.items()))
        kept = self.kept.get(key)
        if kept is None or (kept.error is None and kept.ms <= limit_ms):
            ms = time_of({**USUAL, **parameters}) * self.layers
            self.errors += ms <= limit_ms
            self.kept[key] = Trial(dict(parameters), ms, self.error(parameters) if ms <= limit_ms else None)
        return self.kept[key]

    def error(self, parameters: Mapping[str, Any], gbuffers: Any = None) -> float:
        return error_of({**USUAL, **parameters}) * (1.0 if gbuffers is None else 1.1)

    def confirm(self, trial: Trial) -> Trial:
        return Trial(trial.parameters, trial.ms, trial.error)


def little_scene() -> BuiltinScene:
    """Boxes on a floor, two views."""
    view = boxes("little", 0.8, (0.7, 0.2, 0.4), (-0.5, 0.9, 0.3))
    return replace(view, lights=(Environment(1.0),), more_views=(((-1.8, 1.0, 1.6), (0.0, 0.2, 0.0)),))


@pytest.fixture
def tuned(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> Tuned:
    """Tunes SSAO, by the formulas."""
    monkeypatch.setattr(module, "Trials", Formulas)
    usual = {"parameters": VARIED, "scenes": [little_scene()], "runtime": runtime}
    return lambda **options: gi.tune("ssao", **{**usual, **options})


def test_budget_gives_the_least_error_within_the_time(tuned: Tuned) -> None:
    tuning = tuned(budget_ms=1.7)
    # 16 samples take 1.6 ms; 64 at half resolution do as well, but are 0.15 worse.
    assert tuning.parameters["samples"] == 16
    assert tuning.parameters["resolution"] == "full"
    # The last steps along an axis are a 64th of its range.
    assert tuning.parameters["bias"] == pytest.approx(0.03, abs=0.1 / 64)
    assert tuning.ms == pytest.approx(1.6)
    assert tuning.error == pytest.approx(1 / 16, abs=1e-4)
    assert isinstance(tuning.best, SsaoParams)
    assert tuning.best.samples == 16
    # The error of what is far too slow is not computed.
    slow = [trial for trial in tuning.tried if trial.ms > 1.7 * module.SLACK]
    assert len(slow) > 5
    assert all(trial.error is None for trial in slow)


def test_without_cast_rays_it_fails_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("something was done first")

    monkeypatch.setitem(sys.modules, "embreex", None)
    monkeypatch.setattr(module, "Session", work)
    monkeypatch.setattr(module, "views_of", work)
    with pytest.raises(gi.MissingExtraError, match=r"ssgi-cl\[truth\]"):
        gi.tune("ssao", budget_ms=1.0)


def test_error_bound_gives_the_least_time_within_the_error(tuned: Tuned) -> None:
    tuning = tuned(max_error=0.04)
    # 32 samples have 1/32 where the bias is nearly right; 16 are at best 1/16.
    assert tuning.parameters["samples"] == 32
    assert tuning.ms == pytest.approx(3.2)
    assert tuning.error <= 0.04
    # The result is never worse than the defaults that keep the bound.
    tuning = tuned(budget_ms=time_of(USUAL), rounds=1)
    assert tuning.error <= error_of(USUAL)
    assert USUAL in [trial.parameters for trial in tuning.tried]


def test_front_holds_what_no_other_beats_in_time_and_error(tuned: Tuned) -> None:
    tuning = tuned(budget_ms=10.0)
    front = tuning.front()
    assert len(front) >= 4
    assert [trial.ms for trial in front] == sorted(trial.ms for trial in front)
    for point in front:
        assert point.error is not None
        assert not any(
            other.error is not None and other.ms <= point.ms and other.error < point.error for other in tuning.tried
        )
    # The best within a budget lies on it.
    assert tuning.parameters in [trial.parameters for trial in front]


def test_budget_that_nothing_keeps_is_an_error_that_says_what_was_reached(tuned: Tuned) -> None:
    with pytest.raises(TuneError, match=r"budget_ms is 0.05: .*, samples=4, .*resolution='half'.*, takes 0.1 ms"):
        tuned(budget_ms=0.05)
    with pytest.raises(TuneError, match=r"max_error is 0.001: .* has rmse 0.0156"):
        tuned(max_error=0.001)
    assert issubclass(TuneError, ValueError)


def test_best_that_fails_when_timed_again_gives_way_to_the_next(tuned: Tuned, monkeypatch: pytest.MonkeyPatch) -> None:
    def confirm(self: Formulas, trial: Trial) -> Trial:
        late = trial.parameters["samples"] == 16
        return Trial(trial.parameters, trial.ms * (1.2 if late else 1.0), trial.error)

    monkeypatch.setattr(Formulas, "confirm", confirm)
    assert tuned(budget_ms=1.7).parameters["samples"] == 8


def test_parameters_that_rule_each_other_out_are_skipped(tuned: Tuned) -> None:
    def full_below_none(trial: Trial) -> bool:
        return bool(trial.parameters["ramp_start"] < trial.parameters["ramp_end"])

    varied = {"ramp_start": (0.0, 4.0), "ramp_end": (0.5, 4.5), **VARIED}
    tuning = tuned(budget_ms=5.0, parameters=varied)
    assert len(tuning.tried) > 20
    assert all(full_below_none(trial) for trial in tuning.tried)


def test_same_arguments_give_the_same_tuning_with_progress_that_grows(tuned: Tuned) -> None:
    shares: list[float] = []
    first, second = tuned(budget_ms=2.0), tuned(budget_ms=2.0, progress=lambda text, share: shares.append(share))
    assert first.tried == second.tried
    assert first.best == second.best
    assert tuned(budget_ms=2.0, seed=7).tried != first.tried
    assert shares == sorted(shares)
    assert 0.5 < shares[-1] <= 1.0


def test_saved_tuning_tells_all_it_depends_on(runtime: Runtime, tuned: Tuned, tmp_path: Path) -> None:
    tuning = tuned(budget_ms=2.0)
    tuning.save(tmp_path / "tuning.json")
    document = json.loads((tmp_path / "tuning.json").read_text())
    assert document["format"] == "ssgi-tuning 1"
    assert document["parameters"] == dict(tuning.parameters)
    assert len(document["tried"]) == len(tuning.tried)
    (scene,) = document["scenes"]
    assert scene["name"] == "little"
    assert scene["radius"] == 0.4
    assert [view["eye"] for view in scene["views"]] == [[1.6, 1.4, 2.2], [-1.8, 1.0, 1.6]]
    assert len(scene["digest"]) == 32
    assert document["size"] == [300, 400]
    assert document["device"] == runtime.info.label
    assert document["variant"] == str(runtime.variant)
    assert document["truth"]["rays"] >= 256
    assert document["version"] == gi.__version__
    with pytest.raises(OSError, match="cannot write the file"):
        tuning.save(tmp_path / "no" / "tuning.json")
    assert [path.name for path in tmp_path.iterdir()] == ["tuning.json"]


@pytest.mark.slow
@pytest.mark.usefixtures("own_store")
def test_ssao_on_a_small_scene_is_tuned_to_less_error_than_its_worst(runtime: Runtime) -> None:
    pytest.importorskip("embreex")
    tuning = gi.tune(
        "ssao",
        budget_ms=1e3,
        parameters={"samples": [4, 8], "contrast": [0.1, 1.0, 2.5]},
        scenes=[little_scene()],
        size=(30, 40),
        runtime=runtime,
    )
    assert len(tuning.tried) == 6
    errors = [trial.error for trial in tuning.tried]
    assert all(error is not None and 0.0 < error < 1.0 for error in errors)
    assert all(trial.ms > 0.0 for trial in tuning.tried)
    # Measured: from 0.086 at the best to 0.14 where nearly all contrast is lost.
    assert tuning.error == min(errors)
    assert tuning.error < 0.8 * max(errors)
    assert isinstance(tuning.best, SsaoParams)
    assert tuning.best.contrast == tuning.parameters["contrast"]


@pytest.mark.usefixtures("own_store")
def test_error_is_the_geometric_mean_over_the_views_with_layers_and_overscan(runtime: Runtime) -> None:
    pytest.importorskip("embreex")
    scene = little_scene()
    session = Session(TECHNIQUES["ssao"], scene.views(), size=(30, 40), layers=2, overscan=0.2, runtime=runtime)
    errors = []
    for view, found in zip(scene.views(), session.trials.images({"samples": 4}), strict=True):
        camera = view.camera(40, 30)
        gbuffer = gi.rasterize.gbuffer(scene.scene, camera, layers=2, overscan=0.2, runtime=runtime)
        image = gi.ssao(gbuffer, 0.4, 4, runtime=runtime)
        # Normals went to the host and back, which may turn a sample or two of 1200 pixels round.
        assert np.mean(found != image) < 0.01
        base = gi.rasterize.gbuffer(scene.scene, camera, runtime=runtime)
        truth = gi.truth.ambient_occlusion(scene.scene, camera, 0.4, 512, gbuffer=base).mean
        errors.append(gi.metrics.rmse(image, truth, np.isfinite(base.depth)))
    assert session.trials.measure({"samples": 4}).error == pytest.approx(math.exp(np.mean(np.log(errors))), rel=2e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("own_store")
def test_radius_is_the_views_unless_it_is_fixed(runtime: Runtime) -> None:
    pytest.importorskip("embreex")
    scene = [little_scene()]
    entry = TECHNIQUES["ssao"]
    own = Session(entry, scene, size=(30, 40), runtime=runtime).trials.error({})
    same = Session(entry, scene, size=(30, 40), fixed={"radius": 0.4}, runtime=runtime)
    other = Session(entry, scene, size=(30, 40), fixed={"radius": 0.1}, runtime=runtime)
    assert same.trials.error({}) == own
    assert other.trials.error({}) != own


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"budget_ms is None and max_error is None: expected exactly one"),
        ({"budget_ms": 1.0, "max_error": 0.1}, r"expected exactly one"),
        ({"budget_ms": 0.0}, r"budget_ms is 0.0: expected .*> 0"),
        ({"max_error": math.nan}, r"max_error is nan"),
        ({"budget_ms": 1.0, "rounds": 0}, r"rounds is 0"),
        ({"budget_ms": 1.0, "metric": "beauty"}, r"metric is 'beauty': expected one of 'rmse'"),
        ({"budget_ms": 1.0, "scenes": ["attic"]}, r"scene is 'attic': expected one of"),
        ({"budget_ms": 1.0, "scenes": []}, r"scenes is empty"),
        ({"budget_ms": 1.0, "parameters": {}}, r"parameters is empty"),
        ({"budget_ms": 1.0, "parameters": {"sample": [1]}}, r"parameters has 'sample': .*samples"),
        ({"budget_ms": 1.0, "parameters": {"radius": (0.1, 1)}}, r"parameters has 'radius'"),
        ({"budget_ms": 1.0, "parameters": {"bias": (0.1, 0.0)}}, r"low < high"),
        ({"budget_ms": 1.0, "parameters": {"bias": (0.0, 9.0)}}, r"range within \[0, 1\]"),
        ({"budget_ms": 1.0, "parameters": {"samples": []}}, r"samples is \[\]: expected"),
        ({"budget_ms": 1.0, "fixed": {"bias": 2.0}}, r"bias is 2.0"),
        ({"budget_ms": 1.0, "fixed": {"bias": 0.1}, "parameters": {"bias": (0.0, 0.1)}},
         r"bias is in parameters and in fixed"),
        ({"budget_ms": 1.0, "size": (0, 40)}, r"size\[0\] is 0"),
        ({"budget_ms": 1.0, "parameters": {"samples": [300, 999]}}, r"samples is (300|999): .*256"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(tuned: Tuned, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tuned(**{"parameters": None, **options})


def test_unknown_technique_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ValueError, match=r"technique is 'magic': expected one of .*'ssao'"):
        gi.tune("magic", budget_ms=1.0)


@pytest.mark.parametrize(
    ("name", "why"),
    [*((name, "on which errors are reported") for name in REPORTED),
     (VALIDATED_ON[0], "which is for validation")],
)  # fmt: skip
def test_scene_that_is_not_for_tuning_is_refused(name: str, why: str) -> None:
    with pytest.raises(ValueError, match=rf"scene is '{name}', {why}: expected another"):
        gi.tune("ssao", budget_ms=1.0, scenes=[name])


def test_a_scene_itself_is_taken_whatever_its_name_but_in_a_list() -> None:
    (view,) = views_of([cornell_box()])
    assert view.name == "cornell_box"
    with pytest.raises(TypeError, match="expected a list of names or scenes"):
        views_of("workshop")


@pytest.mark.slow
def test_default_scenes_give_a_view_of_each_scene_for_tuning() -> None:
    views = views_of(None)
    assert [view.name for view in views] == list(TUNED_ON)
    assert views[1].eye == make_scene(TUNED_ON[1]).eye
    assert not any(view.more_views for view in views)


def test_axes_follow_the_declared_types() -> None:
    assert axis_of(SsaoParams, "blur_radius", (0, 6)).whole
    assert not axis_of(SsaoParams, "bias", (0, 1)).whole
    assert axis_of(SsaoParams, "samples", [64, 4, 16]).values == (4, 16, 64)
    assert axis_of(SsaoParams, "hemisphere", [True, False]).values == (True, False)
    assert axis_of(SsaoParams, "hemisphere", (True, False)).values == (True, False)


def test_what_the_entries_call_tunable_is_allowed() -> None:
    for entry in TECHNIQUES.values():
        for name, values in entry.tunable.items():
            axis = axis_of(entry.params, name, values)
            for u in (0.0, 0.5, 1.0):
                # Each value alone is in range; `ramp_end` must exceed `ramp_start`.
                rest = {"ramp_end": 1e3} if name == "ramp_start" else {"ramp_start": 0.0} if name == "ramp_end" else {}
                entry.params(**{name: axis.at(u), **rest})
