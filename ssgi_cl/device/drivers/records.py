"""Records of probed devices in the cache folder: one file for a driver in a configuration.

What a driver lists depends on the machine, its cards, and variables such as POCL_DEVICES and
CUDA_VISIBLE_DEVICES. All that is cheap to find out is part of the file's name; the rest shows when
a device is opened (see `ssgi_cl.device.opencl.listed_device`), and the record is made anew.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ssgi_cl.core.atomic import replacement
from ssgi_cl.device import sources
from ssgi_cl.device.drivers.caches import cache_folder
from ssgi_cl.device.drivers.info import DeviceInfo, Found

FAILURES_HOLD_SECONDS = 24 * 3600.0
"""A record that holds a failure, or no device, is made anew after this long."""
USES_TO_CONFIRM = 3
"""The first processes that use a new record check the speed of what they use."""
_SETTINGS = re.compile(r"(POCL|CUDA|NVIDIA|HIP|ROCR|GPU|HSA|ZE|ONEAPI|SYCL|CL|OCL|RUSTICL|MESA|GALLIUM|LP|DRI)_")
"""Variables that choose or change devices."""
_NO_SETTINGS = ("POCL_CACHE_DIR", "POCL_DEBUG", "POCL_EXTRA_BUILD_FLAGS", "OCL_ICD_VENDORS")
"""Variables among them that don't, or that this library sets itself."""
_MODULES = ("../probe.py", "../requirements.py", "probe_timer.py", "probing.py", "pocl_cpu.py", "info.py")
"""Files whose text decides what a record says."""


def record_file(driver: Path) -> Path:
    """Return the file of what is known of a driver's devices as the machine is set up now."""
    about = [*_driver_description(driver), *machine_description(), *settings()]
    modules = [(Path(__file__).parent / name).read_text(encoding="utf-8") for name in _MODULES]
    parts = [str(driver), sources.flatten("probe/probe_gather.cl"), *about, *modules]
    key = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    return cache_folder() / f"devices-{key}.json"


def load(driver: Path) -> Found | None:
    """Return a driver's devices as recorded; None without a record, or if it no longer holds."""
    try:
        record = json.loads(record_file(driver).read_text(encoding="utf-8"))
        until = record["until"]
        if until is not None and not 0.0 < until - time.time() <= FAILURES_HOLD_SECONDS:
            return None
        return Found([DeviceInfo(**entry) for entry in record["devices"]], reason=record["reason"])
    except (OSError, ValueError, TypeError, KeyError):
        return None  # never probed, or a record of another version


def save(driver: Path, found: Found) -> None:
    """Record a driver's devices; for a limited time if something does not run or none was found."""
    failing = not found.devices or any(info.failures for info in found.devices)
    _write(
        driver,
        devices=[asdict(info) for info in found.devices],
        reason=found.reason,
        until=time.time() + FAILURES_HOLD_SECONDS if failing else None,
        confirmed=0,
    )


@contextmanager
def alone(driver: Path) -> Iterator[None]:
    """Let other processes that would probe the same driver wait for what this one finds."""
    path = record_file(driver).with_suffix(".lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("w")
    except OSError:
        yield  # a cache folder that can't be written: there is nothing to wait for
        return
    with file:
        with suppress(OSError):  # file systems without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def forget(driver: Path) -> None:
    """Remove a driver's record."""
    with suppress(OSError):
        record_file(driver).unlink()


def unconfirmed(driver: Path) -> bool:
    """Return whether fewer than `USES_TO_CONFIRM` processes found a recorded speed right."""
    with suppress(OSError, ValueError, TypeError, KeyError):
        text = json.loads(record_file(driver).read_text(encoding="utf-8"))
        return bool(text["confirmed"] < USES_TO_CONFIRM)
    return False


def confirm(driver: Path) -> None:
    """Note that one more process found a recorded speed right."""
    with suppress(OSError, ValueError, TypeError, KeyError):
        text = json.loads(record_file(driver).read_text(encoding="utf-8"))
        _write(driver, **{**text, "confirmed": text["confirmed"] + 1})


def settings() -> list[str]:
    """Return the variables that choose or change devices, as NAME=VALUE, sorted."""
    return sorted(
        f"{name}={value}" for name, value in os.environ.items() if _SETTINGS.match(name) and name not in _NO_SETTINGS
    )


def machine_description(root: Path = Path("/")) -> list[str]:
    """Return what tells machines apart that share a home: processors and cards.

    Args:
        root: of the file system, for tests.
    """
    facts = [str(os.cpu_count())]
    if hasattr(os, "sched_getaffinity"):
        facts.append(str(len(os.sched_getaffinity(0))))
    with suppress(OSError):
        cpuinfo = (root / "proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        facts += re.findall(r"^(?:model name|flags)\s*:.*$", cpuinfo, re.MULTILINE)[:2]
    with suppress(OSError):
        facts.append((root / "proc/driver/nvidia/version").read_text(encoding="utf-8"))
    for card in sorted((root / "sys/bus/pci/devices").glob("*")):
        with suppress(OSError):
            if (card / "class").read_text().startswith(("0x03", "0x12")):  # display, accelerator
                maker, model = ((card / name).read_text() for name in ("vendor", "device"))
                facts.append(f"{card.name} {maker.strip()} {model.strip()}")
    return facts


def _driver_description(driver: Path) -> list[str]:
    facts = []
    with suppress(OSError, UnicodeDecodeError):  # probing will tell
        text = driver.read_text(encoding="utf-8").strip()
        facts += [text, str(driver.stat().st_mtime_ns)]
        library = Path(text)
        if library.is_absolute():
            facts.append(str(library.stat().st_mtime_ns))
    for package in ("pyopencl", "pocl-binary-distribution", "intel-opencl-rt"):
        try:
            facts.append(version(package))
        except PackageNotFoundError:
            facts.append("")
    return facts


def _write(driver: Path, **text: object) -> None:
    record = record_file(driver)
    with suppress(OSError):  # a read-only home: the next process probes again
        record.parent.mkdir(parents=True, exist_ok=True)
        with replacement(record) as path:
            path.write_text(json.dumps(text, indent=1), encoding="utf-8")
