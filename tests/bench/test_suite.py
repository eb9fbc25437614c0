"""Choosing cases of every technique, measuring them, and going on where one can't run."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.bench import calls, cases, document, suite
from ssgi_cl.bench.cases import OWN
from ssgi_cl.bench.experiments import defaults
from ssgi_cl.bench.verdict import mark
from ssgi_cl.core import lights
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BuiltinScene, cornell_box
from ssgi_cl.techniques.catalogue import CATALOGUE, TECHNIQUES
from ssgi_cl.techniques.technique import Bench
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Case, Family, Subject, count_of
from ssgi_cl.tuning.context import Context, TruthSettings
from tools.figures import tables

pytestmark = pytest.mark.usefixtures("own_store")

SMALL = (30, 40)
QUICK = TruthSettings(rays=4, paths=2, points=4)


def measured(
    runtime: Runtime, *patterns: str, view: BuiltinScene | None = None, families: Mapping[str, Family] = OWN
) -> suite.Measurements:
    """Return what the benchmark finds of cases in the Cornell box, or in another scene by its name."""
    cases = suite.select(patterns, ["cornell_box"], [SMALL], families)
    views = {"cornell_box": view or cornell_box()}
    return suite.measure(cases, views, runtime, truths=QUICK, runs=4, families=families)


def test_a_case_and_its_name_tell_the_same() -> None:
    case = Case("ssao-blur", "16", "hall", (600, 800))
    assert case.name == "ssao-blur.16.hall.800x600"
    assert Case.parse(case.name) == case


@pytest.mark.parametrize(
    "name",
    [
        "",
        "ssao",
        "ssao.16.hall",
        "ssao.16.hall.800",
        "ssao.16.hall.0x600",
        "ssao.16.hall.800x600.x",
        "ssao..hall.800x600",
        "ssao.16.ha ll.800x600",
        "ssao.16.hall.800x-600",
    ],
)
def test_what_is_no_name_is_refused_with_an_example(name: str) -> None:
    with pytest.raises(ValueError, match=r"expected family\.setting\.scene\.COLUMNSxROWS"):
        Case.parse(name)


@pytest.mark.parametrize("setting", ["", "-1", "0", "257", "1.5", "many"])
def test_a_setting_that_is_no_count_is_refused_with_the_range(setting: str) -> None:
    with pytest.raises(ValueError, match="expected a number of samples, 1 to 256"):
        count_of(setting, "a number of samples", 1, 256)
    assert count_of("16", "a number of samples", 1, 256) == 16


def test_without_patterns_every_setting_on_every_scene_and_size_is_chosen() -> None:
    chosen = suite.select([], ["a", "b"], [SMALL, (60, 80)], OWN)
    assert len(chosen) == 4 * sum(len(family.SETTINGS) for family in OWN.values())
    assert len(set(chosen)) == len(chosen)


def test_a_pattern_may_stop_early_and_hold_wildcards() -> None:
    def names(*patterns: str) -> list[str]:
        return [case.name for case in suite.select(patterns, ["a", "b"], [SMALL], OWN)]

    assert names("ssao.16") == ["ssao.16.a.40x30", "ssao.16.b.40x30"]
    assert names("ssao*.16.b") == ["ssao.16.b.40x30", "ssao-blur.16.b.40x30", "ssao-half.16.b.40x30"]
    assert names("*.7.a.40x30", "blur.7.a") == ["blur.7.a.40x30"]  # each once
    assert names("*") == names("*.a.*", "*40x30") == names()
    # Cases of a scene and size are together, whatever the order of patterns.
    assert [name.split(".")[2] for name in names("ssao.4", "blur.2")] == ["a", "a", "b", "b"]


def test_a_full_name_may_ask_for_an_unusual_setting_and_size() -> None:
    (case,) = suite.select(["ssao.17.a.41x31"], ["a"], [SMALL], OWN)
    assert case == Case("ssao", "17", "a", (31, 41))
    assert suite.select(["ssao.17"], ["a", "b"], [SMALL], OWN) == [
        Case("ssao", "17", "a", SMALL),
        Case("ssao", "17", "b", SMALL),
    ]


@pytest.mark.parametrize("pattern", ["sao.16", "ssao.16.c.40x30", "*.nothing", "ssao.17*"])
def test_a_pattern_that_fits_nothing_is_refused_with_what_there_is(pattern: str) -> None:
    with pytest.raises(ValueError, match=r"fits none; families are ssao, .*, scenes a"):
        suite.select([pattern], ["a"], [SMALL], OWN)


@pytest.mark.slow  # compiles and runs everything, with truths
def test_every_usual_case_of_ours_can_be_measured(runtime: Runtime) -> None:
    found = measured(runtime)
    assert found.skipped == []
    cases = suite.select([], ["cornell_box"], [SMALL], OWN)
    assert [result["name"] for result in found.results] == [case.name for case in cases]


def test_measured_cases_make_a_document_that_can_be_read_again(runtime: Runtime, tmp_path: Any) -> None:
    found = measured(runtime, "ssao.4", "blur.2", "gbuffer.1")
    mark(found.results)
    written = {**document.stamp(runtime), **suite.entries(found, QUICK, 1.0)}
    document.write(tmp_path / "found.json", written)
    again = document.read(tmp_path / "found.json")
    ssao, blur, gbuffer = again["results"]
    assert set(ssao["errors"]) == {"world", "assumption"}
    assert set(blur["errors"]) == {"assumption"}
    assert gbuffer["errors"] == {}
    assert ssao["front"]  # the only one of its group, however unsteady
    # The blur's kernel is its float64 reference but for roundings, about 1e-6 of A.
    assert blur["errors"]["assumption"]["rmse"] < 1e-5
    assert set(found.pictures) == {ssao["name"], blur["name"]}
    # The blur reads along rows and columns: a rate of scattered reads would exceed their ceiling.
    assert blur["samples_g_s"] is None
    # 16 reads of 1200 pixels cannot be faster than all reads of the machine, with room for noise.
    assert ssao["samples_g_s"] < 3.0 * again["calibration"]["gathers_g_s"]


def broken(context: Context, setting: str) -> Subject:
    """Fail to prepare, or to run."""
    if setting == "now":
        raise ValueError("setting is 'now':\n expected another")

    def run() -> None:
        raise ValueError("not today")

    return Subject(run=run)


def test_what_cannot_run_is_listed_with_the_reason_and_the_rest_goes_on(runtime: Runtime) -> None:
    why = "absent is not installed: pip install 'ssgi-cl[peers]'"
    families = {
        "broken": Family(broken, ("now", "later")),
        "absent": Family(broken, ("now", "later"), missing=lambda: why),
        "gbuffer": OWN["gbuffer"],
    }
    found = measured(runtime, families=families)
    reasons = {entry["name"].split(".")[0:2][0]: entry["reason"] for entry in found.skipped}
    assert reasons == {"broken": "not today", "absent": why}
    assert "setting is 'now': expected another" in [entry["reason"] for entry in found.skipped]
    assert [result["family"] for result in found.results] == ["gbuffer", "gbuffer"]


def test_a_scene_without_lights_skips_what_needs_them_and_says_so(runtime: Runtime) -> None:
    dark = replace(cornell_box(), lights=(lights.Environment(1.0),))
    found = measured(runtime, "direct.512", "rsm.512", "ssao.4", view=dark)
    assert {entry["name"]: entry["reason"] for entry in found.skipped} == {
        name: "cornell_box has no light: expected at least one"
        for name in ("direct.512.cornell_box.40x30", "rsm.512.cornell_box.40x30")
    }
    assert len(found.results) == 1


def test_without_the_package_that_a_truth_needs_times_are_kept_and_the_extra_is_named(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    found = measured(runtime, "ssao.4")
    assert [entry["name"] for entry in found.skipped] == ["world truth of ssao.4.cornell_box.40x30"]
    assert "pip install 'ssgi-cl[truth]'" in found.skipped[0]["reason"]
    assert set(found.results[0]["errors"]) == {"assumption"}


def test_an_image_that_shows_nothing_is_timed_without_errors(runtime: Runtime) -> None:
    away = replace(cornell_box(), eye=(0.0, 0.0, -5.0), target=(0.0, 0.0, -9.0))
    found = measured(runtime, "ssao.4", view=away)
    assert found.skipped == []
    assert found.results[0]["errors"] == {}


def test_the_sky_counts_where_all_light_is_held_to_paths(runtime: Runtime) -> None:
    def prepare(context: Context, quantity: str) -> Subject:
        image = np.where(context.seen[..., None], 1.0, np.float32(3.0)).repeat(3, axis=-1)
        truth = Truth(np.ones_like(image), np.zeros_like(image), 2, "")
        return Subject.of_image(lambda: image, quantity=quantity, truths={"world": lambda: truth}, timed=False)

    up = replace(cornell_box(), eye=(0.0, 1.0, 9.0), target=(0.0, 1.0, 0.0))
    found = measured(runtime, view=up, families={"light": Family(prepare, ("radiance", "bounce"))})
    whole, surfaces = (result["errors"]["world"] for result in found.results)
    seen = [pictures.seen for pictures in found.pictures.values()]
    assert seen[0].all()
    assert 0.0 < seen[1].mean() < 1.0
    assert surfaces["rmse"] == 0.0
    assert whole["bias"] == pytest.approx(2.0 * (1.0 - seen[1].mean()))


def test_progress_grows_to_one_and_names_what_is_under_way(runtime: Runtime) -> None:
    seen: list[tuple[str, float]] = []
    cases = suite.select(["ssao.4"], ["cornell_box"], [SMALL], OWN)
    wrong = suite.make_truths(
        cases, {"cornell_box": cornell_box()}, runtime, QUICK, report=lambda text, share: seen.append((text, share))
    )
    assert wrong == []
    shares = [share for _, share in seen]
    # Several truths of one case each count from its beginning.
    assert min(shares) == 0.0
    assert shares[-1] == 1.0
    assert max(shares) <= 1.0
    assert any("rays of cornell_box" in text for text, _ in seen)


def test_every_technique_is_measured_called_and_shown() -> None:
    assert set(TECHNIQUES) <= set(cases.FAMILIES)
    for name, each in CATALOGUE.items():
        assert set(each.bench.families) <= set(cases.FAMILIES), name
        for _, figures in each.bench.rows.values():
            shown = {case.split(".")[0] for _, case in figures}
            assert shown <= set(cases.FAMILIES), name
        assert each.kind == "ao" or getattr(calls, each.function.__name__, None) is each.function, name
    assert {name.replace("_", " ") for name in CATALOGUE if CATALOGUE[name].kind == "ao"} <= set(calls.CALLS)
    assert set(defaults.SCANS) == {"shadow_map", "vpl_splat", "multires_splat", "ssdo_views"}


def test_a_technique_has_rows_and_a_page_by_its_descriptor_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    before = tables.rows()
    assert [call for call, _, _ in before] == list(tables.ORDER)
    new = replace(CATALOGUE["ssao"], name="new", bench=Bench(rows={"new": ("what", (("", "ssao.4"),))}))
    monkeypatch.setitem(CATALOGUE, "new", new)
    assert tables.rows() == [*before, ("new", "what", (("", "ssao.4"),))]
