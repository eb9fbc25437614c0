"""Look at the devices of one driver: `python -m ssgi_cl.device.probe [PLATFORM DEVICE FORM ...]`.

Without arguments it lists the devices; with them it times forms of the kernels on one device. One
JSON object a line. Run by `ssgi_cl.device.drivers.probing` in a process of its own, which a driver may
bring down.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median

from ssgi_cl.device.drivers.probe_timer import million_reads, timer
from ssgi_cl.device.opencl import described
from ssgi_cl.device.requirements import facts

REPEATS = 15
LONGEST_REASON = 4000
"""Characters of a reason why a form does not run."""


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
            entry = {"platform": p, "device": d, **described(platform, device), "facts": facts(device)}
            print(json.dumps(entry), flush=True)


def time_variants(platform: int, device: int, names: list[str]) -> None:
    """Print the speed of each named form on one device, or why it does not run.

    A form that runs gets a line at its first run and another at the end, which holds. The forms
    take turns, so that what else the machine does meets all of them alike, and the median counts.
    """
    from ssgi_cl.core.errors import SsgiError
    from ssgi_cl.device.drivers.info import KERNEL_VARIANTS, DeviceInfo
    from ssgi_cl.device.runtime import Runtime

    running: dict[str, Callable[[], float]] = {}
    for name in names:
        variant = next(variant for variant in KERNEL_VARIANTS if str(variant) == name)
        try:
            runtime = Runtime(DeviceInfo("", platform, device, "this device", "", 0), variant)
            running[name] = timer(runtime)
            speed: float | str = million_reads(running[name]())
        except SsgiError as error:
            speed = str(error)[:LONGEST_REASON]
        print(json.dumps({"variant": name, "speed": speed}), flush=True)
    taken: dict[str, list[float]] = {name: [] for name in running}
    for _ in range(REPEATS):
        for name, run in running.items():
            taken[name].append(run())
    for name, seconds in taken.items():
        print(json.dumps({"variant": name, "speed": million_reads(median(seconds))}), flush=True)


def _why_not_loaded(driver: Path) -> str:
    """Return what the system says of the library that an .icd file names; empty if it loads."""
    try:
        ctypes.CDLL(driver.read_text(encoding="utf-8").strip())
    except (OSError, UnicodeDecodeError) as error:
        return str(error)
    return ""


if __name__ == "__main__":
    if len(sys.argv) > 3:
        time_variants(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    else:
        list_devices()
