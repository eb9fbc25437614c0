"""OpenCL drivers and devices: what is installed, and which build of the kernels suits each device.

Two drivers that carry their own LLVM can clash in one process (two versions of PoCL, or PoCL and
Intel's runtime), so devices are looked at in processes of their own, one for each driver, and only
the driver that is asked for is loaded. What was found is kept in the user's cache folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ssgi_cl import sources
from ssgi_cl.atomic import replacement
from ssgi_cl.driver_caches import replaced_caches
from ssgi_cl.errors import DeviceError

PROBE_SECONDS = 60
"""After this long for each form, a probe counts as crashed at the form that it was at."""


@dataclass(frozen=True)
class Form:
    """One build of the kernels.

    Attributes:
        lanes: pixels per work-item, 1, 8 or 16.
        storage: what kernels read, "buffer" or "image".
    """

    lanes: int
    storage: str

    def __post_init__(self) -> None:
        if (self.lanes, self.storage) not in (
            (1, "buffer"), (1, "image"), (8, "buffer"), (16, "buffer")
        ):
            raise ValueError(
                f"the kernels' form is {self.lanes} lanes on {self.storage!r}: expected 1, 8 or 16 "
                "lanes on 'buffer', or 1 lane on 'image'"
            )

    def __str__(self) -> str:
        return f"{self.lanes} lane{'s' if self.lanes > 1 else ''}, {self.storage}"


FORMS = (Form(1, "image"), Form(1, "buffer"), Form(8, "buffer"), Form(16, "buffer"))


@dataclass(frozen=True)
class DeviceInfo:
    """A device and how fast it runs each form of the kernels.

    Attributes:
        driver: path of the driver's .icd file.
        platform, device: indices among what that driver lists when loaded alone.
        label: what names are matched against, such as "PoCL 3.1+debian: pthread-...".
        kind: "cpu", "gpu" or "accelerator".
        units: compute units.
        speeds: form as text -> million reads per second if nothing else runs, or the reason why
            it does not run.
    """

    driver: str
    platform: int
    device: int
    label: str
    kind: str
    units: int
    speeds: dict[str, float | str] = field(default_factory=dict)

    @property
    def best(self) -> Form | None:
        """The fastest form, or None if none runs; the wider of two within 15 % of each other.

        Kernels compute more for each read than the probe does, which favours wide vectors.
        """
        timed = [form for form in FORMS if isinstance(self.speeds.get(str(form)), float)]
        fastest = max((float(self.speeds[str(form)]) for form in timed), default=0.0)
        close = [form for form in timed if float(self.speeds[str(form)]) >= 0.85 * fastest]
        return max(close, key=lambda form: (form.lanes, form.storage == "buffer"), default=None)

    @property
    def speed(self) -> float:
        """Million reads a second of the fastest form; 0 if none runs."""
        numbers = (speed for speed in self.speeds.values() if isinstance(speed, float))
        return max(numbers, default=0.0)


def driver_files() -> list[Path]:
    """Return the .icd files of the installed drivers.

    The variable OCL_ICD_VENDORS, if set by the user, names the only folder or file to look at.
    """
    asked = os.environ.get("OCL_ICD_VENDORS")
    if asked:
        path = Path(asked)
        return sorted(path.glob("*.icd")) if path.is_dir() else [path]
    found = sorted(Path("/etc/OpenCL/vendors").glob("*.icd"))
    package = find_spec("pyopencl")
    if package and package.origin:
        found += sorted((Path(package.origin).parent / ".libs").glob("*.icd"))
    return found


@cache
def devices() -> tuple[DeviceInfo, ...]:
    """Return every device of every installed driver; those not seen before are timed first."""
    return tuple(info for path in driver_files() for info in _devices_of(path))


def choose(name: str | None) -> DeviceInfo:
    """Return the fastest device whose label holds every word of `name` (any device if None).

    Raises:
        DeviceError: none fits; the message lists what there is.
    """
    found = devices()
    words = (name or "").lower().replace(":", " ").split()
    fitting = [info for info in found if all(word in info.label.lower() for word in words)]
    usable = [info for info in fitting if info.best is not None]
    if not usable:
        listing = "".join(f"\n  {info.label}" for info in found) or "\n  none"
        why = "no kernel runs on it" if fitting else "no such OpenCL device"
        hint = "" if found else "\nInstall a driver, for example: pip install 'ssgi-cl[pocl]'"
        raise DeviceError(f"{name or 'any device'}: {why}. Devices found:{listing}{hint}")
    return max(usable, key=lambda info: info.speed)


def cache_folder() -> Path:
    """Return the folder for what can be made anew, such as device timings."""
    asked = os.environ.get("SSGI_CL_CACHE")
    if asked:
        return Path(asked)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "ssgi_cl"


def _devices_of(driver: Path) -> list[DeviceInfo]:
    record = cache_folder() / f"devices-{_fingerprint(driver)}.json"
    try:
        return [DeviceInfo(**entry) for entry in json.loads(record.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError):
        pass  # never probed, or a record of another version: probe
    try:
        found = _probe(driver)
    except TimeoutError:
        return []  # not kept: it may be the machine that was busy
    try:
        record.parent.mkdir(parents=True, exist_ok=True)
        with replacement(record) as path:
            path.write_text(json.dumps([asdict(info) for info in found], indent=1))
    except OSError:
        pass  # a read-only home: the next process probes again
    return found


def _fingerprint(driver: Path) -> str:
    parts = [str(driver), sources.flatten("probe/probe_gather.cl"), str(os.cpu_count())]
    parts.append(Path(__file__).with_name("probe.py").read_text(encoding="utf-8"))
    try:
        library = Path(driver.read_text(encoding="utf-8").strip())
        parts.append(str(driver.stat().st_mtime_ns))
        if library.is_absolute():
            parts.append(str(library.stat().st_mtime_ns))
    except OSError:
        pass  # probing will tell
    for package in ("pyopencl", "pocl-binary-distribution"):
        try:
            parts.append(version(package))
        except PackageNotFoundError:
            parts.append("")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _probe(driver: Path) -> list[DeviceInfo]:
    """Time every form on every device of a driver, in processes that may die."""
    environment = {**os.environ, **replaced_caches(), "OCL_ICD_VENDORS": str(driver)}
    listed = _run_probe(environment, [])
    found = []
    for entry in listed:
        speeds: dict[str, float | str] = {}
        crashed: list[str] = []
        where = [str(entry["platform"]), str(entry["device"])]
        while not set(map(str, FORMS)) <= {*speeds, *crashed}:
            # All the others anew: forms are only fairly timed side by side.
            asked = [str(form) for form in FORMS if str(form) not in crashed]
            answers = _run_probe(environment, [*where, *asked])
            speeds = {answer["form"]: answer["speed"] for answer in answers}
            # The process died at the first form without an answer.
            crashed += [form for form in asked if form not in speeds][:1]
        speeds |= dict.fromkeys(crashed, "the driver crashes or hangs on it")
        found.append(DeviceInfo(driver=str(driver), speeds=speeds, **entry))
    return found


def _run_probe(environment: dict[str, str], arguments: list[str]) -> list[dict[str, Any]]:
    command = [sys.executable, "-m", "ssgi_cl.probe", *arguments]
    patience = PROBE_SECONDS * max(len(arguments) - 2, 1)
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=patience,
            check=False,
        )
        output = done.stdout
    except subprocess.TimeoutExpired as expired:
        if not arguments:
            raise TimeoutError(f"{environment['OCL_ICD_VENDORS']} lists no devices") from None
        output = (expired.stdout or b"").decode()
    return [json.loads(line) for line in output.splitlines() if line.startswith("{")]
