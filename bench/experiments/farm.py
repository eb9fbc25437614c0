"""A farm on this machine: scaling with workers, overhead of a task, and what kills of workers and schedulers lose.

    python -m ssgi_cl.bench.experiments.farm

Workers have one thread each. Faults are kill -9 of the workers' processes (their nannies start others) and of the
scheduler (the script starts another, and makes the same call again). Exit status 1 if a result is lost, is made twice,
or differs from that of one process.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import click
import numpy as np

from ssgi_cl.core.errors import SequenceError
from ssgi_cl.io import exr
from ssgi_cl.sequences.cluster import connected
from ssgi_cl.sequences.frame_result import FrameResults
from ssgi_cl.sequences.map_frames import map_frames

from .farm_work import OUTPUTS, SECONDS, TRACE, Traced, nothing

THREADS = {name: "1" for name in ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "OPENBLAS_NUM_THREADS")}
"""What a process with the share of a worker has."""


@click.command()
@click.option("--frames", default=200, show_default=True, type=click.IntRange(10), help="Of the sequence.")
@click.option("--width", default=960, show_default=True, help="Pixels of a frame; the height is 9 / 16 of it.")
@click.option("--workers", "counts", multiple=True, type=int, default=(1, 2, 4), show_default=True)
@click.option("--kills", default=20, show_default=True, help="Of workers.")
@click.option("--scheduler-kills", default=5, show_default=True)
@click.option("--seed", default=1, show_default=True, help="Of which worker is killed, and when.")
@click.option("--no-times", is_flag=True, help="Faults only.")
def main(
    frames: int, width: int, counts: Sequence[int], kills: int, scheduler_kills: int, seed: int, no_times: bool
) -> None:
    """Measure a farm, and kill its parts."""
    os.environ.update(THREADS)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs = _inputs(folder, frames, width)
        start = time.perf_counter()
        map_frames(Traced(), inputs, _outputs(folder / "serial", inputs)).check()
        alone = time.perf_counter() - start
        size = (
            sum(path.stat().st_size for path in inputs) / len(inputs),
            sum(path.stat().st_size for path in (folder / "serial").iterdir()) / len(inputs),
        )
        click.echo(
            f"{frames} frames of {width} x {width * 9 // 16}, {size[0] / 1e6:.2f} MB read and {size[1] / 1e6:.2f} MB "
            f"written each; one process with one thread: {alone:.1f} s, {1e3 * alone / frames:.1f} ms a frame"
        )
        if not no_times:
            _scaling(folder, inputs, counts, alone)
        rng = random.Random(seed)
        wrong = _killed_workers(folder, inputs, kills, rng) + _killed_schedulers(folder, inputs, scheduler_kills, rng)
    for line in wrong:
        click.echo(f"WRONG: {line}", err=True)
    sys.exit(1 if wrong else 0)


def _inputs(folder: Path, count: int, width: int) -> list[Path]:
    """Write frames, each with a depth of its own, and return their files."""
    rng = np.random.default_rng(1)
    rows, columns = width * 9 // 16, width
    paths = [folder / "in" / f"{number:04d}.exr" for number in range(1, count + 1)]
    paths[0].parent.mkdir()
    depth = np.kron(rng.uniform(2.0, 2.4, (rows // 8 + 1, columns // 8 + 1)), np.ones((8, 8)))[:rows, :columns]
    for number, path in enumerate(paths):
        exr.write(path, {"depth": (np.roll(depth, 3 * number, axis=1) * (1.0 + 1e-3 * number)).astype(np.float32)})
    return paths


def _outputs(folder: Path, inputs: Sequence[Path]) -> list[Path]:
    folder.mkdir(exist_ok=True)
    return [folder / path.name for path in inputs]


# ---- a cluster of processes


class _Cluster:
    """A scheduler and workers with nannies, as processes of this machine."""

    def __init__(self, workers: int) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.scheduler = _process("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
        self.nannies = [
            _process("worker", self.address, "--nworkers", 1, "--nthreads", 1, "--no-dashboard", "--death-timeout", 60)
            for _ in range(workers)
        ]

    def kill_worker(self, rng: random.Random, trace: Path) -> bool:
        """Kill the process of a worker at random; False if it has begun no frame yet, by the trace."""
        begun = {int(line.split()[1]) for line in _lines(trace)}
        pids = begun.intersection(_children(rng.choice(self.nannies).pid))
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return bool(pids)

    def close(self) -> None:
        """End all processes."""
        for process in (*self.nannies, self.scheduler):
            pids = _children(process.pid)
            process.kill()
            process.wait()
            for pid in pids:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def _process(what: str, *arguments: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _children(pid: int) -> list[int]:
    """Return the worker's processes below a nanny's, as Linux lists them."""
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):  # each thread has those that it started
        with suppress(OSError):
            for each in path.read_text(encoding="ascii").split():
                if b"spawn_main" in Path(f"/proc/{each}/cmdline").read_bytes():
                    found.append(int(each))
    return found


@contextmanager
def _cluster(workers: int) -> Iterator[tuple[_Cluster, Any]]:
    """Give a cluster and a client of it, once all workers are there."""
    cluster = _Cluster(workers)
    try:
        client = connected(cluster.address)
        client.wait_for_workers(workers, timeout=120)
        try:
            yield cluster, client
        finally:
            with suppress(Exception):  # the scheduler may be gone
                client.close(timeout=2)
    finally:
        cluster.close()


# ---- times


def _scaling(folder: Path, inputs: list[Path], counts: Sequence[int], alone: float) -> None:
    """Print the table of times by workers, and the overhead of a task."""
    first = 0.0
    click.echo(
        "\n| workers | s | frames/s | speed-up | efficiency | ms a frame beyond one process |\n"
        "|---|---|---|---|---|---|"
    )
    for count in counts:
        with _cluster(count) as (_, client):
            warm = _outputs(folder / f"warm{count}", inputs)
            map_frames(Traced(), inputs[: 8 * count], warm[: 8 * count], client=client).check()
            start = time.perf_counter()
            map_frames(Traced(), inputs, _outputs(folder / f"of{count}", inputs), client=client).check()
            seconds = time.perf_counter() - start
        first = first or seconds * count
        beyond = 1e3 * (seconds * min(count, os.cpu_count() or 1) - alone) / len(inputs)
        click.echo(
            f"| {count} | {seconds:.1f} | {len(inputs) / seconds:.1f} | {first / seconds:.2f} | "
            f"{first / seconds / count:.0%} | {beyond:.1f} |"
        )
        shutil.rmtree(folder / f"warm{count}")
    for count, tasks in ((1, 1000), (max(counts), 1000), (max(counts), 10_000)):
        with _cluster(count) as (_, client):
            map_frames(nothing, list(range(20)), client=client)
            start = time.perf_counter()
            map_frames(nothing, list(range(tasks)), client=client)
            each = (time.perf_counter() - start) / tasks
        click.echo(
            f"{tasks} tasks that do nothing, {count} workers: {1e3 * each:.2f} ms a task, {1 / each:.0f} tasks/s"
        )


# ---- faults


@contextmanager
def _traced(folder: Path, name: str, seconds: float) -> Iterator[None]:
    """Have processes that are started now write down what they begin, and take longer."""
    given = {SECONDS: str(seconds), TRACE: str(folder / f"{name}.txt"), OUTPUTS: str(folder / name)}
    os.environ.update(given)
    try:
        yield
    finally:
        for variable in given:
            del os.environ[variable]


def _killed_workers(folder: Path, inputs: list[Path], kills: int, rng: random.Random) -> list[str]:
    """Kill workers at random while a sequence is done; return what went wrong."""
    outputs = _outputs(folder / "workers", inputs)
    done, runs, counts = threading.Event(), 0, Counter[str]()
    killed = 0
    with _traced(folder, "workers", 0.3), _cluster(2) as (cluster, client):

        def kill() -> None:
            nonlocal killed
            while killed < kills and not done.wait(rng.uniform(0.5, 3.0)):
                killed += cluster.kill_worker(rng, folder / "workers.txt")

        killer = threading.Thread(target=kill)
        killer.start()
        try:
            while runs < 5:
                runs += 1
                found = map_frames(Traced(), inputs, outputs, client=client)
                counts += _counted(found)
                if not found.failed:
                    break
        finally:
            done.set()
            killer.join()
    click.echo(
        f"\nworkers: {killed} of {kills} kills while {len(inputs)} frames were done in {runs} calls: {_told(counts)}"
    )
    wrong = [] if killed == kills else [f"only {killed} workers were killed: --frames is too small"]
    return wrong + _checked(folder, "workers", inputs)


def _killed_schedulers(folder: Path, inputs: list[Path], kills: int, rng: random.Random) -> list[str]:
    """Kill schedulers at random while a sequence is done; return what went wrong."""
    outputs = _outputs(folder / "schedulers", inputs)
    counts, wrong, killed = Counter[str](), [], 0
    while True:
        with _traced(folder, "schedulers", 0.05), _cluster(2) as (cluster, client):
            after = rng.uniform(0.5, 1.0) * len(inputs) / (kills + 1) if killed < kills else len(inputs) + 1
            begun = sum(path.exists() for path in outputs)

            def lose(
                finished: int, *_: object, cluster: Any = cluster, begun: int = begun, after: float = after
            ) -> None:
                if finished - begun > after and cluster.scheduler.poll() is None:
                    cluster.scheduler.kill()
                    cluster.scheduler.wait()

            try:
                counts += _counted(map_frames(Traced(), inputs, outputs, client=client, progress=lose))
                break
            except SequenceError as error:
                killed += 1
                if "lost after" not in str(error):
                    wrong.append(str(error))
        if killed > kills:
            wrong.append(f"the scheduler was lost {killed} times, and killed {kills} times")
            break
    click.echo(f"schedulers: {killed} kills; the last call: {_told(counts)}")
    return wrong + _checked(folder, "schedulers", inputs)


def _counted(found: FrameResults) -> Counter[str]:
    return Counter(each.state for each in found)


def _told(counts: Counter[str]) -> str:
    return ", ".join(f"{number} {state}" for state, number in sorted(counts.items()))


def _lines(trace: Path) -> list[str]:
    return trace.read_text(encoding="ascii").split("\n")[:-1] if trace.exists() else []


def _checked(folder: Path, name: str, inputs: list[Path]) -> list[str]:
    """Return what is lost, was made though it was there, or differs from the run of one process."""
    lines = _lines(folder / f"{name}.txt")
    begun = Counter(line.split()[0] for line in lines)
    twice = [line.split()[0] for line in lines if line.endswith("there")]
    wrong = [f"{name}: {each} was done and was begun again" for each in twice]
    for path in inputs:
        one, other = folder / "serial" / path.name, folder / name / path.name
        if not other.exists():
            wrong.append(f"{name}: {path.name} is lost")
        elif one.read_bytes() != other.read_bytes():
            wrong.append(f"{name}: {path.name} differs")
    left = [path.name for path in (folder / name).glob(".ssgi-*")]
    click.echo(
        f"  {len(inputs) - len(wrong)} results are those of one process; {sum(begun.values())} beginnings, "
        f"{sum(begun.values()) - len(begun)} of them of frames whose worker was lost; {len(left)} files of killed "
        "processes"
    )
    return wrong


if __name__ == "__main__":
    main()
