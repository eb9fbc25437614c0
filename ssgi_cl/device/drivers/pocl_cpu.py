"""The processor that PoCL 3.0, the version on PyPI, generates code for.

PoCL 3.0 asks LLVM 14 for the processor's name and links built-in functions that were compiled for
the processor's vector extensions. The two disagree on processors newer than LLVM 14. For an unknown
one the name is 'generic', which Clang refuses ("unknown target CPU 'generic'"). A Zen 4 counts as a
Zen 3 without AVX-512, so that calls with vectors of 16 floats do not match their functions and LLVM
aborts. Later versions of PoCL take the name of the processor that the built-in functions are for;
`name_processor` does the same for PoCL 3.0. It has neither a variable nor a call for that, so the
name is replaced in the device's record in memory, after the fields of this record were checked.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import struct
from pathlib import Path
from typing import Any

PATCHED_VERSIONS = ("3.0-rc2",)
"""Values of `CL_DRIVER_VERSION` of the wheel pocl-binary-distribution 3.0, the last on PyPI."""
_TRIPLE, _CPU = 0x278, 0x280
"""Offsets in bytes of two char* in PoCL 3.0's `struct _cl_device_id`: LLVM's triple, processor."""
_AVX512 = ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl")
_AVX2 = ("avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm")
_WITH_AVX512 = frozenset((
    "skylake-avx512", "cascadelake", "cooperlake", "cannonlake", "icelake-client", "icelake-server", "rocketlake",
    "sapphirerapids", "tigerlake",
))  # fmt: skip
"""Names that LLVM 14 detects and that have all of `_AVX512`."""

_names: dict[bytes, Any] = {}
"""Strings that devices point to: they live as long as the process."""


def suitable_name(name: str, flags: frozenset[str]) -> str:
    """Return the processor to generate code for: `name`, or that of PoCL's built-in functions.

    Args:
        name: what LLVM 14 calls the processor, "generic" if it does not know it.
        flags: its extensions as /proc/cpuinfo lists them; empty if they are not known.
    """
    if flags.issuperset(_AVX512):
        return name if name in _WITH_AVX512 else "skylake-avx512"
    if name != "generic":
        return name
    if flags.issuperset(_AVX2) and "avx512f" not in flags:
        return "haswell"
    return "sandybridge" if "avx" in flags else "x86-64"


def name_processor(device: Any) -> str | None:
    """Make a device of PoCL 3.0 generate code for a processor that its compiler knows.

    Must be called before the first program is built for it. Programs that PoCL cached for another
    name are not used, since its build options hold the name from now on.

    Args:
        device: pyopencl.Device.

    Returns:
        The new name; None if the device was left as it is: of another driver, well named, or
        its record is not as expected.
    """
    if device.driver_version not in PATCHED_VERSIONS:
        return None
    with contextlib.suppress(OSError), open("/proc/self/mem", "r+b", buffering=0) as memory:
        return _named(memory, device.int_ptr)
    return None  # no /proc, or it may not be written


def processor_flags(cpuinfo: Path = Path("/proc/cpuinfo")) -> frozenset[str]:
    """Return the extensions of the first processor of /proc/cpuinfo; none if it can't be read."""
    with contextlib.suppress(OSError):
        found = re.search(r"^flags\s*:(.*)$", cpuinfo.read_text(encoding="utf-8"), re.MULTILINE)
        return frozenset(found[1].split()) if found else frozenset()
    return frozenset()


def _named(memory: Any, record: int) -> str | None:
    """Replace the name in the device's record at an address; a bad address raises OSError."""
    if not _string(memory, record + _TRIPLE).startswith("x86_64-"):
        return None
    name = _string(memory, record + _CPU)
    if not re.fullmatch(r"[a-z][a-z0-9._-]*", name):
        return None
    wanted = suitable_name(name, processor_flags())
    if wanted == name:
        return None
    text = _names.setdefault(wanted.encode(), ctypes.create_string_buffer(wanted.encode()))
    os.pwrite(memory.fileno(), struct.pack("=Q", ctypes.addressof(text)), record + _CPU)
    _add_build_flag("-DPOCL_TARGET_CPU_" + re.sub(r"\W", "_", wanted))
    return wanted


def _string(memory: Any, pointer: int) -> str:
    """Return the short string that the pointer at an address points to; empty if it is none."""
    (address,) = struct.unpack("=Q", os.pread(memory.fileno(), 8, pointer))
    if not 0 < address < 1 << 47:
        return ""
    text = os.pread(memory.fileno(), 64, address).split(b"\0")[0]
    return text.decode("ascii", "replace")


def _add_build_flag(flag: str) -> None:
    """Add an option to every build; PoCL's hash of a program covers it."""
    flags = os.environ.get("POCL_EXTRA_BUILD_FLAGS", "").split()
    if flag not in flags:
        os.environ["POCL_EXTRA_BUILD_FLAGS"] = " ".join([*flags, flag])
