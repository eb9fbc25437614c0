"""Look at the devices of one driver: `python -m ssgi_cl.device.probe [PLATFORM DEVICE FORM ...]`.

Without arguments it lists the devices; with them it times forms of the kernels on one device. One
JSON object a line. Run by `ssgi_cl.device.probing` in a process of its own, which a driver may
bring down.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import TYPE_CHECKING

import numpy as np

from ssgi_cl.device.opencl import described

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

SIZE = (300, 400)
REPEATS = 15
SHORTEST = 1e-7
"""Seconds below which a device's clock is taken to stand still: no kernel starts so fast."""
SAMPLE = 4e-3
"""Seconds that a sample takes at least. Linux counts a thread's time when it sleeps or at the next
tick, up to 4 ms later: of a short sample half could be missing."""
LONGEST_REASON = 4000
"""Characters of a reason why a form does not run."""
_READS = SIZE[0] * SIZE[1] * 16


def list_devices() -> None:
    """Print every device that the loaded drivers have; if there is none, why, if that is known."""
    import pyopencl as cl

    try:
        platforms = cl.get_platforms()
    except cl.LogicError:  # the loader has no platform at all
        reason = _why_not_loaded(Path(os.environ.get("OCL_ICD_VENDORS", "")))
        if reason:
            print(json.dumps({"reason": reason}), flush=True)
        return
    for p, platform in enumerate(platforms):
        for d, device in enumerate(platform.get_devices()):
            entry = {"platform": p, "device": d, **described(platform, device)}
            print(json.dumps(entry), flush=True)


def time_forms(platform: int, device: int, names: list[str]) -> None:
    """Print the speed of each named form on one device, or why it does not run.

    A form that runs gets a line at its first run and another at the end, which holds. The forms
    take turns, so that what else the machine does meets all of them alike, and the median counts.
    """
    from ssgi_cl.core.errors import SsgiError
    from ssgi_cl.device.info import FORMS, DeviceInfo
    from ssgi_cl.device.runtime import Runtime

    running: dict[str, Callable[[], float]] = {}
    for name in names:
        form = next(form for form in FORMS if str(form) == name)
        try:
            runtime = Runtime(DeviceInfo("", platform, device, "this device", "", 0), form)
            running[name] = timer(runtime)
            speed: float | str = _speed(running[name]())
        except SsgiError as error:
            speed = str(error)[:LONGEST_REASON]
        print(json.dumps({"form": name, "speed": speed}), flush=True)
    taken: dict[str, list[float]] = {name: [] for name in running}
    for _ in range(REPEATS):
        for name, run in running.items():
            taken[name].append(run())
    for name, seconds in taken.items():
        print(json.dumps({"form": name, "speed": _speed(median(seconds))}), flush=True)


def speed_in_use(runtime: Runtime) -> float:
    """Return million reads a second of a runtime's form in this process; takes about 30 ms."""
    run = timer(runtime)
    return _speed(median(run() for _ in range(5)))


def _speed(seconds: float) -> float:
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
                kernel.run("probe", SIZE, depth=depth, result=result)
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


def _why_not_loaded(driver: Path) -> str:
    """Return what the system says of the library that an .icd file names; empty if it loads."""
    try:
        ctypes.CDLL(driver.read_text(encoding="utf-8").strip())
    except (OSError, UnicodeDecodeError) as error:
        return str(error)
    return ""


if __name__ == "__main__":
    if len(sys.argv) > 3:
        time_forms(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    else:
        list_devices()
