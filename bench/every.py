"""Results of every technique on the same small inputs, so that every kernel runs."""

from __future__ import annotations

import sys
from typing import Any

from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity import gaps, surface_cells

from .calls import CALLS as TECHNIQUES
from .calls import Array, Inputs, inputs

__all__ = ["TECHNIQUES", "Array", "Inputs", "everything", "inputs", "main", "opened", "results"]


def results(given: Inputs, runtime: Runtime, names: Any = TECHNIQUES) -> dict[str, Array]:
    """Return the results under the technique's name and their number, such as "ssao 1"."""
    found = {}
    for name in names:
        for number, result in enumerate(TECHNIQUES[name](given, runtime), 1):
            found[f"{name} {number}"] = result
    return found


def opened(lanes: int, storage: str) -> Runtime:
    """Return the first device that the loader has, with one kernel variant."""
    return Runtime(DeviceInfo("", 0, 0, "the first device", "cpu", 1), KernelVariant(lanes, storage))


def everything(runtime: Runtime) -> None:
    """Run everything, as small as may be, and print its names.

    Work that is alike from turn to turn is shortened, in this process for good.
    """
    gaps.PATHS, surface_cells.FARTHEST = 64, 2.0
    given = inputs(runtime, (6, 8), 4)
    for name in TECHNIQUES:
        print(name, flush=True)
        results(given, runtime, [name])


def main(lanes: int, storage: str) -> None:
    """Run everything on the first device that the loader has.

    For tools that watch a program, such as `oclgrind python -m ssgi_cl.bench.every 1 buffer`.
    """
    everything(opened(lanes, storage))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
