"""The second queue: what begins after what is queued before it, and what waits for it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.device.runtime import Runtime

SLOW = """__kernel void slow(__global const int *from, __global int *to, const int2 size, const int turns)
{
    const int i = (int)get_global_id(0);
    if (i >= size.x) {
        return;
    }
    uint value = (uint)from[i];
    for (int turn = 0; turn < turns; ++turn) {
        value = value * 1664525u + 1013904223u;
    }
    to[i] = (int)value;
}
"""


def expected(values: NDArray[np.int32], turns: int) -> NDArray[np.int32]:
    """What the kernel makes of values: a linear map, and powers of it."""
    factor, term, by, plus = 1, 0, 1664525, 1013904223
    while turns:
        if turns & 1:
            factor, term = factor * by % 2**32, (term * by + plus) % 2**32
        by, plus, turns = by * by % 2**32, (plus * by + plus) % 2**32, turns >> 1
    return ((values.astype(np.uint64) * factor + term) % 2**32).astype(np.uint32).view(np.int32)


def test_kernels_beside_begin_after_what_is_before_them_and_end_before_what_joins_them(runtime: Runtime) -> None:
    # Of some milliseconds each, in one work-group: another core has time for what does not wait.
    turns, values = 2_000_000, np.arange(64, dtype=np.int32)
    given, first, second, third = (runtime.array(values) for _ in range(4))
    slow = runtime.kernel_from_text("slow", SLOW)
    with runtime.frame():
        for _ in range(3):
            slow.run((1, 64), grid=(1, 64), local=(1, 64), **{"from": given}, to=first, turns=turns)
            with runtime.second.kernels() as beside:
                slow.run((1, 64), grid=(1, 64), local=(1, 64), **{"from": first}, to=second, turns=turns)
            slow.run((1, 64), grid=(1, 64), local=(1, 64), **{"from": given}, to=third, turns=1)
            beside.join()
            slow.run((1, 64), grid=(1, 64), local=(1, 64), **{"from": second}, to=third, turns=turns)
            found = third.download()
            np.testing.assert_array_equal(found, expected(values, 3 * turns))
            for each in (first, second, third):
                each.upload(values)
        assert [entry.name for entry in runtime.times()].count("slow") == 12


def test_after_a_failure_kernels_go_to_the_first_queue_again(runtime: Runtime) -> None:
    slow, values = runtime.kernel_from_text("slow", SLOW), np.arange(8, dtype=np.int32)
    given, found = runtime.array(values), runtime.array(values)

    def fail() -> None:
        with runtime.second.kernels():
            slow.run((1, 8), grid=(1, 8), **{"from": given}, to=found, turns=2_000_000)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert runtime.launching is runtime.queue
    runtime.finish()  # of both queues
    np.testing.assert_array_equal(found.download(), expected(values, 2_000_000))
