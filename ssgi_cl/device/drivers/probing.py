"""Devices of a driver, found and timed in processes of their own, which may die.

A failure is believed when it happens twice, and a speed when two processes agree on it. A driver
may die because memory is limited or its cache is damaged. A processor's time may come out at half
of what it was, as the system counts that of running threads late.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from ssgi_cl.device.drivers.caches import replaced_caches
from ssgi_cl.device.drivers.info import KERNEL_VARIANTS, DeviceInfo, Found
from ssgi_cl.device.drivers.pocl_cache import clear_damaged

PROBE_SECONDS = 60
"""After this long for each form, a probe counts as hung at the form that it was at."""
DOUBTFUL_SECONDS = 15
"""The same where memory or files are limited: drivers hang when they can't start their threads."""
AGREEMENT = 0.2
"""Speeds that differ from their median by more than this share of it are outliers."""
MOST_ROUNDS = 5
"""Processes that time the forms, at most; two if they agree."""
LITTLE_MEMORY = 1 << 30
"""Bytes; with less free a failure is not taken to be the driver's."""
_LAST_WORDS = 600
"""Characters of what a process that died wrote to standard error, at most."""


@dataclass(frozen=True)
class Answers:
    """The output of a probe's process, and how it ended; `ending` is empty if in order."""

    lines: list[dict[str, Any]]
    ending: str = ""


def probe(driver: Path) -> Found:
    """Time every form on every device of a driver."""
    environment = {**os.environ, **replaced_caches(), "OCL_ICD_VENDORS": str(driver)}
    listed = run_probe(environment, [])
    entries = [line for line in listed.lines if "label" in line]
    if not entries and listed.ending:
        return Found([], lasting=False, reason=f"{driver}: the driver {listed.ending}")
    devices = []
    for entry in entries:
        speeds = _timed(environment, [str(entry["platform"]), str(entry["device"])])
        devices.append(DeviceInfo(driver=str(driver), speeds=speeds, **entry))
    doubt = doubtful()
    failing = not devices or any(info.failures for info in devices)
    reasons = [f"{driver}: the driver lists no device", *(line["reason"] for line in listed.lines if "reason" in line)]
    reason = "" if devices else "; ".join([*reasons, doubt] if doubt else reasons)
    return Found(devices, lasting=not (doubt and failing), reason=reason)


def doubtful() -> str:
    """Return why a failure found now may not be the driver's; empty if nothing suggests that."""
    for name, kind in (("-v", resource.RLIMIT_AS), ("-d", resource.RLIMIT_DATA)):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            return f"memory is limited to {limit >> 20} MiB by `ulimit {name}`"
    if resource.getrlimit(resource.RLIMIT_FSIZE)[0] != resource.RLIM_INFINITY:
        return "the size of files is limited by `ulimit -f`"
    if "POCL_CACHE_DIR" in replaced_caches() or "PYOPENCL_NO_CACHE" in replaced_caches():
        return "the cache folder can't be written, or its disk is full"
    free = _free_memory()
    if free < LITTLE_MEMORY:
        return f"only {free >> 20} MiB of memory are free"
    return ""


def run_probe(environment: dict[str, str], arguments: Sequence[str]) -> Answers:
    """Run `ssgi_cl.device.probe` in a process of its own."""
    command = [sys.executable, "-m", "ssgi_cl.device.probe", *arguments]
    doubt = doubtful()
    patience = (DOUBTFUL_SECONDS if doubt else PROBE_SECONDS) * max(len(arguments) - 2, 1)
    try:
        done = subprocess.run(command, env=environment, capture_output=True, timeout=patience, check=False)
        output, errors = done.stdout, done.stderr
        ending = _ending(done.returncode)
    except subprocess.TimeoutExpired as expired:
        output, errors = expired.stdout or b"", expired.stderr or b""
        ending = f"hangs (for {patience:g} s)"
    words = errors.decode(errors="replace").strip()[-_LAST_WORDS:]
    if ending and words:
        ending += f"; it wrote: {words}"
    lines = []
    for line in output.decode(errors="replace").splitlines():
        with suppress(ValueError):  # of the driver, or cut short
            if line.startswith("{"):
                lines.append(json.loads(line))
    return Answers(lines, ending)


def consensus(rounds: Sequence[dict[str, float]]) -> dict[str, float] | None:
    """Return each form's median speed over rounds; None while they don't agree.

    They agree on a form if there are two at least and most of them lie near their median.
    """
    agreed = {}
    for variant in rounds[0]:
        speeds = [speeds[variant] for speeds in rounds if variant in speeds]
        middle = median(speeds)
        near = sum(abs(speed - middle) <= AGREEMENT * middle for speed in speeds)
        if len(speeds) < 2 or 2 * near <= len(speeds):
            return None
        agreed[variant] = round(middle, 1)
    return agreed


def _timed(environment: dict[str, str], where: list[str]) -> dict[str, float | str]:
    """Return the speed of each form, or why it does not run."""
    first = _one_round(environment, where)
    running = {variant: speed for variant, speed in first.items() if isinstance(speed, float)}
    rounds = [running]
    agreed = consensus(rounds)
    while running and agreed is None and len(rounds) < MOST_ROUNDS:
        answers = run_probe(environment, [*where, *running]).lines
        rounds.append({answer["variant"]: answer["speed"] for answer in answers if isinstance(answer["speed"], float)})
        agreed = consensus(rounds)
    if agreed is None:  # the machine is busy: the medians are the best there is
        agreed = {variant: median(speeds[variant] for speeds in rounds if variant in speeds) for variant in running}
    return first | agreed


def _one_round(environment: dict[str, str], where: list[str]) -> dict[str, float | str]:
    """Return what one process says of all forms; a form that ends two of them is left out.

    One is enough where failures are in doubt: they are not recorded anyway.
    """
    deaths: dict[str, list[str]] = {str(variant): [] for variant in KERNEL_VARIANTS}
    most = 1 if doubtful() else 2
    mended = False
    while True:
        # All the others anew: forms are only fairly timed side by side.
        asked = [variant for variant, endings in deaths.items() if len(endings) < most]
        answers = run_probe(environment, [*where, *asked]) if asked else Answers([])
        speeds = {answer["variant"]: answer["speed"] for answer in answers.lines}
        # The process died at the first form without an answer.
        missing = next((variant for variant in asked if variant not in speeds), None)
        if missing is None:
            break
        if not mended and clear_damaged():
            mended = True  # it may have died of that
            continue
        deaths[missing].append(answers.ending or "ends without a word")
    return speeds | {
        variant: f"the driver crashes or hangs on it: it {endings[-1]}"
        for variant, endings in deaths.items()
        if len(endings) == most
    }


def _ending(status: int) -> str:
    """Return how a process ended, from its exit status; empty if in order."""
    if status == 0:
        return ""
    if status < 0:
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-status).name}"
    return f"ended with status {status}"


def _free_memory() -> int:
    """Return the free memory of the machine in bytes; a lot if it can't be found out."""
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
        (free,) = (line.split()[1] for line in lines if line.startswith("MemAvailable:"))
        return int(free) << 10
    return 1 << 62
