"""`ssgi graph`: what it draws, and what it says when something is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from .commands import SMALL, fails, succeeds

BOX = ("graph", "cornell_box", *SMALL, "--rsm-size", 64, "--ambient", 0.3)


def drawn(path: Path, *arguments: object) -> str:
    assert succeeds(*BOX, "-o", path, *arguments).stdout == f"wrote {path}\n"
    return path.read_text()


def states(text: str) -> dict[str, str]:
    return {stage["name"]: stage["state"] for stage in json.loads(text)["stages"]}


def test_the_ending_chooses_what_is_written(tmp_path: Path) -> None:
    assert drawn(tmp_path / "a.mmd", "--bounces", 0).startswith("flowchart TD\n")
    assert drawn(tmp_path / "a.dot", "--bounces", 0).startswith("digraph frame {")
    record = json.loads(drawn(tmp_path / "a.JSON", "--bounces", 0))
    assert record["stages"][0]["name"] == "G-buffer"
    assert record["stages"][0]["ms"] > 0.0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.JSON", "a.dot", "a.mmd"]


def test_outputs_cull_what_they_do_not_need(tmp_path: Path) -> None:
    found = states(drawn(tmp_path / "a.json", "--preset", "low", "--outputs", "ao, gbuffer"))
    assert {name: state for name, state in found.items() if state != "culled"} == {"G-buffer": "ran", "gtao": "ran"}
    assert {"shadow maps", "sky light", "bounce", "blended layers", "read-back", "exposure", "picture"} < set(found)


def test_the_next_frame_of_the_same_inputs_reuses_stages(tmp_path: Path) -> None:
    found = states(drawn(tmp_path / "a.json", "--preset", "low", "--again"))
    assert {found[name] for name in ("G-buffer", "gtao", "blended layers", "picture")} == {"reused"}
    assert found["shadow maps"] == "unneeded"


@pytest.mark.parametrize(
    ("options", "stage", "state", "why"),
    [
        (("--indirect", "gather"), "bounce", "ran", ""),
        (("--ao", "ssao", "--ao-samples", "8", "--bounces", "0"), "ssao", "ran", ""),
        (("--exposure", "2", "--bounces", "0"), "exposure", "culled", "the caller gives exposure"),
        (("--indirect", "ssdo", "--layers", "2"), "ambient occlusion", "idle", "ssdo hides ambient light by itself"),
    ],
    ids=str,
)
def test_options_of_render_shape_the_frame(
    tmp_path: Path, options: tuple[str, ...], stage: str, state: str, why: str
) -> None:
    record: Any = json.loads(drawn(tmp_path / "a.json", *options))
    found = next(each for each in record["stages"] if each["name"] == stage)
    assert (found["state"], found["why"]) == (state, why)


def test_skips_of_a_stage_are_in_its_entry(tmp_path: Path) -> None:
    record = json.loads(drawn(tmp_path / "a.json", "--width", 128, "--height", 96, "--bounces", 0))
    skips = {stage["name"]: [s["name"] for s in stage["skips"]] for stage in record["stages"]}
    assert skips["shadow maps"] == ["map spot"]
    record = json.loads(drawn(tmp_path / "b.json", "--no-skips", "--bounces", 0))
    assert not any(stage["skips"] for stage in record["stages"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "graph.png"), "--output is graph.png: expected a name that ends in .dot or .mmd or .json"),
        (("-o", "nowhere/graph.mmd"), "there is no folder nowhere"),
        (
            ("-o", "graph.mmd", "--outputs", "depth"),
            "outputs has 'depth': expected names out of 'image', 'radiance', 'ao', 'indirect', 'gbuffer'",
        ),
        (("-o", "graph.mmd", "--layers", "0"), "layers is 0"),
    ],
    ids=str,
)
def test_bad_options_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in fails(tmp_path, *BOX, *options)
