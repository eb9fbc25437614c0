"""Memory that this process may have: the limits of the machine, its control group and its own."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from time import monotonic

SHARE = 7 / 8
"""Of all memory, what a device that shares it may have."""
HEADROOM = 1 / 16
"""Of all memory, what is left to the system by each allocation."""
SMALL = 1 << 20
"""Bytes below which an allocation is not worth looking."""
PLENTY = 1 << 30
"""Bytes to spare, beyond which `FRESH` seconds may pass until the next look."""
FRESH = 0.1

_PAGE = resource.getpagesize()
_UNLIMITED = 1 << 60  # control groups write numbers near 2^63 for none


def share() -> int:
    """Return how many bytes a device that shares the host's memory may have in all."""
    return int(SHARE * _total())


def spare(size: int = SMALL) -> int:
    """Return how many bytes the process can take now and leave the system its headroom.

    For a `size` that is small the answer is not looked up: it is `size`. Shortly after a look that
    found plenty it is that less the sizes that were asked for since.
    """
    if size < SMALL:
        return size
    now = monotonic()
    if now > _look.until or _look.spare - size < PLENTY:
        _look.spare = min(_available()) - int(HEADROOM * _total())
        _look.until = now + FRESH
    _look.spare -= size
    return _look.spare + size


class _Look:
    """The latest look.

    Attributes:
        spare: bytes that the process could take then, less what was asked for since.
        until: when it is out of date.
    """

    spare = 0
    until = 0.0


_look = _Look()


def _total() -> int:
    """Return the bytes that this process could have if nothing were in use."""
    limits = [_meminfo()["MemTotal"], *(limit for limit, _ in _groups())]
    limits += [
        limit
        for kind in (resource.RLIMIT_AS, resource.RLIMIT_DATA)
        if (limit := resource.getrlimit(kind)[0]) != resource.RLIM_INFINITY
    ]
    return min(limits)


def _available() -> Iterator[int]:
    yield _meminfo()["MemAvailable"]
    for limit, used in _groups():
        yield limit - used
    space, data = _own()
    for kind, used in ((resource.RLIMIT_AS, space), (resource.RLIMIT_DATA, data)):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            yield limit - used


def _meminfo() -> dict[str, int]:
    """Return the machine's figures in bytes; no limit where they are not told."""
    found = {"MemTotal": _UNLIMITED, "MemAvailable": _UNLIMITED}
    with suppress(OSError, ValueError):
        for line in Path("/proc/meminfo").read_text().splitlines()[:4]:
            name, _, value = line.partition(":")
            found[name] = int(value.split()[0]) << 10
    return found


def _own() -> tuple[int, int]:
    """Return the bytes of address space and of data that this process has."""
    with suppress(OSError, ValueError):
        fields = Path("/proc/self/statm").read_text().split()
        return int(fields[0]) * _PAGE, int(fields[5]) * _PAGE
    return 0, 0


def _groups() -> Iterator[tuple[int, int]]:
    """Give limit and use, in bytes, of each control group of this process that has a limit.

    What the group's file cache takes can be had back, so it does not count as use.
    """
    for folder, (limit_name, used_name, cached_name) in _group_folders():
        with suppress(OSError, ValueError):
            limit = int((folder / limit_name).read_text())  # "max": none
            if limit < _UNLIMITED:
                used = int((folder / used_name).read_text())
                yield limit, used - _stat(folder / "memory.stat", cached_name)


def _stat(path: Path, name: str) -> int:
    for line in path.read_text().splitlines():
        key, _, value = line.partition(" ")
        if key == name:
            return int(value)
    return 0


@cache
def _group_folders() -> tuple[tuple[Path, tuple[str, str, str]], ...]:
    """Return the folders of this process's control groups, version 2 and 1, and its parents'."""
    names = {
        "": ("memory.max", "memory.current", "inactive_file"),
        "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
    }
    folders = []
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            kind = "memory" if "memory" in controllers.split(",") else controllers
            if kind in names:
                root = Path("/sys/fs/cgroup") / kind
                inner = root / path.lstrip("/")
                # In a container the path may be the host's: then the root is the group.
                for folder in (inner, *inner.parents):
                    if (folder / names[kind][0]).exists():
                        folders.append((folder, names[kind]))
                    if folder == root:
                        break
    return tuple(folders)
