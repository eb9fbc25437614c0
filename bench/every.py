"""Results of every technique on the same small inputs, so that every kernel runs."""

from __future__ import annotations

import sys
from typing import Any

from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.runtime import Runtime

from .calls import CALLS as TECHNIQUES
from .calls import Array, Inputs, inputs

__all__ = ["TECHNIQUES", "Array", "Inputs", "inputs", "main", "results"]


def results(given: Inputs, runtime: Runtime, names: Any = TECHNIQUES) -> dict[str, Array]:
    """Return the results under the technique's name and their number, such as "ssao 1"."""
    found = {}
    for name in names:
        for number, result in enumerate(TECHNIQUES[name](given, runtime), 1):
            found[f"{name} {number}"] = result
    return found


def main(lanes: int, storage: str) -> None:
    """Run everything, as small as may be, on the first device that the loader has.

    For tools that watch a program, such as `oclgrind python -m ssgi_cl.bench.every 1 buffer`.
    """
    runtime = Runtime(DeviceInfo("", 0, 0, "the first device", "cpu", 1), KernelVariant(lanes, storage))
    given = inputs(runtime, (6, 8), 4)
    for name in TECHNIQUES:
        print(name, flush=True)
        results(given, runtime, [name])


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
