"""Record of the programs that were ever compiled, to tell a first compilation from one that the driver has kept.

Drivers keep what they compiled and say nothing of it. The record is a file of our cache folder, a line for each
program; a user who empties the driver's cache alone is told nothing of the compilation that follows.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cached_property
from pathlib import Path

from ssgi_cl.device.drivers.caches import cache_folder

KEY = 16
"""Letters of a line."""
MOST_BYTES = 1 << 20
"""A longer file is begun anew: what is in use is back after a frame."""


class CompiledRecord:
    """The programs that were compiled on this machine; where the folder can't be written, by this process.

    Attributes:
        new: programs that were not in the record when they were noted.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._path = (folder or cache_folder()) / "compiled.txt"
        self.new = 0

    @cached_property
    def _known(self) -> set[str]:
        try:
            return set(self._path.read_text("ascii", "replace").split())
        except OSError:
            return set()

    def has(self, digest: str) -> bool:
        """Return whether a program, by the digest of all that it depends on, was compiled before."""
        return digest[:KEY] in self._known

    def add(self, digest: str) -> None:
        """Note a program that was compiled now."""
        if self.has(digest):
            return
        self.new += 1
        self._known.add(digest[:KEY])
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            fresh = self._path.exists() and self._path.stat().st_size > MOST_BYTES
            with self._path.open("w" if fresh else "a", encoding="ascii") as file:
                file.write(f"{digest[:KEY]}\n")
