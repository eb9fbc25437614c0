"""Agreement of devices: `python -m ssgi_cl.bench.experiments.agreement` writes a table of it."""

from __future__ import annotations

import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import click
import numpy as np

from ssgi_cl.bench.every import TECHNIQUES, Array, inputs, results
from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import SsgiError
from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.runtime import Runtime

SIZE = (24, 40)
"""(rows, columns) of the images: some tiles and vectors, not all whole."""
TEXELS = 16
"""Along a side of the lights' maps."""

TOLERANCE = 1e-3
"""Of the mean difference, over the mean of absolute values. Roundings move results by some 2^-24;
where they decide (which texel a tap falls on, whether a sector is covered, which light is chosen,
which point is computed) a pixel differs, and what is decided otherwise is as good."""
NOT_IN_TIME = "not in time"
"""Takes the place of a result; says nothing of agreement."""
QUICK = {"GALLIVM_PERF": "nopt"}
"""Variables that spare drivers minutes of compiling; Mesa's, the others don't know it."""
SINGLE = {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1", "LP_NUM_THREADS": "1"}
"""Variables that give drivers for CPUs one thread."""

Results = Mapping[str, list[Array] | str]
"""Name of a technique -> what it made, or why it made nothing."""


@dataclass(frozen=True)
class Run:
    """A process that computes everything.

    Attributes:
        title: of its column.
        device: words of the device's label.
        form: the kernel variant.
        single: whether it has one thread.
    """

    title: str
    device: str
    variant: KernelVariant
    single: bool = False

    def results(self, folder: Path, limit: float) -> Results:
        """Start processes and return what they made within `limit` seconds for each technique.

        What a process ends at is left out by the next. The first in `folder` leaves the inputs
        there for those that follow.
        """
        command = [
            sys.executable,
            "-m",
            "ssgi_cl.bench.experiments.agreement",
            "--limit",
            str(limit),
            "--worker",
            str(folder),
            str(self.variant.lanes),
            self.variant.storage,
        ]
        environment = {**os.environ, **QUICK, "SSGI_CL_DEVICE": self.device}
        environment |= SINGLE if self.single else {}
        while _left(folder):
            code = subprocess.run(command, env=environment, check=False).returncode
            left = _left(folder)
            if left:
                late = code == -signal.SIGXCPU
                why = NOT_IN_TIME if late else f"the process died ({code})"
                _path(folder, left[0]).write_bytes(pickle.dumps(why))
        found = {}
        for name in TECHNIQUES:
            path = _path(folder, name)
            found[name] = pickle.loads(path.read_bytes())
            path.unlink()
        return found


def _path(folder: Path, name: str) -> Path:
    """Return where the results of a technique are."""
    return folder / f"{list(TECHNIQUES).index(name)}.pickle"


def _left(folder: Path) -> list[str]:
    """Return the techniques without results."""
    return [name for name in TECHNIQUES if not _path(folder, name).exists()]


def work(folder: Path, lanes: int, storage: str, limit: float) -> None:
    """Compute what is left on the device that SSGI_CL_DEVICE names; a file for each technique.

    SIGXCPU ends the process where a technique takes more than `limit` seconds of processor time,
    of which others that are at work take none.
    """
    runtime = Runtime.open(lanes=lanes, storage=storage)
    path = folder / "inputs.pickle"
    if not path.exists():
        path.write_bytes(pickle.dumps(inputs(runtime, SIZE, TEXELS)))
    given = pickle.loads(path.read_bytes())
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name in _left(folder):
        began = process_time()
        resource.setrlimit(resource.RLIMIT_CPU, (int(began + limit) + 1, resource.RLIM_INFINITY))
        made: list[Array] | str
        try:
            made = list(results(given, runtime, [name]).values())
        except SsgiError as error:
            made = type(error).__name__
            click.echo(f"{name}: {error}", err=True)
        click.echo(f"  {name}: {process_time() - began:.0f} s", err=True)
        with replacement(_path(folder, name)) as target:
            target.write_bytes(pickle.dumps(made))


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


def fits(one: list[Array] | str, other: list[Array] | str, *, same: bool) -> tuple[str, bool]:
    """Return a cell of the table, and whether it is within the tolerance.

    Args:
        one, other: of two runs.
        same: whether nothing but bit-identical results will do.
    """
    if isinstance(one, str) or isinstance(other, str):
        why = other if isinstance(other, str) else str(one)
        return why, why == NOT_IN_TIME
    found = difference(one, other)
    if found is None:
        return "same", True
    largest, mean = found
    return f"{largest:.0e}, {mean:.0e}", not same and mean <= TOLERANCE


def runs(infos: Sequence[DeviceInfo]) -> list[Run]:
    """Return the runs: the first device in all variants and with one thread, then the others."""
    made: list[Run] = []
    for info in infos:
        if info.best is None:
            continue
        short = info.label.split(":")[0]
        if made:
            made.append(Run(f"{short}, {info.best}", info.label, info.best))
            continue
        variants = [
            variant
            for variant in drivers.KERNEL_VARIANTS
            if isinstance(info.speeds.get(str(variant)), float) and variant != info.best
        ]
        made = [
            Run(f"{short}, {info.best}", info.label, info.best),
            Run("again, one thread", info.label, info.best, single=True),
            *(Run(str(variant), info.label, variant) for variant in variants),
        ]
    return made


def report(columns: Sequence[tuple[Run, Results]]) -> tuple[str, bool]:
    """Return the page, and whether all is within the tolerances."""
    (first, wanted), *others = columns
    lines = [
        "# Agreement of devices",
        "",
        "Made by `python -m ssgi_cl.bench.experiments.agreement`, each run in processes of its own.",
        "",
        f"Every technique on {SIZE[1]} x {SIZE[0]} pixels of the Cornell box with maps of {TEXELS} "
        f"texels a side, against {first.title}. A cell has the largest and the mean difference "
        "over the mean of absolute values, or says that all bits are the same. Runs and variants "
        "on one device have to be the same; other devices may differ by a mean of at most "
        f"{TOLERANCE:g}, since roundings decide which texel a tap falls on and which sector is "
        f'covered. **Bold** is beyond that; "{NOT_IN_TIME}" is what takes more than the time '
        "given, nearly all of it to compile.",
        "",
        "| technique | " + " | ".join(run.title for run, _ in others) + " |",
        "|---|" + "---:|" * len(others),
    ]
    fine = True
    for name in TECHNIQUES:
        cells = []
        for run, found in others:
            cell, good = fits(wanted[name], found[name], same=run.device == first.device)
            cells.append(cell if good else f"**{cell}**")
            fine = fine and good
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""]), fine


@click.command()
@click.option(
    "--output",
    default="docs/agreement.md",
    show_default=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="The page.",
)
@click.option(
    "--device",
    "devices",
    metavar="WORDS",
    multiple=True,
    help="Words of a device's label, several times; all by default, the fastest first.",
)
@click.option(
    "--limit", default=120.0, show_default=True, help="Of each technique in each run, seconds of processor time."
)
@click.option("--worker", type=(click.Path(path_type=Path), int, str), default=None, hidden=True)
def main(output: Path, devices: tuple[str, ...], limit: float, worker: tuple[Path, int, str] | None) -> None:
    """Run every technique on every device, compare and write a table.

    Drivers that are not installed for all can be named by OCL_ICD_VENDORS, a folder of .icd files.
    """
    if worker is not None:
        work(*worker, limit)
        return
    infos = [drivers.choose(words) for words in devices] or sorted(drivers.devices(), key=lambda info: -info.speed)
    columns: list[tuple[Run, Results]] = []
    with tempfile.TemporaryDirectory() as folder:
        for run in runs(infos):
            click.echo(run.title)
            columns.append((run, run.results(Path(folder), limit)))
    page, fine = report(columns)
    with replacement(output) as path:
        path.write_text(page, encoding="utf-8")
    click.echo(page)
    if not fine:
        raise SystemExit(1)


if __name__ == "__main__":
    main(prog_name="python -m ssgi_cl.bench.experiments.agreement")
