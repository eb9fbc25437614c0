"""Changes that count as slower or worse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.bench.compare import Comparison, compare, error_noise, show

from .documents import entry, printed, spread, whole


def compared(old: dict[str, Any], new: dict[str, Any]) -> Comparison:
    return compare(whole(old), whole(new))


def shown(comparison: Comparison, width: int = 100) -> str:
    return printed(show, comparison, width)


def test_equal_documents_do_not_fail() -> None:
    comparison = compared(entry(), entry())
    assert not comparison.failed
    assert comparison.compared == 1
    assert not comparison.notes
    assert "1 cases compared: 0 slower, 0 errors worse" in shown(comparison)


def test_a_greater_ratio_beyond_noise_fails_and_a_lesser_does_not() -> None:
    comparison = compared(entry(ratio=spread(1.0)), entry(ratio=spread(1.2)))
    assert comparison.failed
    assert [(c.name, c.before, c.after) for c in comparison.of("slower")] == [("ssao.16.hall.8x6", 1.0, 1.2)]
    text = shown(comparison)
    assert "slower" in text
    assert "+20.0 %" in text
    back = compared(entry(ratio=spread(1.2)), entry(ratio=spread(1.0)))  # a lesser one is told and does not
    assert not back.failed
    assert len(back.of("faster")) == 1
    assert "faster" in shown(back)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (spread(1.0, 0.0), spread(1.0 / 1.09, 0.0)),  # less than 10 %
        (spread(1.0, 0.0), spread(1.09, 0.0)),
        (spread(1.0, 0.2), spread(1.3, 0.2)),  # quartiles of 1.2 and 1.04
        (spread(1.3, 0.2), spread(1.0, 0.2)),
        (spread(1.0), spread(1.0)),  # of times in ms, twice as long as the reference is
    ],
)
def test_small_changes_and_overlapping_quartiles_are_noise(old: dict[str, float], new: dict[str, float]) -> None:
    assert compared(entry(ms=1.0, ratio=old), entry(ms=2.0, ratio=new)) == Comparison(compared=1)


def test_unsteady_changes_count_beyond_their_quartiles() -> None:
    def slower(share: float) -> bool:
        after = entry(ratio=spread(2.0, share), unsteady="it jumps")
        return compared(entry(ratio=spread(1.0)), after).failed

    assert slower(0.1)
    assert not slower(0.5)


def test_a_greater_error_fails_and_a_lesser_does_not() -> None:
    worse = compared(entry(rmse=0.05), entry(rmse=0.052))
    assert worse.failed
    assert [change.what for change in worse.of("worse")] == ["RMSE, world"]
    better = compared(entry(rmse=0.052), entry(rmse=0.05))
    assert not better.failed
    assert len(better.of("better")) == 1
    assert not compared(entry(rmse=0.05), entry(rmse=0.0504)).of("worse")  # 0.8 %
    model = compared(*(entry(errors={"assumption": {"rmse": rmse, "truth_error": 0.0}}) for rmse in (0.0, 0.01)))
    assert [change.what for change in model.of("worse")] == ["RMSE, assumption"]
    assert "from 0" in shown(model)


@pytest.mark.parametrize(
    ("size", "truth_error", "excused"), [([6, 8], 0.02, True), ([600, 800], 0.02, False), ([6, 8], None, False)]
)
def test_an_inexact_truth_excuses_more_in_few_pixels_than_in_many_and_nothing_if_it_is_not_known(
    size: list[int], truth_error: float | None, excused: bool
) -> None:
    old, new = entry(rmse=0.05, size=size), entry(rmse=0.052, size=size)
    for result in (old, new):
        result["errors"]["world"]["truth_error"] = truth_error
    assert compared(old, new).failed != excused


@pytest.mark.parametrize("errors", [(0.03, 0.03), (0.03, 0.0), (0.01, 0.03)])
def test_error_noise_covers_what_truths_of_a_known_error_do(
    rng: np.random.Generator, errors: tuple[float, float]
) -> None:
    # The same result held to 300 pairs of independent truths of N = 4000 pixels.
    miss = rng.normal(0.0, 0.05, 4000)
    one, two = (np.sqrt(np.mean((miss + rng.normal(0.0, s, (300, 4000))) ** 2, axis=1)) for s in errors)
    bounds = np.array([error_noise(before, errors, 4000) for before in one])
    # Three standard deviations: 1 of 370 may exceed them, and 3 of 300 is far from that.
    assert (np.abs(two - one) > bounds).sum() < 3
    # It is no excuse for anything: twice what truths do at most is found.
    assert bounds.max() < 2.0 * np.abs(two - one).max()


def test_error_noise_of_an_exact_result_is_that_of_its_truth() -> None:
    assert error_noise(0.0, (0.0, 0.0), 100) == 0.0
    assert error_noise(0.0, (0.0, 0.04), 10**12) == pytest.approx(0.04, rel=1e-4)
    assert error_noise(1.0, (0.0, 0.0), 100) == 0.01


def test_an_error_that_is_there_once_only_is_noted() -> None:
    none = entry(errors={})
    for old, new, side in ((entry(), none, "after"), (none, entry(), "before")):
        comparison = compared(old, new)
        assert not comparison.failed
        assert f"(world) is not compared: there is none {side}" in comparison.notes[0]


def test_truths_of_other_options_are_not_compared() -> None:
    after = whole(entry(rmse=0.5, ratio=spread(3.0)))
    after["options"] = {"truth_rays": 64, "attenuation": "none", "seconds": 9.0}
    comparison = compare(whole(entry(ratio=spread(1.0))), after)
    assert not comparison.of("worse")
    assert comparison.of("slower")  # times still are
    assert comparison.notes == ["errors are not compared, the truths differ: truth_rays 512 and 64"]


def test_other_devices_are_compared_by_ratio_and_said_on_top() -> None:
    after = whole(entry())
    after["device"] = {"label": "Other 2.0: GPU", "kind": "gpu", "units": 1, "variant": "1 lane"}
    text = shown(compare(whole(entry()), after), width=300)
    assert text.startswith("note: the devices differ: Made up 1.0: CPU and Other 2.0: GPU.")
    assert "the kernel variants differ: 16 lanes and 1 lane" in text


def test_cases_that_come_and_go_are_listed_and_do_not_fail() -> None:
    before = whole(entry(), entry("b.1.hall.8x6"), entry("c.1.hall.8x6"))
    after = whole(entry(), entry("d.1.hall.8x6"), skipped=[{"name": "b.1.hall.8x6", "reason": "[b] is not installed"}])
    comparison = compare(before, after)
    assert comparison.missing == ["b.1.hall.8x6: [b] is not installed", "c.1.hall.8x6"]
    assert comparison.new == ["d.1.hall.8x6"]
    assert not comparison.failed
    assert "no longer there, so not judged: b.1.hall.8x6: [b] is not" in shown(comparison)


def test_documents_without_a_common_case_are_refused() -> None:
    with pytest.raises(ValueError, match="no case is in both, of 1 before and 0 after"):
        compare(whole(entry()), whole())
