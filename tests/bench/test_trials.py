"""Trials of parameters: how what is measured becomes a time."""

from __future__ import annotations

from itertools import cycle

import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.trials import Trials


@pytest.fixture
def trials(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> Trials:
    reference = cycle([7.0, 3.0, 5.0])  # what else the machine does only slows it down
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
