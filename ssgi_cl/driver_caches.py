"""Cache folders of drivers, where the user's can't be written: a full disk, a read-only home."""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path

_made: list[tempfile.TemporaryDirectory[str]] = []
"""Folders that go when the process ends."""


@cache
def replaced_caches() -> dict[str, str]:
    """Return the variables that drivers need in this process; none if all folders can be written.

    Without a folder for its cache PoCL lists no device, and PyOpenCL fails at its first kernel.
    PoCL gets a folder that goes with the process; PyOpenCL does without.
    """
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    variables = {}
    if not _can_be_written(Path(os.environ.get("POCL_CACHE_DIR") or f"{home}/pocl/kcache")):
        try:
            folder = tempfile.TemporaryDirectory(prefix="ssgi_cl-", ignore_cleanup_errors=True)
        except OSError:
            return {}  # nothing can be written anywhere: the driver will say so
        _made.append(folder)
        variables["POCL_CACHE_DIR"] = folder.name
    if not _can_be_written(Path(home)):
        variables["PYOPENCL_NO_CACHE"] = "1"
    return variables


def _can_be_written(folder: Path) -> bool:
    """Return whether a file of some kilobytes can be made there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".ssgi-") as file:
            file.write(bytes(1 << 16))
            file.flush()
    except OSError:
        return False
    return True
