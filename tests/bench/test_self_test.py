"""The self-test: what is stored, what counts as agreement, processes that die or take too long."""

from __future__ import annotations

import pickle
import signal
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.bench import self_test
from ssgi_cl.bench.every import TECHNIQUES, inputs, results
from ssgi_cl.bench.self_test import NOT_IN_TIME, SIZE, TEXELS, TOLERANCE, Outcome, computed, difference, stored
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.runtime import Runtime

ONE = [np.linspace(0.5, 1.5, 10)]


def test_differences_are_relative_to_the_mean_and_none_for_bit_identical_results() -> None:
    assert difference(ONE, ONE) is None
    other = [ONE[0].copy()]
    other[0][3] += 0.5
    assert difference(ONE, other) == (0.5, 0.05)


def test_what_is_stored_is_what_every_technique_makes(runtime: Runtime) -> None:
    wanted = stored()
    assert set(wanted) == set(TECHNIQUES)
    given = inputs(runtime, SIZE, TEXELS)
    for name in TECHNIQUES:
        made = list(results(given, runtime, [name]).values())
        # Processors give the same bits: see docs/agreement.md. Changed on purpose? `self_test --record` stores anew.
        assert difference(wanted[name], made) is None, name


@pytest.mark.parametrize(
    ("change", "good", "said"),
    [
        (0.0, True, "same bits"),
        (0.5 * TOLERANCE, True, "within 0.001: mean 5.0e-04, largest 5.0e-04"),
        (2.0 * TOLERANCE, False, "beyond 0.001: mean 2.0e-03, largest 2.0e-03"),
        (np.nan, False, "results are not finite"),
    ],
)
def test_results_within_the_tolerance_are_good(change: float, good: bool, said: str) -> None:
    outcome = self_test._outcome("ssao", ONE, [ONE[0] + change])
    assert (outcome.good, str(outcome)) == (good, said)


def test_what_is_missing_is_a_problem_and_what_was_not_in_time_is_not() -> None:
    assert not Outcome("ssao", problem="the process died (-11)").good
    assert Outcome("ssao", problem=NOT_IN_TIME).good
    assert not self_test._outcome("ssao", ONE, [ONE[0][:5]]).good


def test_what_a_process_ends_at_is_left_out_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    codes = iter((-signal.SIGXCPU, -signal.SIGSEGV, 0))

    def ended(*_: object) -> int:
        code, left = next(codes), self_test._left(tmp_path)
        for name in left[: 2 if code else None]:
            self_test._path(tmp_path, name).write_bytes(pickle.dumps(ONE))
        return code

    monkeypatch.setattr(self_test, "_ended", ended)
    found = computed(tmp_path, "A", KernelVariant(1, "buffer"), SIZE)
    whys = [result for result in found.values() if isinstance(result, str)]
    assert whys == [NOT_IN_TIME, "the process died (-11)"]
    assert (found[list(TECHNIQUES)[2]], len(found)) == (NOT_IN_TIME, len(TECHNIQUES))
    assert list(tmp_path.iterdir()) == []


def test_a_driver_that_hangs_is_killed_in_time(tmp_path: Path) -> None:
    # No process starts within no time at all.
    found = computed(tmp_path, "A", KernelVariant(1, "buffer"), SIZE, seconds=0.0)
    assert set(found.values()) == {NOT_IN_TIME}
