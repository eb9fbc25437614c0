"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacement(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary file beside `path` that takes its place if the block succeeds.

    The temporary file exists, is empty and has the permissions of a new file. If the block raises,
    it is removed and `path` stays as it was. A symbolic link is followed, not replaced.

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
    temporary = target.parent / f".ssgi-{secrets.token_hex(8)}.tmp"
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        reason = f"no file can be made in the folder {target.parent} ({error.strerror})"
        raise _error(type(error), error.errno or 0, reason, path) from error
    try:
        yield temporary
        try:
            temporary.replace(target)
        except OSError as error:
            reason = f"{error.strerror}"
            raise _error(type(error), error.errno or 0, reason, path) from error
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


def _error(kind: type[OSError], number: int, reason: str, path: str | os.PathLike[str]) -> OSError:
    return kind(number, f"cannot write the file: {reason}", os.fspath(path))
