"""Damaged files in PoCL's cache of compiled kernels, found and removed.

PoCL maps what it cached into memory as it is: a file that a full disk or a power cut truncated ends
every later process with SIGBUS or SIGABRT. A process that uses PoCL therefore looks through the
cache first, removes what is damaged and says so. As large caches take seconds, it stops after
`LOOK_SECONDS`, unless a process died before it: each keeps a mark in our cache folder, which goes
when it ends in order.
"""

from __future__ import annotations

import atexit
import fcntl
import hashlib
import math
import os
import shutil
import struct
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from ssgi_cl.device.drivers.caches import cache_folder, pocl_folder

LOOK_SECONDS = 0.05
"""Time for a look through the cache; enough for some hundred programs."""

_held: dict[Path, int] = {}
"""Marks of this process and the descriptors that lock them."""
_TOP_LEVEL_BLOCK = 0b01
"""LLVM's code for the start of a block in the first 2 bits."""


def guard() -> None:
    """Mark this process as one that uses PoCL, and clear damage before it is met.

    Warns:
        RuntimeWarning: files were removed; names them.
    """
    folder = pocl_folder()
    started = _left_by_dead(folder)
    if started is None:
        clear_damaged(folder, seconds=LOOK_SECONDS)
    else:
        clear_damaged(folder, since=started)
    _mark(folder)


def clear_damaged(folder: Path | None = None, *, since: float = 0.0, seconds: float = math.inf) -> list[Path]:
    """Remove and return the damaged files of PoCL's cache; it compiles these kernels again.

    Args:
        folder: PoCL's cache; by default that of this process.
        since, seconds: see `damaged_files`; if anything is damaged, all is looked at.

    Warns:
        RuntimeWarning: files were removed; names them.
    """
    folder = folder or pocl_folder()
    found = list(damaged_files(folder, since=since, seconds=seconds))
    if found and (since or seconds < math.inf):
        found = list(damaged_files(folder))
    for path in found:
        with suppress(OSError):
            if path.name == "program.bc":  # what was made of it goes too
                shutil.rmtree(path.parent)
            else:
                path.unlink()
    if found:
        warnings.warn(
            f"PoCL's cache {folder} held {len(found)} truncated "
            f"file{'s' if len(found) > 1 else ''}, which a full disk or a killed machine leaves "
            f"and which ends every process that reads it; removed: {_named(found, folder)}. These "
            "kernels are compiled again",
            RuntimeWarning,
            stacklevel=3,
        )
    return found


def damaged_files(folder: Path, *, since: float = 0.0, seconds: float = math.inf) -> Iterator[Path]:
    """Give the compiled programs and kernels in PoCL's cache that are not whole.

    Args:
        folder: PoCL's cache: `XX/HASH/program.bc`, and beside it `KERNEL/VARIANT/KERNEL.so`.
        since: time, in seconds since 1970: kernels are only looked at in programs that were used
            after it. PoCL notes that before it loads a kernel, but after it loads a program.
        seconds: to spend at most.
    """
    end = time.perf_counter() + seconds
    for program in folder.glob("[A-P][A-P]/*/program.bc"):
        if time.perf_counter() > end:
            break
        with suppress(OSError):  # another process removed it
            if not whole_bitcode(program):
                yield program
                continue
        with suppress(OSError):
            if not since or program.with_name("last_accessed").stat().st_mtime >= since:
                yield from (path for path in program.parent.glob("*/*/*.so") if not whole_library(path))


def whole_library(path: Path) -> bool:
    """Return whether a shared library reaches to the end of its table of sections.

    Linkers write that table last.
    """
    with path.open("rb", buffering=0) as file:
        header = file.read(64)
        size = os.fstat(file.fileno()).st_size
    if len(header) < 64 or header[:4] != b"\x7fELF":
        return False
    if header[4] != 2:
        return True  # of 32 bits: PoCL's own affair
    (start,) = struct.unpack_from("<Q", header, 0x28)
    entry, count = struct.unpack_from("<HH", header, 0x3A)
    return bool(start + entry * count <= size)


def whole_bitcode(path: Path) -> bool:
    """Return whether a file of LLVM bitcode ends where its last block does.

    See LLVM Bitcode File Format, "Bitstream Container Format": at the top level a block starts with
    a word that holds its kind, and a word that holds its length in words.
    """
    with path.open("rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size
        if file.read(4) != b"BC\xc0\xde":
            return False
        position = 4
        while position < size:
            words = file.read(8)
            if len(words) < 8 or words[0] & 0b11 != _TOP_LEVEL_BLOCK:
                return False
            position += 8 + 4 * int.from_bytes(words[4:], "little")
            file.seek(position)
        return position == size and size > 4


def _left_by_dead(folder: Path) -> float | None:
    """Remove the marks of processes that have died; return when the first started, if any."""
    first = None
    for path in cache_folder().glob(f"{_prefix(folder)}*"):
        if path in _held:
            continue
        with suppress(OSError):  # another process is faster, or may alone write it
            descriptor = os.open(path, os.O_RDWR)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                started = os.fstat(descriptor).st_mtime - 2.0  # clocks of files are coarse
                path.unlink()
                first = min(started, first or started)
            finally:
                os.close(descriptor)
    return first


def _mark(folder: Path) -> None:
    path = cache_folder() / f"{_prefix(folder)}{os.getpid()}"
    if path in _held:
        return
    with suppress(OSError):  # a read-only home: nobody will find this process's damage
        path.parent.mkdir(parents=True, exist_ok=True)
        _held[path] = os.open(path, os.O_CREAT | os.O_RDWR, 0o600)
        fcntl.flock(_held[path], fcntl.LOCK_EX | fcntl.LOCK_NB)
        atexit.register(_unmark, path, os.getpid())


def _unmark(path: Path, process: int) -> None:
    if os.getpid() != process or path not in _held:
        return  # a fork that ends
    with suppress(OSError):
        path.unlink()
    os.close(_held.pop(path))


def _prefix(folder: Path) -> str:
    return f"running-{hashlib.sha256(str(folder).encode()).hexdigest()[:12]}-"


def _named(paths: list[Path], folder: Path) -> str:
    names = [str(path.relative_to(folder)) for path in paths[:3]]
    return ", ".join(names) + (f" and {len(paths) - 3} more" if len(paths) > 3 else "")
