"""The table of agreement: what counts as the same, as close, and as a failure."""

from __future__ import annotations

import numpy as np

from ssgi_cl.bench.every import TECHNIQUES
from ssgi_cl.bench.experiments.agreement import Run, fits, report, runs
from ssgi_cl.bench.self_test import NOT_IN_TIME, TOLERANCE
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant

ONE = [np.linspace(0.5, 1.5, 10)]

SLOW = DeviceInfo("", 0, 0, "B 2: chip", "cpu", 2, {"1 lane, buffer": 1.0})
BROKEN = DeviceInfo("", 0, 0, "C 3: chip", "cpu", 2, {"1 lane, buffer": "it crashes"})
FAST = DeviceInfo(
    "", 0, 0, "A 1: chip", "cpu", 2, {"1 lane, image": "no images", "1 lane, buffer": 2.0, "8 lanes, buffer": 9.0}
)


def test_one_device_has_to_give_bit_identical_results_and_others_nearly() -> None:
    near, far = [ONE[0] + 0.5 * TOLERANCE], [ONE[0] + 2.0 * TOLERANCE]
    assert fits(ONE, ONE, same=True) == ("same", True)
    assert not fits(ONE, near, same=True)[1]
    assert fits(ONE, near, same=False)[1]
    assert not fits(ONE, far, same=False)[1]
    assert fits(ONE, "KernelBuildError", same=False) == ("KernelBuildError", False)
    assert fits(ONE, NOT_IN_TIME, same=False) == (NOT_IN_TIME, True)


def test_the_first_device_runs_in_all_forms_and_the_others_in_their_own() -> None:
    made = runs([FAST, SLOW, BROKEN])
    assert [(run.title, run.device, run.single) for run in made] == [
        ("A 1, 8 lanes, buffer", FAST.label, False),
        ("again, one thread", FAST.label, True),
        ("1 lane, buffer", FAST.label, False),
        ("B 2, 1 lane, buffer", SLOW.label, False),
    ]


def test_the_page_has_a_row_for_each_technique_and_marks_what_is_off() -> None:
    first, second = (Run(title, title, KernelVariant(1, "buffer")) for title in "AB")
    good = dict.fromkeys(TECHNIQUES, ONE)
    page, fine = report([(first, good), (second, good)])
    assert fine
    assert page.count("| same |") == len(TECHNIQUES)
    page, fine = report([(first, good), (second, {**good, "ssao": "the process died"})])
    assert not fine
    assert "| ssao | **the process died** |" in page
