"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import math
import os
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacement(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file beside `path` that takes its place if the block succeeds.

    The temporary file exists, is empty and has the permissions of a new file. If the block raises,
    it is removed and `path` stays as it was; if the process is killed, another one that writes
    into that folder removes it within a minute. A symbolic link is followed, not replaced.

    Raises:
        OSError: (FileNotFoundError, PermissionError, IsADirectoryError, ...) `path` can't be
            written; the message names it.
    """
    target = Path(os.path.realpath(path))
    try:
        mode = target.stat().st_mode  # looked at once: others may replace or remove it
    except OSError:
        mode = stat.S_IFREG
    if stat.S_ISDIR(mode):
        raise _error(IsADirectoryError, errno.EISDIR, "it is a folder", path)
    if not stat.S_ISREG(mode):
        raise _error(OSError, errno.EINVAL, "it is not a regular file", path)
    try:
        _clear(target.parent)
        temporary, held = _temporary(target.parent)
    except OSError as error:
        reason = f"no file can be made in the folder {target.parent} ({error.strerror})"
        raise _error(type(error), error.errno or 0, reason, path) from error
    try:
        try:
            yield temporary
            temporary.replace(target)
        except OSError as error:
            # A full disk is told without a name, or with that of the temporary file.
            if error.errno is None or error.filename not in (None, os.fspath(temporary)):
                raise
            reason = f"{error.strerror}"
            raise _error(type(error), error.errno, reason, path) from error
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()
        os.close(held)


def _temporary(folder: Path) -> tuple[Path, int]:
    """Make an empty file; return it and a descriptor whose lock says that its process lives."""
    while True:
        path = folder / f".ssgi-{secrets.token_hex(8)}.tmp"
        held = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
        _lock(held, wait=True)
        if path.exists():  # nobody took it for a dead process's before it was locked
            return path, held
        os.close(held)


_cleared: dict[Path, float] = {}
"""When this process looked through folders; a look through 10,000 files takes as long as a small file's writing."""
_CLEAR_SECONDS = 60.0


def _clear(folder: Path) -> None:
    """Remove the temporary files of processes that were killed, with the first file and then once a minute."""
    now = time.monotonic()
    if now - _cleared.get(folder, -math.inf) < _CLEAR_SECONDS:
        return
    _cleared[folder] = now
    for path in folder.glob(".ssgi-*.tmp"):
        with suppress(OSError):  # another process removes it, or it is another user's
            found = os.open(path, os.O_WRONLY)
            try:
                if _lock(found, wait=False):
                    path.unlink()
            finally:
                os.close(found)


def _lock(file: int, *, wait: bool) -> bool:
    """Lock a file until its descriptor is closed; return False if another holds it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:  # held, or the file system has no locks
        return False
    return True


def _error(kind: type[OSError], number: int, reason: str, path: str | os.PathLike[str]) -> OSError:
    return kind(number, f"cannot write the file: {reason}", os.fspath(path))
