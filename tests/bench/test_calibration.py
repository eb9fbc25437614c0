"""The device's ceilings."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.tuning.calibration import GATHERS, REACH_LOG2, Calibration, GatherLoad


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
