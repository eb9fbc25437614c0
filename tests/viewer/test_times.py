"""The reach of the window: what `bench.experiments.window` measures, with room for busy machines."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from ssgi_cl.bench.experiments import window
from ssgi_cl.bench.experiments.window import Stand


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    stand = Stand("cornell_box")
    stand.rest()
    yield stand
    stand.loop.end()


@pytest.mark.slow
def test_the_hundreds_of_random_changes_do_not_fail_or_fill_memory(stand: Stand) -> None:
    window.moving(stand, 20)
    found = window.random_changes(stand, 300)
    assert found["errors"] == []
    resident, device = found["resident MiB every 50 moves"], found["device MiB every 50 moves"]
    # The first fifty prepare sizes and programs. A picture of 640 x 400 is 3 MiB as numbers: a leak of one a change
    # would be 700 MiB.
    assert resident[-1] - resident[0] < 100
    assert device[-1] - device[0] < 50


@pytest.mark.slow
def test_sliders_are_answered(stand: Stand) -> None:
    found = window.sliders(stand, 3, lights=False)
    for name, times in found.items():
        assert times["median ms"] < 1500.0, name  # a tenth of that on an idle machine
