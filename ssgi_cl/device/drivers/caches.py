"""Cache folders: ours, and those of drivers where the user's can't be written or don't exist.

A full disk, a read-only home, or a container whose user has neither HOME nor an entry in
/etc/passwd: the library works all the same, in `SSGI_CL_CACHE` or a temporary folder.
"""

from __future__ import annotations

import os
import stat
import tempfile
from functools import cache
from pathlib import Path

_made: list[tempfile.TemporaryDirectory[str]] = []
"""Folders that go when the process ends."""


def cache_folder() -> Path:
    """Return the folder for what can be made anew, such as device timings.

    The variable SSGI_CL_CACHE, or else `ssgi_cl` in the user's folder for caches.
    """
    asked = os.environ.get("SSGI_CL_CACHE")
    return Path(asked) if asked else _user_caches() / "ssgi_cl"


def pocl_folder() -> Path:
    """Return the folder that PoCL caches compiled kernels in."""
    return Path(os.environ.get("POCL_CACHE_DIR") or _user_caches() / "pocl" / "kcache")


@cache
def replaced_caches() -> dict[str, str]:
    """Return the variables that drivers need in this process; none if all folders can be written.

    Without a folder for its cache PoCL lists no device, and PyOpenCL fails at its first kernel.
    PoCL gets one in `SSGI_CL_CACHE`, or one that goes with the process; PyOpenCL does without.
    """
    variables = {}
    if _home() is None and not os.environ.get("XDG_CACHE_HOME"):
        # Else PyOpenCL makes a folder named ~ in the current one.
        variables["XDG_CACHE_HOME"] = str(_user_caches())
    if not _can_be_written(pocl_folder()):
        asked = os.environ.get("SSGI_CL_CACHE")
        if asked and _can_be_written(Path(asked) / "pocl"):
            variables["POCL_CACHE_DIR"] = str(Path(asked) / "pocl")
        else:
            try:
                variables["POCL_CACHE_DIR"] = _new_temporary()
            except OSError:
                return variables  # nothing can be written anywhere: the driver will say so
    if not _can_be_written(_user_caches()):
        variables["PYOPENCL_NO_CACHE"] = "1"
    return variables


def _user_caches() -> Path:
    """Return the folder of all of the user's caches."""
    asked = os.environ.get("XDG_CACHE_HOME")
    if asked:
        return Path(asked)
    home = _home()
    return _shared_temporary() if home is None else home / ".cache"


def _home() -> Path | None:
    """Return the user's home folder; None without HOME and without an entry in /etc/passwd."""
    try:
        return Path.home()
    except RuntimeError:
        return None


def _shared_temporary() -> Path:
    """Return the folder for caches of a user without a home; it stays for later processes.

    What lies there is executed, so one that others may write is not used.
    """
    asked = os.environ.get("SSGI_CL_CACHE")
    if asked:
        return Path(asked)
    folder = Path(tempfile.gettempdir()) / f"ssgi_cl-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return _own_temporary()
    private = stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o077
    return folder if private and found.st_uid == os.getuid() else _own_temporary()


@cache
def _own_temporary() -> Path:
    """Return a folder that goes with the process."""
    try:
        return Path(_new_temporary())
    except OSError:
        return Path(tempfile.gettempdir()) / "ssgi_cl"  # can't be written, as will be found


def _new_temporary() -> str:
    _made.append(tempfile.TemporaryDirectory(prefix="ssgi_cl-", ignore_cleanup_errors=True))
    return _made[-1].name


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
