"""`ssgi bench` and `ssgi truth` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from ssgi_cl.bench import document, suite
from ssgi_cl.cli.command import main

from .documents import entry, whole

pytestmark = pytest.mark.usefixtures("own_store")

QUICK = ["--scene", "cornell_box", "--size", "40x30", "--truth-rays", "4", "--truth-points", "4", "--truth-paths", "2"]


def ssgi(*arguments: str, status: int = 0) -> Result:
    result = CliRunner().invoke(main, list(arguments))
    assert result.exit_code == status, result.output
    return result


def bench(*arguments: str, status: int = 0) -> Result:
    return ssgi("bench", *arguments, *QUICK, "--seconds", "0.05", status=status)


def test_a_case_is_measured_and_written_as_json_and_markdown(tmp_path: Path) -> None:
    paths = tmp_path / "found.json", tmp_path / "found.md"
    written = bench("ssao.4", "--json", "-o", str(paths[0]), "--markdown", str(paths[1])).stdout
    found = json.loads(paths[0].read_text())
    assert json.loads(written) == found
    assert found["format"] == "ssgi-bench 2"
    assert [result["name"] for result in found["results"]] == ["ssao.4.cornell_box.40x30"]
    assert found["options"]["truth_rays"] == 4
    assert "ssao.4" in paths[1].read_text(encoding="utf-8")


def test_cases_are_listed_without_measuring_and_without_peers_if_asked() -> None:
    names = bench("blur", "--list").output.split()
    assert names == [f"blur.{radius}.cornell_box.40x30" for radius in (2, 4, 7, 16)]
    every, own = (set(bench(*own, "--list").output.split()) for own in ([], ["--own"]))
    assert own < every
    assert {"embree", "vtk-ssao"} <= {name.split(".")[0] for name in every - own}


def test_a_result_compared_with_itself_is_no_worse_and_a_slower_one_fails(tmp_path: Path) -> None:
    before, after = (str(tmp_path / f"{name}.json") for name in ("before", "after"))
    for path, ms in ((before, 2.0), (after, 6.0)):
        document.write(Path(path), whole(entry(ms=ms)))
    ssgi("bench", "--compare", before, before)
    assert "ssao.16" in ssgi("bench", "--compare", before, after, status=1).output
    ssgi("bench", "--compare", after, before)  # faster is no failure


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.4", "--scene", "cornell_box"], "fits none"),
        (["ssao.4", "--scene", "attic"], "scene is 'attic'"),
        (["ssao.4", "--size", "800"], "expected COLUMNSxROWS"),
        (["ssao.4", "--size", "0x600"], "expected COLUMNSxROWS"),
        (["ssao.4", "-o", "found.txt"], "expected a name that ends in .json"),
        (["ssao.4", "--markdown", "nowhere/found.md"], "there is no folder nowhere"),
        (["ssao.4", "--device", "no such thing"], "no such OpenCL device"),
        (["--compare", "no.json", "no.json"], "no.json"),
    ],
)
def test_bad_input_is_one_clear_line(arguments: list[str], message: str) -> None:
    result = CliRunner().invoke(main, ["bench", *arguments])
    assert result.exit_code in (1, 2)
    assert message in " ".join(result.output.split())
    assert "Traceback" not in result.output


def test_truths_are_made_once_listed_and_cleared(own_store: Path) -> None:
    assert "0 files" in ssgi("truth", "--list").output
    ssgi("truth", "ssao.4", *QUICK)
    kept = {path: path.stat().st_mtime_ns for path in (own_store / "truth").iterdir()}
    assert len(kept) == 2  # rays, and the points that the model converges to
    ssgi("truth", "ssao", *QUICK)  # every number of samples has the same truths
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    lines = ssgi("truth", "--list").output.splitlines()
    assert [line.partition("MiB")[2].strip() for line in lines[:2]] == ["40 x 30"] * 2
    entries: list[dict[str, Any]] = json.loads(ssgi("truth", "--list", "--json").stdout)
    assert {Path(entry["file"]) for entry in entries} == set(kept)
    ssgi("truth", "ssao.4", "--rebuild", *QUICK)
    assert all(path.stat().st_mtime_ns > made for path, made in kept.items())
    assert "freed" in ssgi("truth", "--clear").output
    assert list((own_store / "truth").iterdir()) == []


@pytest.mark.filterwarnings("always")
def test_a_store_that_cannot_be_written_is_a_warning_in_one_line(own_store: Path) -> None:
    own_store.mkdir()
    (own_store / "truth").touch()  # a file where the folder is to be
    lines = ssgi("truth", "ssao.4", *QUICK).stderr.splitlines()
    assert lines
    assert all(line.startswith("warning: the truth is not kept") for line in lines)


def test_a_damaged_truth_is_named_with_the_remedy(own_store: Path) -> None:
    ssgi("truth", "ssao.4", *QUICK)
    for path in (own_store / "truth").iterdir():
        path.write_bytes(path.read_bytes()[:100])
    shown = " ".join(bench("ssao.4").output.split())
    assert "ssgi truth --rebuild" in shown
    assert "skipped world truth of ssao.4" in shown  # but the time is there
    assert "nothing was measured" not in shown
    assert "ssgi truth --rebuild" in ssgi("truth", "ssao.4", *QUICK, status=1).output
    next((own_store / "truth").iterdir()).write_bytes(b"nothing")
    assert "unreadable" in ssgi("truth", "--list").output.splitlines()[0]
    ssgi("truth", "ssao.4", "--rebuild", *QUICK)
    ssgi("truth", "ssao.4", *QUICK)


def test_what_was_measured_before_an_interrupt_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measured = suite._one

    def interrupted(case: Any, *rest: Any) -> None:
        if case.family == "gbuffer":
            raise KeyboardInterrupt
        measured(case, *rest)

    monkeypatch.setattr(suite, "_one", interrupted)
    path = tmp_path / "found.json"
    cases = ("blur.2", "gbuffer.1", "ssao.4")
    options = ("--scene", "cornell_box", "--size", "40x30", "--seconds", "0.01", "--no-errors", "-o", str(path))
    result = CliRunner().invoke(main, ["bench", *cases, *options])
    assert result.exit_code == 130, result.output
    assert [entry["family"] for entry in document.read(path)["results"]] == ["blur"]
    assert "Aborted!; 1 of 3 cases are kept" in result.stderr
