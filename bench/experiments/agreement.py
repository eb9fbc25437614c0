"""Agreement of devices: `python -m ssgi_cl.bench.experiments.agreement` writes a table of it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from ssgi_cl.bench.every import TECHNIQUES, Array
from ssgi_cl.bench.self_test import NOT_IN_TIME, TEXELS, TOLERANCE, Results, computed, difference
from ssgi_cl.core.atomic import replacement
from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant

SIZE = (24, 40)
"""(rows, columns) of the images: some tiles and vectors, not all whole."""
QUICK = {"GALLIVM_PERF": "nopt"}
"""Variables that spare drivers minutes of compiling; Mesa's, the others don't know it."""
SINGLE = {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1", "LP_NUM_THREADS": "1"}
"""Variables that give drivers for CPUs one thread."""


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
        """Return what processes made within `limit` seconds of each technique, see `self_test.computed`."""
        variables = QUICK | (SINGLE if self.single else {})
        return computed(folder, self.device, self.variant, SIZE, limit=limit, variables=variables)


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
def main(output: Path, devices: tuple[str, ...], limit: float) -> None:
    """Run every technique on every device, compare and write a table.

    Drivers that are not installed for all can be named by OCL_ICD_VENDORS, a folder of .icd files.
    """
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
