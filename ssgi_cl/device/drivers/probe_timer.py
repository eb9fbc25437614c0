"""Speed of a device: the timing of the probe, in a process of its own or where it is used."""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import median
from time import perf_counter, process_time
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

SIZE = (300, 400)
SHORTEST = 1e-7
"""Seconds below which a device's clock is taken to stand still: no kernel starts so fast."""
SAMPLE = 4e-3
"""Seconds that a sample takes at least. Linux counts a thread's time when it sleeps or at the next
tick, up to 4 ms later: of a short sample half could be missing."""
_READS = SIZE[0] * SIZE[1] * 16


def speed_in_use(runtime: Runtime) -> float:
    """Return million reads a second of a runtime's form in this process; takes about 30 ms."""
    run = timer(runtime)
    return million_reads(median(run() for _ in range(5)))


def million_reads(seconds: float) -> float:
    """Return million reads per second."""
    return round(_READS / seconds / 1e6, 1)


def timer(runtime: Runtime) -> Callable[[], float]:
    """Return a function that runs the probe some times and returns the seconds that one took.

    On a processor they are its time spent on this process over the device's units: what the clock
    would show if nothing else ran. On others, the device's own clock counts, or the host's where a
    driver's stands still.
    """
    import pyopencl as cl

    kernel = runtime.kernel("probe/probe_gather.cl")
    depth = runtime.plane(1, SIZE)
    depth.upload(np.ones((1, *SIZE), np.float32))
    result = runtime.plane(1, SIZE)
    is_processor = bool(runtime.device.type & cl.device_type.CPU)

    def run(count: int) -> float:
        runtime.finish()
        with runtime.frame():
            began, start = perf_counter(), process_time()
            for _ in range(count):
                kernel.run(SIZE, depth=depth, result=result)
            runtime.finish()
            spent, passed = process_time() - start, perf_counter() - began
            seconds = runtime.times()[-1].ms * 1e-3  # the last pass: after a copy to an image
        if is_processor and spent:
            units: int = runtime.device.max_compute_units
            return spent / units / count
        return seconds if seconds > SHORTEST else passed / count

    run(1)  # compiles what is left to compile, and copies to an image
    count = min(max(math.ceil(SAMPLE / run(1)), 1), 100)
    return lambda: run(count)
