"""The document: stamped, written and read."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.bench import document
from ssgi_cl.device.runtime import Runtime

from .documents import entry, spread, whole


def test_stamp_says_what_was_measured_and_on_what_and_reads_back(tmp_path: Path, runtime: Runtime) -> None:
    stamp = document.stamp(runtime)
    assert stamp["format"] == "ssgi-bench 2"
    assert stamp["created"].endswith("+00:00")
    assert stamp["versions"]["numpy"] == np.__version__
    assert stamp["versions"].keys() >= {"ssgi_cl", "python", "pyopencl", "embreex", "vtk"}
    assert stamp["device"]["label"] == runtime.info.label
    assert stamp["device"]["variant"] == str(runtime.variant)
    assert stamp["machine"]["threads"] >= 1
    assert stamp["machine"]["cpu"]
    written = {**whole(entry()), **stamp}
    document.write(tmp_path / "a.json", written)
    assert document.read(tmp_path / "a.json") == written
    assert '\n "device": {\n  "label"' in (tmp_path / "a.json").read_text(encoding="utf-8")  # readable


def test_revision_is_that_of_the_checkout_and_tells_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*arguments: str) -> None:
        who = ["-c", "user.name=n", "-c", "user.email=e@example.org", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *arguments], check=True, capture_output=True)

    module = tmp_path / "module.py"
    module.write_text("1\n")
    assert document._revision(module) == (None, None)  # no checkout
    try:
        git("init")
    except FileNotFoundError:
        pytest.skip("git is missing")
    assert document._revision(module) == (None, None)  # git doesn't know the file
    git("add", "module.py")
    git("commit", "-m", "one")
    revision, modified = document._revision(module)
    assert revision
    assert modified is False
    module.write_text("2\n")
    assert document._revision(module) == (revision, True)
    monkeypatch.setenv("PATH", "")  # no git
    assert document._revision(module) == (None, None)


def test_numbers_that_json_lacks_become_null(tmp_path: Path) -> None:
    result = entry()
    result["errors"]["world"].update(psnr=math.inf, flip=math.nan, ssim=np.float32(0.5))
    document.write(tmp_path / "a.json", whole(result))
    world = document.read(tmp_path / "a.json")["results"][0]["errors"]["world"]
    assert world["psnr"] is None
    assert world["flip"] is None
    assert world["ssim"] == 0.5


def _without(*path: str | int) -> dict[str, Any]:
    made = whole(entry())
    at: Any = made
    for step in path[:-1]:
        at = at[step]
    del at[path[-1]]
    return made


@pytest.mark.parametrize(
    ("made", "message"),
    [
        ([], "it has no format: expected 'ssgi-bench 2'"),
        (_without("format"), "it has no format"),
        ({**whole(), "format": "ssgi-bench 9"}, "its format is 'ssgi-bench 9': expected"),
        (_without("device"), "device is missing"),
        (_without("calibration", "gathers_g_s"), "calibration.gathers_g_s is missing"),
        (_without("results", 0, "name"), r"results\[0\].name is missing"),
        (_without("results", 0, "ratio", "low"), r"results\[0\].ratio.low is missing"),
        (whole(entry(device_ms={"median": 1.0})), r"results\[0\].device_ms.low is missing"),
        (whole(entry(ratio=None)), r"results\[0\].ratio is None: expected an object"),
        (whole(entry(ms=-1.0)), r"results\[0\].wall_ms.median is -1.0: expected a number >= 0"),
        (whole(entry(size=[0, 6])), r"results\[0\].size is \[0, 6\]: expected rows and columns"),
        (whole(entry(unsteady=None)), r"results\[0\].unsteady is None: expected text"),
        (whole(entry(), entry()), r"results\[1\].name is 'ssao.16.hall.8x6': expected each"),
        (whole(skipped=[{"name": "x"}]), r"skipped\[0\].reason is missing"),
        (whole(results={}), "results is {}: expected a list"),
    ],
)
def test_wrong_document_is_refused_and_named(tmp_path: Path, made: Any, message: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(made))
    with pytest.raises(ValueError, match=message) as caught:
        document.read(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", '{"format": NaN}', "\xff"])
def test_what_is_not_json_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match=r"a\.json is not JSON: "):
        document.read(path)
    with pytest.raises(FileNotFoundError, match=r"none\.json"):
        document.read(tmp_path / "none.json")


def test_groups_share_quantity_scene_and_size_and_begin_with_the_fastest() -> None:
    names = ["a.1.hall.8x6", "a.2.hall.8x6", "a.1.box.8x6", "a.1.hall.6x8"]
    results = [entry(name, ms=float(9 - i)) for i, name in enumerate(names)]
    results.append(entry("b.1.hall.8x6", quantity="direct", device_ms=None))
    grouped = document.groups(results)
    assert [key for key in grouped] == [
        ("occlusion", "hall", (6, 8)),
        ("occlusion", "box", (6, 8)),
        ("occlusion", "hall", (8, 6)),
        ("direct", "hall", (6, 8)),
    ]
    first = grouped[("occlusion", "hall", (6, 8))]
    assert [result["name"] for result in first] == ["a.2.hall.8x6", "a.1.hall.8x6"]
    assert document.clock(entry(ms=2.0, device_ms=spread(9.0)))["median"] == 2.0


def test_metric_that_is_missing_or_infinite_is_none() -> None:
    assert document.metric(entry(rmse=0.25), "world", "rmse") == 0.25
    for result in (entry(rmse=None), entry(rmse=math.inf), entry(errors={}), entry(errors=None)):
        assert document.metric(result, "world", "rmse") is None
    assert document.metric(entry(), "assumption", "rmse") is None
