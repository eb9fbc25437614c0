"""Images in bands of rows: time and memory beside those of one piece.

    python -m ssgi_cl.bench.experiments.bands [--size 16384] [--max-memory 4GiB] [--pairs 3]

Prints two tables: `ssgi apply gtao` on a depth map in a file, each run in a process of its own, whose peak of resident
memory counts; and calls on arrays of the hall. All results are compared bit by bit.
"""

from __future__ import annotations

import argparse
import filecmp
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import ssgi_cl as gi
from ssgi_cl.io.exr_camera import camera_attributes
from ssgi_cl.io.exr_rows import write_rows
from ssgi_cl.rasterize.scenes import hall

TECHNIQUES = ("ssao", "hbao", "gtao", "bitmask_ao")
ARRAY_SIZE = 3072, 4096
SHARES = 1.5, 2
"""Of the memory that a call takes, the parts that bands get."""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=16384, help="rows and columns of the file")
    parser.add_argument("--max-memory", default="4GiB")
    parser.add_argument("--pairs", type=int, default=3)
    given = parser.parse_args(arguments)
    _files(given.size, given.max_memory, given.pairs)  # first: a child begins with the peak of its parent
    print(flush=True)
    _arrays(given.pairs)


def _arrays(pairs: int) -> None:
    """Print calls on arrays, in one piece and in bands, in turn."""
    room, runtime = hall(), gi.Runtime.open()
    rows, columns = ARRAY_SIZE
    camera = room.camera(columns, rows)
    gbuffer = gi.GBuffer(camera=camera, depth=gi.rasterize.gbuffer(room.scene, camera).depth)
    print(
        f"| call, {columns} x {rows}, depth alone | MiB | whole, ms | bands within, MiB | ms | ratio | bit-identical |"
    )
    print("|---|---:|---:|---:|---:|---:|---|")
    for name in TECHNIQUES:
        function = getattr(gi, name)
        runtime.forget()
        runtime.memory.peak = 0
        whole = function(gbuffer, radius=room.ao_radius)
        peak = runtime.memory.peak
        for share in SHARES:
            most = int(peak / share)
            times: dict[int | None, list[float]] = {None: [], most: []}
            same = True
            for number in range(pairs + 1):
                for limit, found in times.items():
                    start = time.perf_counter()
                    result = function(gbuffer, radius=room.ao_radius, max_memory=limit)
                    if number:  # the first compiles and allocates
                        found.append(time.perf_counter() - start)
                    same &= np.array_equal(result, whole)
            one, bands = (1e3 * median(each) for each in times.values())
            print(
                f"| `{name}` | {peak / 2**20:.0f} | {one:.0f} | {most / 2**20:.0f} | {bands:.0f} | {bands / one:.2f} | "
                f"{'yes' if same else 'no'} |",
                flush=True,
            )


def _depth(size: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield bands of a depth map: a surface with folds, steps like those of houses, fine relief, and sky."""
    x = np.arange(size, dtype=np.float32)
    for first in range(0, size, 256):
        y = np.arange(first, min(first + 256, size), dtype=np.float32)[:, None]
        z = 10.0 + 0.8 * np.sin(x * (40.0 / size)) * np.cos(y * (31.0 / size))
        z = z + 0.002 * np.sin(x * 0.7) * np.sin(y * 0.9)
        steps = (x // (size // 64)).astype(int) * 7 + (y // (size // 64)).astype(int) * 13
        z = z - 0.25 * (steps % 11 % 4)
        z[:, x < size * 0.02] = np.inf
        yield first, {"Z": z.astype(np.float32)}


def _files(size: int, most: str, pairs: int) -> None:
    """Print `ssgi apply` on a file, read, computed and written in one piece and by bands, in turn."""
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=size, height=size)
    window = np.zeros(2, np.int32), np.full(2, size - 1, np.int32)
    with tempfile.TemporaryDirectory() as folder:
        source, whole, bands = (Path(folder) / name for name in ("depth.exr", "whole.exr", "bands.exr"))
        header = {**camera_attributes(camera), "dataWindow": window, "displayWindow": window}
        write_rows(source, header, (size, size), _depth(size))
        print(f"| `ssgi apply gtao`, {size} x {size}, {source.stat().st_size >> 20} MiB | s | peak, MiB | ratio |")
        print("|---|---:|---:|---:|")
        runs: dict[Path, list[tuple[float, float]]] = {whole: [], bands: []}
        for _ in range(pairs):
            for output, found in runs.items():
                options = ("--max-memory", most) if output == bands else ()
                found.append(_run("apply", "gtao", str(source), "-o", str(output), *options))
        seconds = {output: median(each[0] for each in found) for output, found in runs.items()}
        for output, what in ((whole, "in one piece"), (bands, f"`--max-memory {most}`")):
            peak = max(each[1] for each in runs[output])
            print(f"| {what} | {seconds[output]:.1f} | {peak:.0f} | {seconds[output] / seconds[whole]:.2f} |")
        print("\nsame file:", "yes" if filecmp.cmp(whole, bands, shallow=False) else "no", flush=True)


def _run(*arguments: str) -> tuple[float, float]:
    """Run a command; return seconds and the peak of its resident memory in MiB."""
    start = time.perf_counter()
    child = subprocess.Popen([sys.executable, "-m", "ssgi_cl", *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{' '.join(arguments)} ended with status {child.returncode}")
    return time.perf_counter() - start, usage.ru_maxrss / 1024


if __name__ == "__main__":
    main()
