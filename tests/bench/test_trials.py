"""Trials of parameters: how what is measured becomes a time."""

from __future__ import annotations

from itertools import cycle

import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.trials import Trials


def test_ratios_are_to_the_least_time_of_the_reference(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = cycle([7.0, 3.0, 5.0])  # what else the machine does only slows it down
    monkeypatch.setattr(Trials, "_device_ms", lambda self, run: next(times))
    contexts = [Context(runtime, cornell_box(), (24, 32)) for _ in range(2)]
    trials = Trials(TECHNIQUES["ssao"], contexts, {}, "rmse")
    assert trials._ms(4.0) == 4.0 * 3.0 / 2.0  # of both views together; told for each
