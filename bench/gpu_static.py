"""What every kernel takes of graphics processors: `python -m ssgi_cl.bench.gpu_static --help`.

Kernels are those of `built`, as the library builds them for a device with 1 lane, on buffers and on images, and
compiled for devices that need not be there (`gpu_compile`). Of the variants of a kernel the worst figures count.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import click

from ssgi_cl.core.atomic import replacement
from ssgi_cl.device import sources
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.programs import defines
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.signature import PLANE

from .built import Build, builds
from .gpu_compile import AMD, INTEL, NVIDIA, WARP_STEP, Usage, missing, usages, versions

ROOT = Path(__file__).parents[1]
RECORD = ROOT / "docs/figures/gpu.json"
PAGE = ROOT / "docs/gpu.md"
STORAGES = ("buffer", "image")
IMAGE_ROWS = 1 << 14
"""Rows of an image, as many as nearly all graphics processors have."""
STEP = {AMD: 1, **dict.fromkeys(NVIDIA, WARP_STEP), INTEL: 1}
"""Of `Usage.resident`: falling by so much counts."""

DEVICES = (AMD, *NVIDIA, INTEL)

Table = dict[str, dict[str, Usage]]
"""Kernel and storage, such as "gtao, buffer" -> device -> the worst of its variants."""


def worst(each: Iterable[Usage]) -> Usage:
    """Return the worst figures of some variants, each by itself."""
    listed = [asdict(usage) for usage in each]
    choice = {name: min if name in ("resident", "most") else max for name in listed[0]}
    return Usage(**{name: choose(one[name] for one in listed) for name, choose in choice.items()})


def gpu_builds() -> tuple[Build, ...]:
    """Return all kernels as they are built for a GPU with 1 lane; the default device runs them in its place."""
    return builds(Runtime.open(lanes=1, storage="buffer"), "gpu")


def table(made: Iterable[Build], wanted: Sequence[str] = ()) -> Iterator[tuple[str, dict[str, Usage]]]:
    """Yield what each kernel takes in either storage; of those `wanted` alone, if any are."""
    by_path: dict[str, list[Build]] = {}
    for build in made:
        if not wanted or Path(build.path).stem in wanted:
            by_path.setdefault(build.path, []).append(build)
    running: dict[tuple[object, ...], Future[dict[str, Usage]]] = {}
    rows: list[tuple[str, list[Future[dict[str, Usage]]]]] = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for path, each in sorted(by_path.items()):
            for storage in STORAGES:
                row = []
                for build in each:
                    text, defined = _source(build, storage)
                    key = (text, *defined.items())
                    if key not in running:
                        running[key] = pool.submit(usages, Path(path).stem, text, defined)
                    row.append(running[key])
                rows.append((f"{Path(path).stem}, {storage}", row))
        for name, row in rows:
            found: dict[str, list[Usage]] = {}
            for future in row:
                for device, usage in future.result().items():
                    found.setdefault(device, []).append(usage)
            yield name, {device: worst(listed) for device, listed in found.items()}


def _source(build: Build, storage: str) -> tuple[str, dict[str, int]]:
    """Return text and macros of a kernel in a storage; one without planes reads no images, whatever the storage."""
    planes = any(parameter.type == PLANE for parameter in build.kernel.signature.parameters)
    images = storage == "image" and planes
    defined = defines(KernelVariant(1, "image" if images else "buffer"), build.macros, IMAGE_ROWS if images else None)
    return sources.flatten(build.path, "\n".join(struct.text for struct in build.structs)), defined


def worse(found: Mapping[str, Mapping[str, Usage]], recorded: Mapping[str, Mapping[str, Usage]]) -> list[str]:
    """Return what is worse than recorded: more spills or scratch, or fewer resident by a step.

    Kernels without a record may have neither spills nor scratch, and have to fill half of a device.
    """
    lines = []
    for kernel, devices in found.items():
        for device, now in devices.items():
            half = Usage(0, 0, 0, now.most // 4 if device == INTEL else now.most // 2, now.most)
            before = recorded.get(kernel, {}).get(device, half)
            for figure in ("spills", "scratch"):
                if getattr(now, figure) > getattr(before, figure):
                    lines.append(
                        f"{kernel} on {device}: {figure} {getattr(now, figure)}, before {getattr(before, figure)}"
                    )
            if now.resident <= before.resident - STEP[device]:
                lines.append(f"{kernel} on {device}: resident {now.resident} of {now.most}, before {before.resident}")
    return lines


def recorded(path: Path = RECORD) -> tuple[dict[str, str], Table]:
    """Return the versions of compilers of the record, and its table."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    return kept["versions"], {
        kernel: {device: Usage(**figures) for device, figures in devices.items()}
        for kernel, devices in kept["kernels"].items()
    }


def markdown(found: Mapping[str, Mapping[str, Usage]]) -> str:
    """Return the table: for each kernel AMD, the worst of NVIDIA's, Intel; buffers / images where they differ."""
    heads = ("registers", "spills", "scratch", "resident")
    lines = [
        "| kernel | AMD registers | scalar | spills | scratch | waves of 16 | NVIDIA registers | spills | scratch "
        "| % of warps | Intel lanes | spills | scratch |",
        "|---|" + "---:|" * 12,
    ]
    names = sorted({kernel.rsplit(",", 1)[0] for kernel in found})
    rows = []
    for name in names:
        columns: list[list[int]] = []
        for storage in STORAGES:
            devices = found.get(f"{name}, {storage}", {})
            amd, intel = devices.get(AMD), devices.get(INTEL)
            nvidia = [devices[arch] for arch in NVIDIA if arch in devices]
            cells = [-1] * 12
            if amd:
                cells[:5] = [amd.registers, amd.scalars, amd.spills, amd.scratch, amd.resident]
            if nvidia:
                most = worst(nvidia)
                share = min(100 * each.resident // each.most for each in nvidia)
                cells[5:9] = [*(getattr(most, head) for head in heads[:3]), share]
            if intel:
                cells[9:] = [intel.resident, intel.spills, intel.scratch]
            columns.append(cells)
        shown = ["-" if a < 0 else str(a) if a == b else f"{a} / {b}" for a, b in zip(*columns, strict=True)]
        rows.append((-columns[0][3] - columns[0][7], name, shown))
    return "\n".join([*lines, *(f"| {name} | {' | '.join(shown)} |" for _, name, shown in sorted(rows))]) + "\n"


@click.command()
@click.option("--kernel", "kernels", multiple=True, help="Only this kernel; several.")
@click.option("--record", is_flag=True, help="Keep the figures in docs/figures/gpu.json, and make docs/gpu.md.")
def main(kernels: tuple[str, ...], record: bool) -> None:
    """Compile every kernel for graphics processors, and print what they take; takes some minutes.

    The exit status is 1 if a kernel is worse than recorded. Compilers that are missing are named and left out.
    """
    for device in DEVICES:
        if missing(device):
            click.echo(f"{device} is left out: {missing(device)} is missing", err=True)
            if record:
                raise click.UsageError("--record needs all compilers")
    found: Table = {}
    for name, devices in table(gpu_builds(), kernels):
        found[name] = devices
        click.echo(name, err=True)
    click.echo(markdown(found), nl=False)
    if record:
        _keep({**recorded()[1], **found} if kernels else found)
    elif lines := worse(found, recorded()[1]):
        raise click.ClickException("worse than recorded:\n" + "\n".join(lines))


def _keep(found: Table) -> None:
    """Write the record and the page."""
    kernels = {name: {device: asdict(each[device]) for device in each} for name, each in sorted(found.items())}
    text = json.dumps({"versions": versions(), "kernels": kernels}, indent=1)
    with replacement(RECORD) as file:
        # A line for each kernel and device, so that changes are read easily.
        file.write_text(re.sub(r"\{\s+(\"registers[^}]*)\}", _one_line, text) + "\n", encoding="utf-8")
    block = re.compile(r"(<!-- table -->\n).*?(<!-- end -->)", re.DOTALL)
    page = block.sub(lambda match: match[1] + markdown(found) + match[2], PAGE.read_text(encoding="utf-8"))
    with replacement(PAGE) as file:
        file.write_text(page, encoding="utf-8")


def _one_line(match: re.Match[str]) -> str:
    return "{" + re.sub(r"\s+", " ", match[1]).strip() + "}"


if __name__ == "__main__":
    main()
