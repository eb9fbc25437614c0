"""Look at the devices of one driver: `python -m ssgi_cl.probe [PLATFORM DEVICE FORM ...]`.

Without arguments it lists the devices; with them it times forms of the kernels on one device. One
JSON object a line. Run by `ssgi_cl.drivers` in a process of its own, which a driver may bring down.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from time import perf_counter, process_time
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ssgi_cl.runtime import Runtime

SIZE = (300, 400)
REPEATS = 15
SHORTEST = 1e-7
"""Seconds below which a device's clock is taken to stand still: no kernel starts so fast."""
_READS = SIZE[0] * SIZE[1] * 16


def list_devices() -> None:
    """Print every device that the loaded drivers have."""
    import pyopencl as cl

    try:
        platforms = cl.get_platforms()
    except cl.LogicError:
        return  # the loader has no platform at all
    for p, platform in enumerate(platforms):
        for d, device in enumerate(platform.get_devices()):
            name = "PoCL" if "pocl" in platform.version.lower() else platform.name.strip()
            kind = device.type
            entry = {
                "platform": p,
                "device": d,
                "label": f"{name} {device.driver_version}: {device.name.strip()}",
                "kind": "cpu"
                if kind & cl.device_type.CPU
                else "gpu"
                if kind & cl.device_type.GPU
                else "accelerator",
                "units": device.max_compute_units,
            }
            print(json.dumps(entry), flush=True)


def time_forms(platform: int, device: int, names: list[str]) -> None:
    """Print the speed of each named form on one device, or why it does not run.

    A form that runs gets a line at its first run and another at the end, which holds. The forms
    take turns, so that what else the machine does meets all of them alike.
    """
    from ssgi_cl.drivers import FORMS, DeviceInfo
    from ssgi_cl.errors import SsgiError
    from ssgi_cl.runtime import Runtime

    running: dict[str, Callable[[], float]] = {}
    least: dict[str, float] = {}
    for name in names:
        form = next(form for form in FORMS if str(form) == name)
        try:
            runtime = Runtime(DeviceInfo("", platform, device, "this device", "", 0), form)
            running[name] = _timed(runtime)
            least[name] = running[name]()
            speed: float | str = _speed(least[name])
        except SsgiError as error:
            speed = str(error).splitlines()[0]
        print(json.dumps({"form": name, "speed": speed}), flush=True)
    for _ in range(REPEATS):
        for name, run in running.items():
            # The fastest run: what else the machine does only ever slows one down.
            least[name] = min(least[name], run())
    for name, seconds in least.items():
        print(json.dumps({"form": name, "speed": _speed(seconds)}), flush=True)


def _speed(seconds: float) -> float:
    """Return million reads per second."""
    return round(_READS / seconds / 1e6, 1)


def _timed(runtime: Runtime) -> Callable[[], float]:
    """Return a function that runs the probe once and returns its seconds.

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

    def run() -> float:
        runtime.finish()
        with runtime.frame():
            began, start = perf_counter(), process_time()
            kernel.run("probe", SIZE, reads=[depth], writes=[result])
            runtime.finish()
            spent, passed = process_time() - start, perf_counter() - began
            seconds = runtime.times()[-1].ms * 1e-3  # the last pass: after a copy to an image
        if is_processor and spent:
            units: int = runtime.device.max_compute_units
            return spent / units
        return seconds if seconds > SHORTEST else passed

    run()  # compiles what is left to compile, and copies to an image
    return run


if __name__ == "__main__":
    if len(sys.argv) > 3:
        time_forms(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    else:
        list_devices()
