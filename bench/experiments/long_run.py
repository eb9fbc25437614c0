"""Memory, file handles and time a frame of one process over thousands of tiny frames.

    python -m ssgi_cl.bench.experiments.long_run

A frame is read, `ssao` computed on the device, and the result written, as `ssgi apply ssao` does it. Peaks that grow
with the number of frames, or times that do, are faults.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import click
import numpy as np

from ssgi_cl.io import exr
from ssgi_cl.sequences.apply_exr import ApplyExr
from ssgi_cl.sequences.exr_passes import Passes
from ssgi_cl.sequences.frame_result import FrameResult
from ssgi_cl.sequences.map_frames import map_frames

MARKS = (100, 1_000, 2_000, 5_000, 10_000)
"""Numbers of frames after which figures are told."""


@click.command()
@click.option("--frames", default=MARKS[-1], show_default=True, type=click.IntRange(1), help="How many frames.")
def main(frames: int) -> None:
    """Tell memory, handles and time as frames go by."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = folder / "in.exr"
        rng = np.random.default_rng(1)
        exr.write(source, {"depth": np.kron(rng.uniform(2.0, 2.4, (3, 4)), np.ones((8, 8))).astype(np.float32)})
        work = ApplyExr(technique="ssao", parameters={"radius": 0.4}, passes=Passes(nan="hole"))
        report = _Report(frames)
        for again in (False, True):
            results = map_frames(work, [source] * frames, folder / "out.#####.exr", finished=report)
            results.check()
            click.echo(
                f"{len(results)} frames: {len(results.skipped)} skipped" + (", the second time" if again else "")
            )


class _Report:
    """Prints figures at some numbers of frames."""

    def __init__(self, total: int) -> None:
        self._total, self._count = total, 0
        self._start = self._last = time.perf_counter()
        self._counted = 0
        self._out = sys.stdout  # which reading in another thread replaces for moments

    def __call__(self, result: FrameResult) -> None:
        self._count += 1
        if self._count not in MARKS and self._count != self._total:
            return
        now = time.perf_counter()
        each = 1e3 * (now - self._last) / (self._count - self._counted)
        handles, threads = (len(os.listdir(f"/proc/self/{what}")) for what in ("fd", "task"))
        click.echo(
            f"{self._count:>6} frames  {_resident() / 2**20:7.1f} MiB  {handles:>4} handles  {threads:>3} threads"
            f"  {each:6.2f} ms a frame since the line before",
            file=self._out,
        )
        self._last, self._counted = now, self._count
        if self._count == self._total:
            self._count = self._counted = 0


def _resident() -> int:
    """Return bytes of memory that the process has now."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize()


if __name__ == "__main__":
    main()
