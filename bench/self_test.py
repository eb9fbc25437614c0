"""Every technique on small inputs held to stored results: `python -m ssgi_cl.bench.self_test --help`.

What is computed is in processes of their own, which a driver may bring down.
"""

from __future__ import annotations

import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, process_time

import click
import numpy as np

from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import SsgiError
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.runtime import Runtime

from .every import TECHNIQUES, Array, inputs, results

STORED = Path(__file__).with_name("self_test.npz")
SIZE = (20, 24)
"""(rows, columns) of the images of what is stored: whole tiles and vectors, and parts of some."""
TEXELS = 16
"""Along a side of the lights' maps."""
TOLERANCE = 1e-3
"""Of the mean difference, over the mean of absolute values. Roundings move results by some 2^-24;
where they decide (which texel a tap falls on, whether a sector is covered, which light is chosen,
which point is computed) a pixel differs, and what is decided otherwise is as good."""
NOT_IN_TIME = "not in time"
"""Takes the place of a result; says nothing of agreement."""
SECONDS = 55.0
"""Of a self-test, that ends within a minute. What it compiled is kept by the driver, so that the next gets further."""
NO_LIMIT = 1e6
"""Seconds of processor time."""

Results = Mapping[str, list[Array] | str]
"""Name of a technique -> what it made, or why it made nothing."""


@dataclass(frozen=True)
class Outcome:
    """How a technique agrees with what is stored.

    Attributes:
        technique: its name.
        difference: the largest and the mean one over the mean of absolute values; None of bit-identical results, or
            where there is a `problem`.
        problem: why there is no result; empty if there is one.
    """

    technique: str
    difference: tuple[float, float] | None = None
    problem: str = ""

    @property
    def good(self) -> bool:
        """Whether the results are within `TOLERANCE`; what was not in time is not known to be bad."""
        if self.problem:
            return self.problem == NOT_IN_TIME
        return self.difference is None or self.difference[1] <= TOLERANCE

    def __str__(self) -> str:
        if self.problem or self.difference is None:
            return self.problem or "same bits"
        largest, mean = self.difference
        return f"{'within' if self.good else 'beyond'} {TOLERANCE:g}: mean {mean:.1e}, largest {largest:.1e}"


def difference(one: Sequence[Array], other: Sequence[Array]) -> tuple[float, float] | None:
    """Return the largest and the mean difference over the mean of absolute values, or None.

    None says that all bits are the same. Of several results it is the greatest that counts.
    """
    if all(np.array_equal(a, b) for a, b in zip(one, other, strict=True)):
        return None
    found = []
    for a, b in zip(one, other, strict=True):
        off = np.abs(a.astype(np.float64) - b)
        scale = max(float(np.abs(a).mean(dtype=np.float64)), 1e-30)
        found.append((float(off.max()) / scale, float(off.mean()) / scale))
    largest, mean = np.max(found, axis=0).tolist()
    return largest, mean


def stored() -> dict[str, list[Array]]:
    """Return the stored results of each technique."""
    found: dict[str, list[Array]] = {}
    with np.load(STORED) as file:
        for name in file.files:
            found.setdefault(name.rsplit(" ", 1)[0], []).append(file[name])
    return found


def self_test(
    info: DeviceInfo,
    variant: KernelVariant,
    seconds: float = SECONDS,
    tell: Callable[[str, float], object] | None = None,
) -> list[Outcome]:
    """Return how every technique agrees with what is stored, on a device in a form.

    Args:
        info, variant: the device and the form.
        seconds: after which the rest is `NOT_IN_TIME`.
        tell: is called with the technique under way and the share that is done.
    """
    wanted = stored()
    with tempfile.TemporaryDirectory() as folder:
        found = computed(Path(folder), info.label, variant, SIZE, seconds=seconds, tell=tell)
    return [_outcome(name, wanted.get(name, []), result) for name, result in found.items()]


def _outcome(name: str, wanted: list[Array], found: list[Array] | str) -> Outcome:
    if isinstance(found, str):
        return Outcome(name, problem=found)
    if [each.shape for each in found] != [each.shape for each in wanted]:
        return Outcome(name, problem="other results than those stored, which are of another version")
    off = difference(wanted, found)
    if off is not None and not np.isfinite(off).all():
        return Outcome(name, problem="results are not finite")
    return Outcome(name, off)


def computed(
    folder: Path,
    device: str,
    variant: KernelVariant,
    size: tuple[int, int],
    *,
    limit: float = NO_LIMIT,
    seconds: float | None = None,
    variables: Mapping[str, str] | None = None,
    tell: Callable[[str, float], object] | None = None,
) -> Results:
    """Return what processes made of each technique; what one ends at is left out by the next.

    The first in `folder` leaves the inputs there for those that follow.

    Args:
        folder: for the files of the processes.
        device: words of the device's label.
        variant: the form.
        size: (rows, columns) of the images.
        limit: seconds of processor time of each technique.
        seconds: of all together, on the clock.
        variables: of the environment, beside those of this process.
        tell: is called with the technique under way and the share that is done.
    """
    words = [str(folder), str(variant.lanes), variant.storage, *map(str, size), str(limit)]
    command = [sys.executable, "-m", "ssgi_cl.bench.self_test", "--worker", *words]
    environment = {**os.environ, **(variables or {}), "SSGI_CL_DEVICE": device}
    end = None if seconds is None else monotonic() + seconds
    while left := _left(folder):
        code = _ended(command, environment, end, lambda: _told(folder, tell))
        if code is None:
            for name in _left(folder):
                _path(folder, name).write_bytes(pickle.dumps(NOT_IN_TIME))
        elif left := _left(folder):
            late = code == -signal.SIGXCPU
            why = NOT_IN_TIME if late else f"the process died ({code})"
            _path(folder, left[0]).write_bytes(pickle.dumps(why))
    found = {}
    for name in TECHNIQUES:
        path = _path(folder, name)
        found[name] = pickle.loads(path.read_bytes())
        path.unlink()
    return found


def _ended(
    command: list[str], environment: Mapping[str, str], end: float | None, tell: Callable[[], object]
) -> int | None:
    """Return the exit status of a process; None if it was killed, at the time `end`."""
    with subprocess.Popen(command, env=environment) as process:
        while True:
            try:
                return process.wait(0.2)
            except subprocess.TimeoutExpired:
                tell()
                if end is not None and monotonic() > end:
                    process.kill()
                    return None
            except BaseException:
                process.kill()
                raise


def _told(folder: Path, tell: Callable[[str, float], object] | None) -> None:
    left = _left(folder)
    if tell is not None and left:
        tell(left[0], 1.0 - len(left) / len(TECHNIQUES))


def _path(folder: Path, name: str) -> Path:
    """Return where the results of a technique are."""
    return folder / f"{list(TECHNIQUES).index(name)}.pickle"


def _left(folder: Path) -> list[str]:
    """Return the techniques without results."""
    return [name for name in TECHNIQUES if not _path(folder, name).exists()]


def work(folder: Path, lanes: int, storage: str, size: tuple[int, int], limit: float) -> None:
    """Compute what is left on the device that SSGI_CL_DEVICE names; a file for each technique.

    SIGXCPU ends the process where a technique takes more than `limit` seconds of processor time,
    of which others that are at work take none.
    """
    runtime = Runtime.open(lanes=lanes, storage=storage)
    path = folder / "inputs.pickle"
    if not path.exists():
        path.write_bytes(pickle.dumps(inputs(runtime, size, TEXELS)))
    given = pickle.loads(path.read_bytes())
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name in _left(folder):
        began = process_time()
        if limit < NO_LIMIT:
            resource.setrlimit(resource.RLIMIT_CPU, (int(began + limit) + 1, resource.RLIM_INFINITY))
        made: list[Array] | str
        try:
            made = list(results(given, runtime, [name]).values())
        except SsgiError as error:
            made = f"{type(error).__name__}: {str(error).strip()[:LONGEST]}"
        if limit < NO_LIMIT:
            click.echo(f"  {name}: {process_time() - began:.0f} s", err=True)
        with replacement(_path(folder, name)) as target:
            target.write_bytes(pickle.dumps(made))


LONGEST = 600
"""Characters of an error."""


def record(runtime: Runtime) -> None:
    """Store the results of this device in place of those that are."""
    found = results(inputs(runtime, SIZE, TEXELS), runtime)
    with replacement(STORED) as path, path.open("wb") as file:
        np.savez_compressed(file, **found)  # type: ignore[arg-type]  # names are free


@click.command()
@click.option("--record", "recording", is_flag=True, help="Store the results of the default device.")
@click.option("--worker", type=(click.Path(path_type=Path), int, str, int, int, float), default=None, hidden=True)
def main(recording: bool, worker: tuple[Path, int, str, int, int, float] | None) -> None:
    """Store what `ssgi doctor` holds devices to, after results have changed on purpose."""
    if worker is not None:
        folder, lanes, storage, rows, columns, limit = worker
        work(folder, lanes, storage, (rows, columns), limit)
    elif recording:
        record(Runtime.open())
    else:
        raise click.UsageError("expected --record; `ssgi doctor` runs the self-test")


if __name__ == "__main__":
    main(prog_name="python -m ssgi_cl.bench.self_test")
