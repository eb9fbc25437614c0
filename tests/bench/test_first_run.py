"""Counted work, the times that follow from it, and the report of a first run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from ssgi_cl.bench import first_run
from ssgi_cl.bench.command import bench_command
from ssgi_cl.bench.counted_work import (
    ITEMS,
    PAGE,
    PIXELS,
    SLOW_GPU,
    Ceilings,
    Work,
    counted,
    markdown,
    parsed,
    per_item,
    predicted_ms,
)
from ssgi_cl.bench.first_run import timed
from ssgi_cl.bench.self_test import Outcome
from ssgi_cl.device import sources
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime

LOG = """
Instructions executed for kernel 'twice':
        1,000 - load private (4000 bytes)
          300 - load global (1200 bytes)
          200 - call _Z3fmafff()
          100 - fmul
          100 - br
          100 - store global (400 bytes)
           50 - load constant (200 bytes)
Instructions executed for kernel 'other':
            7 - icmp
""".splitlines()


def test_a_log_of_the_simulator_is_summed_up() -> None:
    # A fused multiply-add is two operations; private memory is none; constants are reads without traffic.
    assert list(parsed(LOG)) == [("twice", Work(500, 350, 1600)), ("other", Work(7, 0, 0))]
    launches = [("twice", 100, 1.0), ("other", 7, 3.0)]
    assert per_item(launches, LOG) == {"other": Work(1, 0, 0), "twice": Work(5, 3.5, 16)}
    with pytest.raises(ValueError, match="the log has a launch of twice: expected other"):
        per_item([("other", 100, 1.0)], LOG)


def test_launches_count_as_often_as_they_stand_for_others() -> None:
    log = "\n".join(LOG).replace("'other'", "'twice'").splitlines()
    launches = [("twice", 100, 1.0), ("twice", 7, 100.0)]
    assert per_item(launches, log) == {"twice": Work(round((500 + 700) / 800, 2), round(350 / 800, 2), 2)}
    assert per_item([(name, items, 0.0) for name, items, _ in launches], log) == {}


@pytest.mark.parametrize(
    ("work", "ms"),
    [
        (Work(1000, 0, 1), 1.0),  # 1e6 items: 1e9 operations at 1e12 a second
        (Work(1, 0, 400), 4.0),  # 4e8 bytes at 1e11 a second
        (Work(1, 0, 1), 0.01),  # as long as memory takes
        (Work(0, 0, 0), 0.005),  # a launch
    ],
)
def test_the_longest_of_computing_memory_and_launch_counts(work: Work, ms: float) -> None:
    assert predicted_ms(work, 10**6, Ceilings(gflop_s=1000.0, gb_s=100.0)) == pytest.approx(ms)


def test_work_is_counted_of_kernels_that_are_there() -> None:
    names = {Path(path).stem for path in sources.kernel_names()}
    assert set(counted()) <= names
    assert {"gtao", "hbao", "bitmask_ao", "ssao", "rsm_gather_same", "shade_light"} <= set(counted())


WATCHDOG_MS = 2000.0


def test_no_launch_of_a_pixel_each_outlasts_a_displays_watchdog() -> None:
    items = {name: ITEMS.get(name, PIXELS) for name in counted()}
    # By bytes as if nothing were cached, and by a work-item a pixel, where it has one for each point of few pixels.
    assert max(predicted_ms(work, items[name], SLOW_GPU) for name, work in counted().items()) < WATCHDOG_MS
    computing = {name: items[name] * work.operations / (1e6 * SLOW_GPU.gflop_s) for name, work in counted().items()}
    assert max(computing.values()) < 0.1 * WATCHDOG_MS


def test_the_page_has_the_counted_work() -> None:
    assert markdown() in PAGE.read_text("utf-8")


def test_kernels_are_summed_over_launches_and_the_median_of_frames_counts() -> None:
    name, other = "gtao", "no such kernel"
    frames = [
        [PassTime(name, ms, items=10), PassTime(name, 1.0, items=30), PassTime(other, 0.5, items=5)]
        for ms in (1.0, 9.0, 2.0)
    ]
    ceilings = Ceilings(1e-3, 1e9, 0.0)
    first, last = timed(frames, ceilings)
    assert (first.name, first.launches, first.ms) == (name, 2, 3.0)
    assert first.predicted == pytest.approx(1e-3 * counted()[name].operations * 40)
    assert (last.name, last.predicted) == (other, None)


def test_a_report_has_agreement_and_times(runtime: Runtime, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bad = Outcome("ssao", (3.0, 0.5))
    monkeypatch.setattr(first_run, "self_test", lambda *_: [Outcome("gtao"), bad])
    monkeypatch.setattr(first_run, "FRAMES", 1)
    arguments = ["--report", "--size", "64x48", "-o", str(tmp_path / "a.json"), "--markdown", str(tmp_path / "a.md")]
    result = CliRunner().invoke(bench_command, arguments)
    assert result.exit_code == 1, result.output  # a technique differs
    page = (tmp_path / "a.md").read_text("utf-8")
    assert result.stdout == page
    for words in (runtime.info.label, "1 of 2 techniques have the same bits", "ssao: beyond 0.001", "| gtao | 1 |"):
        assert words in page
    found = json.loads((tmp_path / "a.json").read_text("utf-8"))
    assert found["size"] == [48, 64]
    rendered = {each["name"]: each["ms"] for each in found["techniques"]["render"]}
    assert rendered["raster_tiles"] > 0.0  # each view is another one
    assert rendered["shade_list"] > 0.0
    (gtao,) = (each for each in found["techniques"]["gtao"] if each["name"] == "gtao")
    assert gtao["ms"] > 0.0
    assert gtao["predicted"] > 0.0
