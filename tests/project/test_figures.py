"""Recorded figures, and the pages that are made from them."""

from __future__ import annotations

import copy
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click import ClickException
from click.testing import CliRunner

from ssgi_cl.bench import document, suite
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.verdict import mark, verdict
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, cornell_box
from ssgi_cl.tuning.case import Case
from tools.figures import __main__ as figures
from tools.figures import pages, tables

from ..bench.documents import entry, marked, path_points, spread, texts, whole
from ..bench.test_verdict import check

ROOT = Path(__file__).parents[2]


# ---- what is kept with the code


@pytest.fixture(scope="module")
def made_pages() -> dict[str, str]:
    """Each page as the recorded figures make it."""
    return pages.pages(ROOT)


@pytest.mark.parametrize("name", [*figures.PLANS, *figures.OTHERS])
def test_recorded_figures_are_written_as_they_are_kept(tmp_path: Path, name: str) -> None:
    kept = (ROOT / pages.FOLDER / f"{name}.json").read_text(encoding="utf-8")
    figures.write(tmp_path, name, json.loads(kept))
    made = (tmp_path / pages.FOLDER / f"{name}.json").read_text(encoding="utf-8")
    assert made == kept


@pytest.mark.parametrize("name", [*pages.BY_HAND, "docs/benchmark.md", "docs/skips.md", "docs/summation.md"])
def test_pages_are_what_the_recorded_figures_make_of_them(made_pages: dict[str, str], name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert text == made_pages[name], f"{name} differs from docs/figures: make figures-render"


@pytest.mark.slow
def test_plots_are_those_of_the_recorded_figures() -> None:
    drawn = pages.plots(ROOT)
    assert drawn
    for name, text in drawn.items():
        kept, made = (ET.fromstring(svg) for svg in ((ROOT / "docs" / f"{name}.svg").read_text("utf-8"), text))
        assert texts(kept) == texts(made)
        lines = [e.get("id", "") for e in made.iter() if e.get("id", "").startswith(("family-", "front"))]
        for line in set(lines):
            there, here = (path_points(marked(root, line)[0]) for root in (kept, made))
            assert len(there) == len(here)
            np.testing.assert_allclose(there, here, atol=4.0)  # points; versions of matplotlib lay out alike


@pytest.mark.parametrize("name", list(figures.PLANS))
def test_no_published_verdict_contradicts_a_row(name: str) -> None:
    found = pages.recorded(ROOT, name)
    said = 0
    for results in document.groups(found["results"]).values():
        if not verdict(results):
            continue
        said += 1
        check([r for r in results if document.metric(r, "world", "rmse") is not None])
    assert said


@pytest.mark.parametrize("name", list(figures.PLANS))
def test_marks_of_the_recorded_front_are_those_of_its_rows(name: str) -> None:
    def marks(results: list[dict[str, Any]]) -> list[tuple[bool, bool]]:
        mark(results)
        return [(result["front"], result["near"]) for result in results]

    found = pages.recorded(ROOT, name)["results"]
    kept = [(result["front"], result["near"]) for result in found]
    # Marks are made before numbers are cut to five digits: of two rows that are equal in these, either may be less.
    for place in [i for i, (made, there) in enumerate(zip(marks(found), kept, strict=True)) if made != there]:
        either = []
        for ms, error in ((1.0, 1.0 - 1e-9), (1.0, 1.0 + 1e-9), (1.0 - 1e-9, 1.0), (1.0 + 1e-9, 1.0)):
            exact = copy.deepcopy(found)
            exact[place]["wall_ms"]["median"] *= ms
            exact[place]["errors"]["world"]["rmse"] *= error
            either.append(marks(exact)[place])
        assert kept[place] in either, found[place]["name"]


def test_all_documents_are_of_one_revision_and_machine() -> None:
    found = [pages.recorded(ROOT, name) for name in figures.PLANS]
    assert len({document["revision"] for document in found}) == 1
    assert len({json.dumps(document["machine"]) for document in found}) == 1
    rest = [pages.recorded(ROOT, name) for name in figures.OTHERS]
    assert {one["revision"].partition(",")[0] for one in rest} == {found[0]["revision"]}


def test_bias_of_visibility_is_measured_on_all_built_in_scenes_and_views() -> None:
    scenes = figures.PLANS["indirect"].cases
    # veach_ajar has no light but its emissive surfaces.
    assert set(scenes) == {*BUILTIN_SCENES, *figures.MESH_VIEWS} - {"veach_ajar"}
    for patterns in scenes.values():
        cases = suite.select(patterns, ["cornell_box"], [(8, 6)])
        names = {f"{case.family}.{case.setting}" for case in cases}
        assert names >= set(tables.VISIBILITY)


# ---- how it is made


def test_a_block_that_there_is_none_of_is_refused() -> None:
    with pytest.raises(ValueError, match="figures:nothing is unknown: expected one of a, b"):
        pages.filled("<!-- figures:nothing -->\n<!-- end -->", {"a": "", "b": ""})


def test_compact_json_can_be_read_again_and_is_small(tmp_path: Path) -> None:
    found = whole(entry("a.1.hall.8x6", 1.23456789, 0.1), entry("b.1.hall.8x6", 2.0, None, unsteady="busy"))
    (tmp_path / "found.json").write_text(pages.compact(found), encoding="utf-8")
    again = document.read(tmp_path / "found.json")
    assert again["results"][0]["wall_ms"]["median"] == 1.2346
    assert [r["unsteady"] for r in again["results"]] == ["", "busy"]
    assert "regions" not in again["results"][0]["errors"]["world"]
    lines = pages.compact(found).splitlines()
    assert sum('"name": "a.1.hall.8x6"' in line for line in lines) == 1


def test_biases_are_per_cent_of_the_mean_with_their_sign() -> None:
    rows = [entry("vpl-visibility.4096.hall.8x6", rmse=0.1, quantity="bounce"), entry("gtao.2x9.hall.8x6", rmse=0.1)]
    rows[0]["errors"]["world"] |= {"mean": 0.5, "bias": -0.02}
    lines = tables.biases(rows, tables.VISIBILITY).splitlines()
    assert lines[2:] == ["| hall | -4 % | 20 % | - | - |"]


def test_speed_ups_name_the_best_alternative_and_the_plain_way() -> None:
    def light(name: str, ms: float, rmse: float) -> dict[str, Any]:
        result = entry(f"{name}.hall.8x6", rmse=rmse, quantity="bounce", wall_ms=spread(ms))
        return result | {"device_ms": spread(100.0 * ms)}

    rows = [
        light("multires.10-permille", 10.0, 0.1),
        light("vpl-plain.1024", 80.0, 0.1),
        light("vpl.1024", 40.0, 0.1),
        light("vpl-interleaved.1024", 5.0, 0.2),
        light("rsm-gather.400", 30.0, 0.104),
    ]
    (line,) = (line for line in tables.speed_ups(rows).splitlines() if line.startswith("| multires.10-permille"))
    # The faster one errs more, so it is no alternative.
    assert line == (
        "| multires.10-permille | hall | 10.0 | rsm-gather.400, 30.0 ms | 3.00 | vpl-plain.1024, 80.0 ms | 8.00 |"
    )
    assert tables.best_alternative(rows[0], rows[3:4]) is None


def test_every_case_that_is_shown_is_planned() -> None:
    shown = {name for _, _, cases in tables.rows() for _, name in cases}
    shown |= {name for case, plain, _ in tables.SPEED_UPS for name in (case, plain)}
    plan = figures.PLANS["benchmark"]
    names = {f"{case.family}.{case.setting}" for case in figures.chosen(plan, plan.size, {"hall": cornell_box()})}
    assert shown <= names
    for plan in figures.PLANS.values():
        for scene, patterns in plan.cases.items():
            assert suite.select(patterns, [scene], [plan.size], FAMILIES)


def test_every_occlusion_table_has_its_peers_blurred_denoised_and_at_their_best() -> None:
    for scene in ("cornell_box", "hall", *figures.MESH_VIEWS):
        plan = figures.PLANS["benchmark"]
        cases = figures.chosen(plan, plan.size, {scene: cornell_box()})
        found = {f"{case.family}.{case.setting}" for case in cases}
        assert {
            "mitsuba-ao-blur.4",
            "mitsuba-ao-oidn.4",
            "mitsuba-ao-moving-blur.4",
            "xegtao.best",
            "embree.1",
        } <= found
    light = figures.chosen(plan, plan.size, {"hall": cornell_box()})
    assert any(case.family == "mitsuba-path-oidn" for case in light)


def test_figures_of_a_tree_with_changes_are_refused() -> None:
    clean = {"revision": "abc", "modified": False}
    figures.check_tree(clean, allow_dirty=False)
    for stamp, words in (
        ({"revision": "abc", "modified": True}, "differ from revision abc"),
        ({"revision": None, "modified": None}, "no git checkout"),
    ):
        with pytest.raises(ClickException, match=words):
            figures.check_tree(stamp, allow_dirty=False)
        figures.check_tree(stamp, allow_dirty=True)


def test_a_scene_without_its_mesh_is_left_out_and_named(runtime: Any, tmp_path: Path) -> None:
    found, absent = figures.available(["cornell_box", "sponza"], runtime, tmp_path, ROOT)
    assert list(found) == ["cornell_box"]
    assert [entry["name"] for entry in absent] == ["sponza"]
    assert absent[0]["reason"] == "its mesh was not there (--meshes FOLDER)"


def test_progress_is_told_a_line_a_case(capsys: pytest.CaptureFixture[str]) -> None:
    report = figures.Progress()
    for text, share in (("a.1", 0.0), ("rays of hall 50 %", 0.1), ("a.1", 0.1), ("b.1", 0.5)):
        report(text, share)
    told = re.findall(r"\d+ %  (\S+)", capsys.readouterr().out)
    assert told == ["a.1", "b.1"]


def test_rendering_writes_what_differs_and_nothing_else(tmp_path: Path) -> None:
    for name in pages.pages(ROOT):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    folder = tmp_path / pages.FOLDER
    folder.mkdir(parents=True)
    for file in (ROOT / pages.FOLDER).glob("*.json"):
        (folder / file.name).write_bytes(file.read_bytes())
    assert figures.render(tmp_path) == []
    path = folder / "benchmark.json"
    found = json.loads(path.read_text(encoding="utf-8"))
    for result in found["results"]:
        result["wall_ms"]["median"] *= 2.0
    path.write_text(json.dumps(found), encoding="utf-8")
    shown = CliRunner().invoke(figures.main, ["--render", "--root", str(tmp_path)])
    assert shown.exit_code == 0
    assert {"wrote README.md", "wrote docs/benchmark.md"} <= set(shown.output.splitlines())
    assert figures.render(tmp_path) == []


def test_a_case_of_a_plan_names_its_size() -> None:
    plan = figures.PLANS["indirect"]
    cases = figures.chosen(plan, figures.QUICK, {"sponza": cornell_box()})
    assert Case("ssdo-far-all", "8", "sponza", (72, 96)) in cases
