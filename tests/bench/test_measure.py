"""Timing: medians, quartiles, ratios to the reference, what is not to be relied on, and a device's ceilings."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import numpy as np
import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.tuning import measure
from ssgi_cl.tuning.calibration import GATHERS, REACH_LOG2, Calibration, GatherLoad
from ssgi_cl.tuning.case import Subject
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.measure import Spread, Stopwatch, busyness, disagreement
from ssgi_cl.tuning.trials import Trials


def test_times_have_a_spread_and_tell_of_halves_that_disagree_and_of_a_busy_machine() -> None:
    assert Spread.of([5.0, 1.0, 2.0, 4.0, 3.0]) == Spread(median=3.0, low=2.0, high=4.0)
    assert disagreement([0.0, 0.0, 0.0, 0.0]) == ""  # kept frames
    assert disagreement([1.0, 1.05, 1.1, 1.05]) == ""
    assert "21 %" in disagreement([1.0, 1.0, 1.21, 1.21])
    assert "100 %" in disagreement([2.0, 2.0, 1.0, 1.0])
    assert busyness([1.0, 1.2, 1.29], 1.0) == ""
    assert "1.8 times" in busyness([1.0, 1.8, 9.0], 1.0)


def test_a_short_subject_is_repeated_within_a_run_and_its_time_is_that_of_one(runtime: Runtime) -> None:
    calls = []

    def run() -> None:
        calls.append(1)
        time.sleep(0.0002)

    watch = Stopwatch(runtime, runs=4)
    watch.reference_ms = [100.0]  # a long one, lest a sleep takes longer
    timing = watch.time(Subject(run=run, on_device=False))
    assert 0.2 <= timing.wall_ms.low < 20.0  # a sleep is never shorter, and on a busy machine hardly so much longer
    assert timing.device_ms is None
    assert timing.passes == {}
    assert len(calls) > measure.WARM_UP + measure.TRIES * 4


@pytest.mark.slow
def test_the_reference_measured_against_itself_has_the_ratio_one(runtime: Runtime) -> None:
    timing = Stopwatch(runtime, runs=20).time(Subject(run=GatherLoad(runtime).run))
    # On a quiet machine within 2 %; other programs may take a core from one and not the other.
    assert 0.5 < timing.ratio.median < 2.0
    assert timing.runs == 20
    assert list(timing.passes) == ["calibrate_gather"]
    assert timing.device_ms is not None
    assert timing.device_ms.low <= timing.device_ms.median <= timing.device_ms.high


@pytest.mark.parametrize("on_device", [True, False])
def test_the_ratio_is_of_wall_times_whoever_does_the_work(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, on_device: bool
) -> None:
    subject = Subject(run=lambda: None, on_device=on_device)
    # (device's clock, wall clock): the reference's are 3 and 4 ms, the subject's 1 and 8.
    monkeypatch.setattr(
        Stopwatch, "_once", lambda self, of, repeats=1: ((1.0, 8.0) if of is subject else (3.0, 4.0)) + ({}, {})
    )
    watch = Stopwatch(runtime, runs=4)
    timing = watch.time(subject)
    assert timing.ratio.median == 2.0
    assert timing.wall_ms.median == 8.0
    assert watch.reference_ms[0] == 4.0
    assert (timing.device_ms and timing.device_ms.median) == (1.0 if on_device else None)


def test_set_up_comes_before_each_run_and_is_not_timed(runtime: Runtime) -> None:
    done = []

    def setup() -> None:
        done.append("setup")
        time.sleep(0.05)

    subject = Subject(run=lambda: done.append("run"), setup=setup, on_device=False)
    timing = Stopwatch(runtime, runs=4).time(subject)
    assert done == ["setup", "run"] * (len(done) // 2)
    assert timing.wall_ms.median < 25.0


def test_passes_of_one_name_add_up_and_what_the_host_does_between_them_counts(runtime: Runtime) -> None:
    load = GatherLoad(runtime)

    def run() -> None:
        load.run()
        time.sleep(0.05)
        load.run()
        runtime.skip("blur", "radius 0")

    watch = Stopwatch(runtime, runs=4)
    timing = watch.time(Subject(run=run))
    assert timing.wall_ms.low >= 50.0
    # All its parts: the passes take at most as long as two of the reference, less than the sleep on
    # any machine but a busy one, whose reference is as slow.
    assert timing.ratio.median > 50.0 / max(watch.reference_ms) / 2.0
    assert timing.skipped == {"blur": "radius 0"}
    assert timing.device_ms is not None
    # All of the device's time is one pass; both are medians of the same sums.
    assert timing.passes == {"calibrate_gather": pytest.approx(timing.device_ms.median, rel=1e-6)}


def clocked(monkeypatch: pytest.MonkeyPatch, took: Callable[[Subject], float]) -> list[str]:
    """Have a function tell the milliseconds of each run; return the notes of those that ran, but for references."""
    ran: list[str] = []

    def once(self: Stopwatch, subject: Subject, repeats: int = 1) -> tuple[float, float, dict[str, float], object]:
        if not subject.on_device:
            ran.append(subject.note)
        ms = took(subject)
        return ms, ms, {}, {}

    monkeypatch.setattr(Stopwatch, "_once", once)
    return ran


def test_what_drifts_is_measured_again_and_then_called_unsteady(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    growing = itertools.count(1.0)
    # The reference takes 1 ms each time, the subject a millisecond more from run to run.
    clocked(monkeypatch, lambda subject: 1.0 if subject.on_device else next(growing))
    timing = Stopwatch(runtime, runs=4).time(Subject(run=lambda: None, on_device=False))
    # Third try: runs 11 to 14, so that the halves' medians are 11.5 and 13.5.
    assert timing.unsteady == "its two halves differ by 17 % in the ratio to the reference"
    assert next(growing) == 1.0 + measure.WARM_UP + 4 * measure.TRIES


def test_the_second_half_of_the_runs_takes_what_is_made_anew(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    first = Subject(run=lambda: None, on_device=False, note="first")
    second = Subject(run=lambda: None, on_device=False, note="second")
    ran = clocked(monkeypatch, lambda subject: 2.0 if subject.note == "second" else 1.0)
    timing = Stopwatch(runtime, runs=6).time(first, lambda: second)
    warm_up = measure.WARM_UP
    once_through = ["second"] * warm_up + ["first"] * 3 + ["second"] * 3
    assert ran == ["first"] * warm_up + once_through * measure.TRIES
    assert "100 %" in timing.unsteady


def test_a_subject_of_seconds_is_run_once_and_then_measured_four_times(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = clocked(monkeypatch, lambda subject: 1.0 if subject.on_device else 2000.0)
    subject = Subject(run=lambda: None, on_device=False, note="first")
    timing = Stopwatch(runtime).time(subject, lambda: Subject(run=lambda: None, note="second"))
    assert ran == ["first"] * (1 + measure.LONG_RUNS)
    assert timing.runs == measure.LONG_RUNS
    assert timing.unsteady == ""


@pytest.mark.slow
def test_a_slow_subject_is_repeated_less_often_but_often_enough(runtime: Runtime) -> None:
    slow = Stopwatch(runtime, seconds=0.01).time(Subject(run=lambda: time.sleep(0.02), on_device=False))
    assert slow.runs == measure.FEWEST
    fast = Stopwatch(runtime, seconds=5.0).time(Subject(run=lambda: None, on_device=False))
    assert fast.runs == measure.MOST
    assert np.isfinite(fast.ratio.median)


@pytest.mark.slow  # a second for each form, and more on images
def test_ceilings_are_those_of_a_machine(variant_runtime: Runtime) -> None:
    found = Calibration.of(variant_runtime)
    # Wide: from a small board's single core to the largest GPU.
    assert 0.1 < found.bandwidth_gb_s < 2e4
    assert 0.01 < found.gathers_g_s < 2e4
    assert 0.1 < found.multiply_adds_gflop_s < 2e5


def test_scattered_reads_sum_what_they_should(variant_runtime: Runtime) -> None:
    load = GatherLoad(variant_runtime)
    with variant_runtime.frame():
        load.run()
    values = load._source.download()[0]
    steps = load._steps.download()
    reach = 1 << REACH_LOG2
    lanes = variant_runtime.variant.lanes
    rows, columns = load.size
    for y, x in ((100, 208), (301, 37), (200, 463)):
        first = min(max(x // lanes * lanes, reach), columns - reach - lanes)
        own, lane = first + x % lanes, (first & 15) + x % lanes
        assert reach <= y < rows - reach
        expected = sum(values[y + steps[32 * i + 16 + lane], own + steps[32 * i + lane]] for i in range(GATHERS))
        # 64 numbers below 1 in float32: each partial sum rounds by 2^-19 at most.
        np.testing.assert_allclose(load._sum.download()[0, y, x], expected, atol=64 * 2.0**-19)


@pytest.fixture
def trials(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> Trials:
    reference = itertools.cycle([7.0, 3.0, 5.0])  # what else the machine does only slows it down
    monkeypatch.setattr(Trials, "_device_ms", lambda self, run: next(reference))
    return Trials(TECHNIQUES["ssao"], [Context(runtime, cornell_box(), (24, 32)) for _ in range(2)], {}, "rmse")


def test_time_is_the_median_ratio_to_the_reference_beside(trials: Trials, monkeypatch: pytest.MonkeyPatch) -> None:
    # Reference and subject by turns: ratios 2, 3 and 4.
    times = iter([10.0, 20.0, 10.0, 30.0, 10.0, 40.0, 10.0, 90.0])
    monkeypatch.setattr(Trials, "_device_ms", lambda self, run: next(times))
    # The least time of the reference turns a ratio into ms; both views together, told for each.
    assert trials._device_ms_of(lambda: None, most=3, enough_ms=1e9) == 3.0 * 3.0 / 2.0
    assert next(times) == 10.0  # no more repetitions than asked for


def test_repetitions_end_when_they_took_enough(trials: Trials, monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[object] = []
    monkeypatch.setattr(Trials, "_device_ms", lambda self, run: (runs.append(run), 10.0)[1])
    for fewest, enough_ms, count in ((1, 25.0, 3), (5, 25.0, 5), (1, 0.0, 1)):
        runs.clear()
        trials._device_ms_of(lambda: None, most=9, enough_ms=enough_ms, fewest=fewest)
        assert len(runs) == 2 * count  # as many of the reference
