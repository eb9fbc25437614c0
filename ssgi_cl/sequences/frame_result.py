"""Results of the frames of a sequence."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SequenceError


@dataclass(frozen=True)
class FrameResult:
    """What became of a frame.

    Attributes:
        input: what the function was given.
        output: the file of the result, or None.
        state: "done", "skipped" (its file was there already), or "failed".
        value: what the function returned, where there is no file; else None.
        reason: of a failure, in words.
        seconds: that it took, waiting aside.
    """

    input: Any
    output: Path | None
    state: str
    value: Any = None
    reason: str = ""
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """Its input if that is a path, else its file."""
        return str(self.input if isinstance(self.input, (str, os.PathLike)) else self.output or "frame")


class FrameResults(list[FrameResult]):
    """The results of `map_frames`, in the order of its inputs."""

    @property
    def failed(self) -> list[FrameResult]:
        """Those that failed."""
        return [each for each in self if each.state == "failed"]

    @property
    def skipped(self) -> list[FrameResult]:
        """Those whose file was there already."""
        return [each for each in self if each.state == "skipped"]

    def check(self) -> FrameResults:
        """Return these results if none failed. SequenceError: some did; the message lists the first of them."""
        if not self.failed:
            return self
        lines = [f"{each.name}: {each.reason}" for each in self.failed[:10]]
        more = [f"and {len(self.failed) - 10} more"] if len(self.failed) > 10 else []
        raise SequenceError("\n  ".join([f"{len(self.failed)} of {len(self)} frames failed", *lines, *more]))

    def __repr__(self) -> str:
        counts = {state: sum(each.state == state for each in self) for state in ("done", "skipped", "failed")}
        said = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
        return f"FrameResults of {len(self)} frames: {said or 'none'}"


@dataclass(frozen=True)
class FrameFile:
    """What a function of `map_frames` returns whose OpenEXR file has more than arrays.

    Attributes:
        arrays: by name, see `ssgi_cl.io.exr.write`.
        like: a file whose windows and other attributes are kept.
        camera: of the image, for the header.
        half, parts: as of `ssgi_cl.io.exr.write`.
    """

    arrays: Mapping[str, Any]
    like: Path | None = None
    camera: Camera | None = None
    half: bool = False
    parts: bool = False


@dataclass(frozen=True)
class FrameRows:
    """What a function of `map_frames` returns that computes an image by bands of rows, as they are written.

    Attributes:
        rows: first row and arrays by name of each band, see `ssgi_cl.io.exr.write_in_rows`.
        like: a file whose windows and other attributes are kept.
    """

    rows: Iterator[tuple[int, Mapping[str, Any]]]
    like: Path


def reason(error: Exception) -> str:
    """Return why a frame failed, in words."""
    return f"{type(error).__name__}: {error}"
