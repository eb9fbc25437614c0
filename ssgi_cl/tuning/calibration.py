"""Ceilings of a device, and the load beside which cases are timed."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime

COPY_SIZE = (4096, 4096)
"""Of the copied plane: 64 MiB, more than caches hold."""
GATHER_SIZE = (512, 512)
GATHERS = 64
REACH_LOG2 = 4
"""Of scattered reads: within 16 pixels either way, as an occlusion kernel's mostly are."""
ADD_SIZE = (256, 1024)
ADD_STEPS = 128
RUNS = 9


@dataclass(frozen=True)
class Calibration:
    """A device's ceilings, measured.

    Attributes:
        bandwidth_gb_s: memory read and written by a copy, 1e9 bytes a second.
        gathers_g_s: scattered reads of 4 bytes, 1e9 a second.
        multiply_adds_gflop_s: arithmetic, two operations to each fused multiply-add.
    """

    bandwidth_gb_s: float
    gathers_g_s: float
    multiply_adds_gflop_s: float

    @classmethod
    def of(cls, runtime: Runtime) -> Calibration:
        """Measure them: less than a second on a CPU."""
        pixels = COPY_SIZE[0] * COPY_SIZE[1]
        source, copy = runtime.plane(1, COPY_SIZE), runtime.plane(1, COPY_SIZE)
        kernel = runtime.kernel("calibrate/calibrate_copy.cl")
        copying = _fastest_ms(runtime, lambda: kernel.run(COPY_SIZE, source=source, copy=copy))
        gathers = GatherLoad(runtime)
        gathering = _fastest_ms(runtime, gathers.run)
        adds = runtime.kernel("calibrate/calibrate_multiply_add.cl", {"CALIBRATE_STEPS": ADD_STEPS})
        numbers, result = runtime.plane(1, ADD_SIZE), runtime.plane(1, ADD_SIZE)
        numbers.upload(np.full((1, *ADD_SIZE), 0.25, np.float32))
        adding = _fastest_ms(runtime, lambda: adds.run(ADD_SIZE, source=numbers, result=result))
        return cls(
            bandwidth_gb_s=8e-6 * pixels / copying,
            gathers_g_s=1e-6 * gathers.reads / gathering,
            multiply_adds_gflop_s=16e-6 * ADD_STEPS * ADD_SIZE[0] * ADD_SIZE[1] / adding,
        )


class GatherLoad:
    """Scattered reads on a fixed image: the work beside which every case is timed.

    What slows the machine down for a while slows both, so that the ratio of times stays.
    """

    name = "gathers"
    size: Size = GATHER_SIZE
    reads = GATHER_SIZE[0] * GATHER_SIZE[1] * GATHERS

    def __init__(self, runtime: Runtime) -> None:
        self._kernel = runtime.kernel(
            "calibrate/calibrate_gather.cl", {"CALIBRATE_GATHERS": GATHERS, "CALIBRATE_REACH": REACH_LOG2}
        )
        rng = np.random.default_rng(1)
        reach = 1 << REACH_LOG2
        # Lanes of a piece that begins at an odd place read on into the next line.
        steps = rng.integers(-reach, reach + 1, (GATHERS * 32 + 16), dtype=np.int32)
        self._steps = runtime.array(steps)
        self._source = runtime.plane(1, self.size)
        self._source.upload(rng.random((1, *self.size), np.float32))
        self._sum = runtime.plane(1, self.size)

    def run(self) -> None:
        """Queue it."""
        self._kernel.run(self.size, source=self._source, steps=self._steps, sum=self._sum)


def _fastest_ms(runtime: Runtime, run: Callable[[], object]) -> float:
    """Return the median time of the faster half of some runs: what else runs only slows down."""
    times = []
    for _ in range(RUNS):
        with runtime.frame():
            run()
            times.append(sum(p.ms for p in runtime.times()))
    return statistics.median(sorted(times)[: RUNS // 2 + 1])
