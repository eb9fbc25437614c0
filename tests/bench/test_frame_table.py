"""The table of whole frames beside path tracers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from ssgi_cl.bench import document
from ssgi_cl.bench.experiments import frame_table as module
from ssgi_cl.bench.experiments.frame_table import CASES, FIRST, FOUR, ONE, ONE_FIRST, OWN, main, nearer, told
from ssgi_cl.bench.suite import Measurements
from ssgi_cl.rasterize.scenes import VALIDATION_ROOMS
from ssgi_cl.tuning.calibration import Calibration

from .documents import entry


def frame(name: str, ms: float, flip: float | None, mottling: float = 0.04, scene: str = "hall") -> dict[str, Any]:
    result = entry(f"{name}.{scene}.8x6", ms, quantity="radiance")
    result["errors"]["world"].update(flip=flip, mottling=mottling)
    return result


RESULTS = [
    frame(OWN, 50.0, 0.1, 0.047),
    frame(FIRST, 400.0, 0.1),
    frame(ONE, 200.0, 0.14, 0.025),
    frame(ONE_FIRST, 300.0, 0.14),
    frame(FOUR, 500.0, 0.09, 0.011),
    frame("mitsuba-frame-blur.1", 49.0, 0.099),
    frame("mitsuba-frame.2", 48.0, 0.3),
    frame("mitsuba-frame.1", 20.0, 0.02),
    frame("mitsuba-frame.4", 10.0, None),
    frame("mitsuba-frame-first.1", 10.0, 0.01),  # of another scene each time: no frame of a moving camera
]


def test_peers_that_are_no_slower_and_nearer_are_named_the_fastest_first() -> None:
    found = {".".join(result["name"].split(".")[:2]): result for result in RESULTS}
    assert nearer(found) == ["mitsuba-frame.1", "mitsuba-frame-blur.1"]
    assert nearer({OWN: frame(OWN, 5.0, 0.1), ONE: found[ONE]}) == []


def test_a_row_for_each_view_has_times_and_errors() -> None:
    other = [frame(OWN, 30.0, 0.05, scene="rods-300")]
    head, _, *rows = told([*RESULTS, *other, frame(ONE, 1.0, 0.1, scene="cornell_box")]).splitlines()
    assert head.count("|") == 15
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
    times = [
        "hall",
        "400",
        "50.0",
        "0.100",
        "0.0470",
        "300",
        "200",
        "0.140",
        "0.0250",
        "500",
        "0.0900",
        "0.0110",
        "0.25",
    ]
    assert cells[0] == [*times, "mitsuba-frame.1, mitsuba-frame-blur.1"]
    assert cells[1][:5] == ["rods-300", "-", "30.0", "0.0500", "0.0400"]
    assert cells[1][-2:] == ["-", "none"]
    assert len(cells) == 2  # a view without the default frame has no row


def test_views_of_the_report_and_of_validation_are_measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[tuple[str, str]] = []

    def measure(cases: Any, views: Any, *_: Any, **__: Any) -> Measurements:
        asked.extend((f"{case.family}.{case.setting}", case.scene) for case in cases)
        found = Measurements(Calibration(1.0, 1.0, 1.0), 1.0)
        found.results = [frame(OWN, 5.0, 0.1, scene=name) for name in views]
        found.skipped = [{"name": ONE, "reason": "it is not there"}]
        return found

    monkeypatch.setattr(module.suite, "measure", measure)
    monkeypatch.setattr(module, "REPORTED", ("cornell_box",))
    shown = CliRunner().invoke(main, ("--size", "8x6", "-o", str(tmp_path / "a.json")))
    assert shown.exit_code == 0, shown.output
    assert (
        shown.output.index("## reported") < shown.output.index("| cornell_box |") < shown.output.index("## validation")
    )
    assert "skipped mitsuba-frame-oidn.1: it is not there" in shown.output
    assert {scene for _, scene in asked} == {"cornell_box", *VALIDATION_ROOMS}
    assert [name for name, scene in asked if scene == "rods-300"] == list(CASES)
    # Each family of peers that keeps its scene, with 1, 2, 4 and 8 paths.
    assert len([name for name in CASES if name.startswith("mitsuba-frame")]) == 4 * 4 + 1
    assert len(document.read(tmp_path / "a.json")["results"]) == 13
    asked.clear()
    assert CliRunner().invoke(main, ("--size", "8x6", "--few", "--scene", "rods-300")).exit_code == 0
    assert [name for name, _ in asked] == [OWN, FIRST, ONE_FIRST, ONE, FOUR]
