"""OpenCL drivers and devices: what is installed, and which build of the kernels suits each device.

Two drivers that carry their own LLVM can clash in one process (two versions of PoCL, or PoCL and
Intel's runtime), so devices are looked at in processes of their own, one for each driver, and only
the driver that is asked for is loaded. What was found is kept in the user's cache folder.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device.drivers import probing, records
from ssgi_cl.device.drivers.caches import cache_folder
from ssgi_cl.device.drivers.info import KERNEL_VARIANTS, DeviceInfo, Found, KernelVariant

__all__ = [
    "INSTALL",
    "KERNEL_VARIANTS",
    "DeviceInfo",
    "KernelVariant",
    "cache_folder",
    "choose",
    "confirm",
    "devices",
    "driver_files",
    "look_again",
    "problems",
    "standing",
]

INSTALL = (
    "Install a driver, for example: pip install 'ssgi-cl[pocl]', for processors of x86-64; where "
    "that does not run, pip install 'ssgi-cl[intel]', or Debian's package pocl-opencl-icd, or the "
    "driver of your graphics card"
)
SLOWER_THAN_RECORDED = 0.67
"""A speed in use below this share of the recorded one shows that the record is wrong."""


def driver_files() -> list[Path]:
    """Return the .icd files of the installed drivers.

    They are those of the system, those of the Python environment (Intel's runtime from PyPI, or
    packages of conda) and PyOpenCL's own. The variable OCL_ICD_VENDORS, if set by the user, names
    the only folder or file to look at.
    """
    asked = os.environ.get("OCL_ICD_VENDORS")
    if asked:
        path = Path(asked)
        return sorted(path.glob("*.icd")) if path.is_dir() else [path]
    found = sorted(Path("/etc/OpenCL/vendors").glob("*.icd"))
    for path in sorted((Path(sys.prefix) / "etc" / "OpenCL" / "vendors").glob("*.icd")):
        found += _in_environment(path)
    package = find_spec("pyopencl")
    if package and package.origin:
        found += sorted((Path(package.origin).parent / ".libs").glob("*.icd"))
    return found


def _in_environment(path: Path) -> list[Path]:
    """Return an .icd file of the Python environment, corrected if need be; none if of no library.

    Wheels can't write where they are installed into their files: the one of Intel's runtime names
    its library in a folder of the machine that it was built on. It lies in the environment's lib.
    """
    try:
        named = Path(path.read_text(encoding="utf-8").strip())
        if not named.is_absolute() or named.exists():
            return [path]
        library = path.parents[3] / "lib" / named.name
        if not library.exists():
            return []
        text = f"{library}\n"
        key = hashlib.sha256(text.encode()).hexdigest()[:8]
        corrected = cache_folder() / "drivers" / f"{path.stem}-{key}.icd"
        if not corrected.exists():
            corrected.parent.mkdir(parents=True, exist_ok=True)
            with replacement(corrected) as file:
                file.write_text(text, encoding="utf-8")
        return [corrected]
    except (OSError, UnicodeDecodeError):
        return []


@cache
def devices() -> tuple[DeviceInfo, ...]:
    """Return every device of every installed driver; those not seen before are timed first."""
    return tuple(info for path in driver_files() for info in _looked_at(path).devices)


_forget_devices = devices.cache_clear


def problems() -> list[str]:
    """Return why drivers list no device, one entry for each of those."""
    return [found.reason for path in driver_files() if (found := _looked_at(path)).reason]


def choose(name: str | None, loaded: str | None = None) -> DeviceInfo:
    """Return the fastest device whose label holds every word of `name` (any device if None).

    Args:
        name: words of the label.
        loaded: the driver that this process uses, whose devices come before all others: a record that
            is made anew may rank drivers otherwise.

    Raises:
        DeviceError: none fits; the message lists what there is, why it does not run, the file that
            this is recorded in, and what may be installed.
    """
    found = devices()
    words = (name or "").lower().replace(":", " ").split()
    fitting = [info for info in found if all(word in info.label.lower() for word in words)]
    usable = [info for info in fitting if info.best is not None]
    if usable:
        return max(usable, key=lambda info: (info.driver == loaded, info.speed))
    lines = [f"  {info.label}" for info in found] or ["  none"]
    if not found:
        lines += [f"  {reason}" for reason in problems()]
    for info in fitting:
        variant, why = next(iter(info.failures.items()), ("no form", "not tried"))
        lines += [f"{info.label}, {variant}: {why.strip()}", standing(info)]
    if not any(info.best for info in found):
        lines.append(INSTALL)
    why = "no kernel runs on it" if fitting else "no such OpenCL device"
    raise DeviceError(f"{name or 'any device'}: {why}. Devices found:\n" + "\n".join(lines))


def standing(info: DeviceInfo) -> str:
    """Return for how long a device's failures are taken as given, and how to try again."""
    driver = Path(info.driver)
    if records.load(driver) is None:
        return f"This is not recorded, and tried again by the next process: {probing.doubtful()}"
    return (
        f"This is recorded in {records.record_file(driver)} for "
        f"{records.FAILURES_HOLD_SECONDS / 3600:.0f} hours; `ssgi devices --refresh` tries "
        "again now"
    )


def look_again(driver: Path | None = None) -> None:
    """Forget what is recorded of a driver's devices, or of all drivers'."""
    for path in driver_files() if driver is None else [driver]:
        records.forget(path)
        _fleeting.pop(path, None)
    _forget_devices()


def confirm(info: DeviceInfo, variant: KernelVariant, speed: Callable[[], float]) -> None:
    """Hold the recorded speed of a form to what it is in this process, where its driver is loaded.

    The first processes that use a record do so, in about 30 ms each. If one finds it too high, the
    record goes, and the next process times all forms again. Only for processors: their
    time is what is hard to measure, and clocks of cards rise with use.

    Args:
        info, variant: the device and the variant in use.
        speed: measures it, in million reads a second.
    """
    recorded = info.speeds.get(str(variant))
    driver = Path(info.driver)
    if info.kind != "cpu" or not isinstance(recorded, float):
        return
    if not records.unconfirmed(driver):
        return
    if speed() < SLOWER_THAN_RECORDED * recorded:
        records.forget(driver)
    else:
        records.confirm(driver)


_fleeting: dict[Path, Found] = {}
"""Devices that this process found: a read-only home, or failures in doubt, leave no record."""


def _looked_at(driver: Path) -> Found:
    """Return a driver's devices: as recorded, or as this process found them."""
    recorded = records.load(driver)
    if recorded is not None:
        return recorded
    found = _fleeting.get(driver)
    if found is None:
        with records.alone(driver):
            found = records.load(driver)  # by a process that was waited for
            if found is None:
                found = _fleeting[driver] = probing.probe(driver)
                if found.lasting:
                    records.save(driver, found)
    return found


def choose_variant(
    name: str | None, lanes: int | None, storage: str | None, loaded: str | None = None
) -> tuple[DeviceInfo, KernelVariant]:
    """Return the device and the kernel variant that `Runtime.open` is asked for; `loaded` as in `choose`.

    Raises:
        DeviceError: no such device, or it cannot run this variant.
    """
    info = choose(name, loaded)
    variant = info.best
    assert variant is not None  # noqa: S101  choose() returns usable devices only
    if lanes is not None or storage is not None:
        variant = KernelVariant(variant.lanes if lanes is None else lanes, storage or "buffer")
        reason = info.speeds.get(str(variant))
        if isinstance(reason, str):
            raise DeviceError(f"{info.label} cannot run {variant}: {reason}")
    return info, variant
