"""Presets: what is recorded, how it is chosen from, and how it reaches the caller."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, REPORTED, TUNED_ON, VALIDATED_ON
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, ssao
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets import choose as choosing
from ssgi_cl.techniques.presets import speed_model as pacing
from ssgi_cl.techniques.presets.speed_model import SpeedModel, predicted_ms
from ssgi_cl.truth.metrics import rmse
from ssgi_cl.tuning.choose import choose

SIZE = (600, 800)
RECORDED = sorted(
    path.stem
    for path in Path(presets.__file__).parent.iterdir()
    if path.suffix == ".json" and path.name != presets.FRONT
)
SLICES = ("bitmask_ao", "gtao", "hbao")
"""Techniques that scan slices."""


@pytest.fixture(params=RECORDED)
def technique(request: pytest.FixtureRequest) -> str:
    """Each technique that has presets."""
    return str(request.param)


@pytest.fixture(scope="module")
def steps() -> GBuffer:
    """A flight of steps: depth that falls by half a unit every eight columns."""
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=48, height=40)
    columns = np.arange(48) // 8
    return GBuffer(camera=camera, depth=np.tile(5.0 - 0.5 * columns, (40, 1)).astype(np.float32))


@pytest.fixture
def same_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device that takes as long with the defaults as is recorded, at the recorded size."""

    def recorded(runtime: Runtime, technique: type[OcclusionTechnique]) -> SpeedModel:
        record = presets.record(technique.name)
        call_ms, (rows, columns) = record["pace"]["call_ms"], record["size"]
        pixel_ms = (record["layers"][0]["default"]["ms"] - call_ms) / (rows * columns)
        return SpeedModel(call_ms, 1e6 * pixel_ms)

    monkeypatch.setattr(pacing, "speed_model_of", recorded)


@pytest.fixture
def layered(monkeypatch: pytest.MonkeyPatch) -> None:
    """SSAO's record as if it were of 1, 2 and 4 layers, of half the error and 1, 2 and 7 times the time."""
    whole = json.loads(json.dumps(presets.record("ssao")))
    entries = []
    for layers, times in ((1, 1.0), (2, 2.0), (4, 7.0)):
        entry = json.loads(json.dumps(whole["layers"][0]))
        entry["layers"] = layers
        points = [entry["default"], *entry["presets"].values(), *entry["curve"]]
        for point in points:
            point["ms"] *= times
            point["error"] /= layers
            point["error_cut"] /= layers
        entries.append(entry)
    monkeypatch.setattr(presets, "record", lambda technique: {**whole, "layers": entries})


# ---- what is recorded


def test_every_recorded_setting_is_a_valid_set_of_parameters(technique: str) -> None:
    entry, records = TECHNIQUES[technique], presets.record(technique)["layers"]
    assert [recorded["layers"] for recorded in records] == sorted(entry.layers)
    for recorded in records:
        assert tuple(recorded["presets"]) == presets.NAMES
        for point in [*recorded["presets"].values(), *recorded["curve"]]:
            assert set(point["parameters"]) == set(entry.tunable)
            assert "radius" not in point["parameters"]
            entry.params(**point["parameters"])


def test_each_setting_of_a_curve_is_slower_and_better_than_the_one_before(technique: str) -> None:
    for layers in TECHNIQUES[technique].layers:
        curve = presets.curve(technique, layers)
        assert len(curve) >= 4
        for a, b in pairwise(curve):
            assert a.ms < b.ms
            assert a.error > b.error
            assert a.validation > b.validation


def test_along_the_presets_time_rises_and_errors_fall_on_every_set(technique: str) -> None:
    for entry in presets.record(technique)["layers"]:
        for a, b in pairwise(entry["presets"].values()):
            assert a["ms"] < b["ms"]
            for of in ("error", "validation"):
                assert a[of] > b[of], (entry["layers"], of, a["parameters"], b["parameters"])
            # Nothing was chosen on these scenes: where the model's own error is all that is left,
            # less noise may show 1 % more of it.
            assert 1.01 * a["reporting"] > b["reporting"], (entry["layers"], b["parameters"])
        first, *_, last = entry["presets"].values()
        assert first["reporting"] > last["reporting"]


def test_presets_lie_on_the_curve_and_the_defaults_too(technique: str) -> None:
    usual = TECHNIQUES[technique].params()
    for entry in presets.record(technique)["layers"]:
        points = [point["parameters"] for point in entry["curve"]]
        for preset in entry["presets"].values():
            assert preset["parameters"] in points
        medium = entry["presets"]["medium"]["parameters"]
        assert medium == entry["default"]["parameters"]
        assert medium == {name: getattr(usual, name) for name in medium}


def test_no_candidate_is_faster_and_better_than_the_defaults(technique: str) -> None:
    for entry in presets.record(technique)["layers"]:
        assert entry["better_than_default"] == []


def test_no_preset_is_slower_and_worse_than_the_defaults_on_a_reported_scene(technique: str) -> None:
    for entry in presets.record(technique)["layers"]:
        usual = entry["presets"]["medium"]
        for name in ("high", "ultra"):
            preset = entry["presets"][name]
            errors = zip(preset["by_scene"].values(), usual["by_scene"].values(), strict=True)
            # Of a single scene, 2 %: what the model errs may show more with less noise. One layer
            # has little else: the bitmask's two slices happen to err 3.7 % less than four in the
            # Cornell box at this size (.2 % at 800 x 600).
            most = 1.04 if entry["layers"] == 1 else 1.02
            assert all(error <= most * before for error, before in errors), (
                entry["layers"],
                name,
                preset["by_scene"],
                usual["by_scene"],
            )


@pytest.mark.parametrize("technique", SLICES)
def test_settings_of_slices_differ_in_sampling_alone(technique: str) -> None:
    sampling = {"slices", "taps", "resolution", "blur_radius"}
    models = [
        {name: value for name, value in point["parameters"].items() if name not in sampling}
        for entry in presets.record(technique)["layers"]
        for point in [*entry["presets"].values(), *entry["curve"]]
    ]
    assert all(model == models[0] for model in models)


@pytest.mark.slow
@pytest.mark.parametrize("scene", REPORTED)
@pytest.mark.parametrize("technique", SLICES)
def test_dearer_presets_err_no_more_on_scenes_that_nothing_is_tuned_on(
    technique: str, scene: str, runtime: Runtime
) -> None:
    pytest.importorskip("embreex")
    from ssgi_cl.tuning.context import Context, TruthSettings

    context = Context(runtime, BUILTIN_SCENES[scene](), (300, 400), TruthSettings(rays=256))
    function, truth = TECHNIQUES[technique].function, context.occlusion().mean
    errors = [
        rmse(function(context.gbuffer, context.radius, runtime=runtime, preset=name), truth, context.seen)
        for name in (None, *presets.NAMES)
    ]
    usual, *named = errors
    # What the model errs is in all of them, and more samples may show more of it.
    assert all(b < 1.02 * a for a, b in pairwise(named)), errors
    assert named[-1] < 1.01 * usual, errors


def test_record_says_what_the_presets_were_tuned_on(technique: str) -> None:
    recorded = presets.record(technique)
    names = {of: [scene["name"] for scene in known] for of, known in recorded["scenes"].items()}
    assert names["tuning"] == list(TUNED_ON)
    assert names["validation"] == list(VALIDATED_ON)
    assert names["reporting"][: len(REPORTED)] == list(REPORTED)
    assert not set(names["reporting"]) & {*TUNED_ON, *VALIDATED_ON}
    for scene in itertools.chain(*recorded["scenes"].values()):
        assert len(scene["digest"]) == 32
        assert scene["radius"] > 0
        assert scene["views"]
    assert recorded["truth"]["rays"] >= 256
    assert recorded["overscan"] == 0.1
    for key in ("device", "variant", "date", "version", "metric", "recorded by"):
        assert recorded[key]


# ---- choosing


def test_given_parameters_win_over_the_preset_which_has_no_radius() -> None:
    assert choose("ssao", SIZE, preset="low").params.radius == SsaoParams().radius
    params = choose("ssao", SIZE, preset="high", radius=0.7, samples=9).params
    assert isinstance(params, SsaoParams)
    assert params.radius == (0.7,)
    assert params.samples == 9
    assert params.contrast == choose("ssao", SIZE, preset="high").params.contrast


def test_error_gives_the_fastest_setting_that_reaches_it() -> None:
    curve = presets.curve("ssao")
    for wanted in (curve[0].error_cut, curve[2].error_cut, 0.5 * (curve[0].error_cut + 1.0)):
        chosen = choose("ssao", SIZE, error=wanted)
        assert chosen.error <= wanted
        fast = min((point for point in curve if point.error_cut <= wanted), key=lambda p: p.ms)
        assert chosen.params == SsaoParams(**fast.parameters)


def test_overscan_lowers_the_expected_error() -> None:
    cut = choose("ssao", SIZE, preset="high")
    whole = choose("ssao", SIZE, preset="high", margin=(60, 80))
    narrow = choose("ssao", SIZE, preset="high", margin=(60, 8))
    assert whole.error < cut.error
    assert narrow.error == cut.error
    assert whole.params == cut.params


@pytest.mark.usefixtures("layered")
def test_layers_lower_the_expected_error() -> None:
    errors = [choose("ssao", SIZE, preset="high", layers=layers).error for layers in (1, 2, 3, 4)]
    # Three layers are taken for the two that are recorded.
    assert errors == pytest.approx([errors[0], errors[0] / 2, errors[0] / 2, errors[0] / 4])


@pytest.mark.usefixtures("same_speed")
def test_budget_gives_the_best_setting_within_the_time(runtime: Runtime) -> None:
    recorded = presets.record("ssao")
    size = tuple(recorded["size"])
    for point in presets.curve("ssao"):
        # 1e-6 more: a time goes through a subtraction and an addition.
        chosen = choose("ssao", size, budget_ms=point.ms * (1.0 + 1e-6), runtime=runtime)
        assert chosen.params == SsaoParams(**point.parameters)
        assert chosen.ms == pytest.approx(point.ms)
        assert chosen.error == point.error_cut


@pytest.mark.usefixtures("layered", "same_speed")
def test_layers_between_and_beyond_the_recorded_ones_take_their_time(runtime: Runtime) -> None:
    size = tuple(presets.record("ssao")["size"])
    slow = presets.curve("ssao")[-1].ms
    # Those between lie on the line between their neighbours, those beyond on that of the last two.
    for layers, times in ((1, 1.0), (2, 2.0), (3, 4.5), (4, 7.0), (5, 9.5)):
        chosen = choose("ssao", size, budget_ms=1e9, layers=layers, runtime=runtime)
        assert chosen.ms == pytest.approx(times * slow)


@pytest.fixture
def some_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Records of GTAO and of the bitmask; none of the others."""
    for name in ("gtao", "bitmask_ao"):
        (tmp_path / f"{name}.json").write_text(json.dumps(presets.record(name)))
    presets.record.cache_clear()
    monkeypatch.setattr(presets.resources, "files", lambda package: tmp_path)
    yield
    presets.record.cache_clear()


@pytest.mark.usefixtures("same_speed")
def test_each_recorded_technique_is_chosen_by_name_error_and_time_and_refused_with_the_facts(
    technique: str, runtime: Runtime
) -> None:
    curve = presets.curve(technique)
    chosen = choose(technique, SIZE, preset="high", radius=0.7).params
    assert type(chosen) is TECHNIQUES[technique].params
    assert chosen.radius in (0.7, (0.7,))
    assert choose(technique, SIZE, error=curve[0].error_cut).error <= curve[0].error_cut
    assert choose(technique, SIZE, budget_ms=1e9, runtime=runtime).ms is not None
    # With the same speed everywhere, the first of the curve.
    setting = re.escape(", ".join(f"{key}={value!r}" for key, value in curve[0].parameters.items()))
    with pytest.raises(
        ValueError,
        match=(
            rf"budget_ms is 0.001: cannot be met: the fastest setting of {technique}, {setting}, takes about "
            r"\d+(\.\d+)? ms here at 800 x 600"
        ),
    ):
        choose(technique, SIZE, budget_ms=0.001, runtime=runtime)
    best = min(point.error_cut for point in curve)
    with pytest.raises(
        ValueError,
        match=(
            rf"error is 0.001: the best recorded setting of {technique} with 1 depth layer is expected to "
            rf"reach {best:.3f}"
        ),
    ):
        choose(technique, SIZE, error=0.001)
    with pytest.raises(ValueError, match=rf"of {technique} with 3 depth layers is expected"):
        choose(technique, SIZE, error=0.001, layers=3)


@pytest.mark.usefixtures("some_recorded")
@pytest.mark.parametrize("asked", [{"preset": "low"}, {"error": 0.1}, {"budget_ms": 8.0}], ids=str)
def test_technique_that_is_not_recorded_says_which_are(asked: dict[str, Any], steps: GBuffer, runtime: Runtime) -> None:
    message = "'hbao' has no presets: expected one of bitmask_ao, gtao"
    with pytest.raises(ValueError, match=message):
        choose("hbao", SIZE, runtime=runtime, **asked)
    with pytest.raises(ValueError, match=message):
        gi.hbao(steps, runtime=runtime, **asked)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (
            {"preset": "high", "budget_ms": 8},
            r"preset is 'high' and budget_ms is 8: expected "
            r"exactly one of preset, error, budget_ms",
        ),
        ({"error": 0.1, "budget_ms": 8}, r"error is 0.1 and budget_ms is 8: expected exactly one"),
        ({}, r"nothing is asked for: expected exactly one of preset, error, budget_ms"),
        ({"preset": "best"}, r"preset is 'best': .*'low', 'medium', 'high', 'ultra'"),
        ({"error": 0.0}, r"error is 0.0: expected a number > 0"),
        ({"error": float("nan")}, r"error is nan"),
        ({"budget_ms": -1.0}, r"budget_ms is -1.0: expected a number > 0 \(ms\)"),
        ({"preset": "low", "layers": 0}, r"layers is 0: expected an integer >= 1 and <= 16"),
        ({"preset": "low", "samples": 999}, r"samples is 999"),
    ],
)
def test_wrong_requests_are_named(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        choose("ssao", SIZE, **asked)


def test_technique_without_presets_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'tonemap' has no presets: expected one of .*ssao"):
        presets.parameters("tonemap", "low")
    with pytest.raises(ValueError, match=r"technique is 'tonemap': expected one of .*'ssao'"):
        choose("tonemap", SIZE, preset="low")


@pytest.mark.slow
def test_expected_error_is_that_of_the_scenes_for_tuning(runtime: Runtime) -> None:
    pytest.importorskip("embreex")
    from ssgi_cl.tuning.tunables import entry_of, views_of
    from ssgi_cl.tuning.tune import Session

    session = Session(entry_of("ssao"), views_of(None), runtime=runtime)
    chosen = choose("ssao", session._size, preset="medium")
    values = {name: getattr(chosen.params, name) for name in TECHNIQUES["ssao"].tunable}
    # Kernels may have changed a little since.
    assert session.trials.error(values) == pytest.approx(chosen.error, rel=0.02)


# ---- how it reaches the caller


@pytest.mark.parametrize("given", [{}, {"resolution": "half"}], ids=str)
def test_ssao_takes_what_is_not_given_from_the_preset(runtime: Runtime, steps: GBuffer, given: dict[str, Any]) -> None:
    a = ssao(steps, 0.6, preset="ultra", runtime=runtime, **given)
    values = {**presets.parameters("ssao", "ultra"), **given}
    np.testing.assert_array_equal(a, ssao(steps, 0.6, runtime=runtime, **values))
    assert (a != ssao(steps, 0.6, runtime=runtime, **given)).any()


def test_ssao_without_a_preset_takes_16_samples(runtime: Runtime, steps: GBuffer) -> None:
    np.testing.assert_array_equal(ssao(steps, 0.6, runtime=runtime), ssao(steps, 0.6, 16, runtime=runtime))


@pytest.mark.usefixtures("same_speed")
def test_ssao_takes_an_error_or_a_budget(runtime: Runtime, steps: GBuffer) -> None:
    # Both of the middle of the curve, at the size of the picture.
    middle = presets.curve("ssao")[len(presets.curve("ssao")) // 2]
    expected = ssao(steps, 0.6, runtime=runtime, **middle.parameters)
    a = ssao(steps, 0.6, error=1.0001 * middle.error_cut, runtime=runtime)
    np.testing.assert_array_equal(a, expected)
    budget = predicted_ms(runtime, Ssao, middle.ms, steps.size)
    b = ssao(steps, 0.6, budget_ms=1.0001 * budget, runtime=runtime)
    np.testing.assert_array_equal(b, expected)


def test_ssao_takes_only_one_of_preset_error_and_budget(runtime: Runtime, steps: GBuffer) -> None:
    with pytest.raises(ValueError, match=r"preset is 'low' and error is 0.2: expected at most one"):
        ssao(steps, 0.6, preset="low", error=0.2, runtime=runtime)


def test_device_gbuffer_brings_its_size_layers_margin_and_device(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, Any] = {}
    plain = choosing.choice_for

    def noted(technique: str, size: Any, **options: Any) -> Any:
        asked.update(options, size=size)
        return plain(technique, size, **options)

    monkeypatch.setattr(choosing, "choice_for", noted)
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=20, height=10)
    depth = np.full((2, 14, 26), 5.0, np.float32)
    gbuffer = on_device(GBuffer(camera=camera, depth=depth), runtime)
    ssao(gbuffer, 0.6, preset="low")
    assert asked["size"] == (10, 20)
    assert (asked["layers"], asked["margin"]) == (2, (2, 3))
    assert asked["runtime"] is runtime


def test_chosen_parameters_serve_the_class(runtime: Runtime, steps: GBuffer) -> None:
    params = gi.choose("ssao", steps.size, preset="low", radius=0.6).params
    a = gi.Ssao(runtime, steps.size, params)(steps)
    np.testing.assert_array_equal(a, ssao(steps, 0.6, preset="low", runtime=runtime))


@pytest.mark.usefixtures("same_speed")
@pytest.mark.parametrize("asked", [("--preset", "medium"), ("--error", "0.2"), ("--budget-ms", "1000")])
def test_command_line_takes_what_is_asked_and_what_is_set_wins(
    runtime: Runtime, steps: GBuffer, tmp_path: Path, asked: tuple[str, str]
) -> None:
    source, output = tmp_path / "in.exr", tmp_path / "out.exr"
    exr.write(source, {"depth": np.asarray(steps.depth)})
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(50.0), width=48, height=40)
    name, value = asked[0][2:].replace("-", "_"), asked[1]
    expected = ssao(
        GBuffer(camera=camera, depth=steps.depth),
        0.6,
        5,
        runtime=runtime,
        **{name: value if name == "preset" else float(value)},  # type: ignore[arg-type]
    )
    options = (*asked, "--set", "radius=0.6", "--set", "samples=5")
    done = CliRunner().invoke(main, ["apply", "ssao", str(source), "-o", str(output), *options])
    assert done.exit_code == 0, done.output
    np.testing.assert_array_equal(exr.read(output)["ao"], expected)
