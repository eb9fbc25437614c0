"""The commands `ssgi bench` and `ssgi truth`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
from rich.console import Console

from ssgi_cl.core.atomic import replacement
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import REPORTED
from ssgi_cl.truth import store
from ssgi_cl.tuning.context import TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of

from . import compare, document, farm, first_run, suite, summary, table
from .cases import FAMILIES, OWN
from .options import (
    PixelSize,
    check_output,
    device_option,
    human_errors,
    json_option,
    meshes_option,
    output_option,
    own_option,
    progress_bar,
    scheduler_option,
    seconds_option,
)
from .plot import require_plots
from .verdict import mark

F = TypeVar("F", bound=Callable[..., Any])


def _samples(name: str, default: int, meaning: str) -> Callable[[F], F]:
    """Return an option of a number of samples of a truth, by its name in `TruthSettings`."""
    bounds = click.IntRange(2, 1 << 20)
    return click.option(f"--truth-{name}", name, default=default, show_default=True, type=bounds, help=meaning)


_CASES = (
    click.argument("patterns", nargs=-1, metavar="[CASE...]"),
    click.option(
        "--scene",
        "scenes",
        multiple=True,
        metavar="NAME|FILE",
        default=REPORTED,
        show_default=True,
        help="A built-in scene, a mesh, or a view: a .json file with mesh, camera (as of `ssgi render "
        "--camera`) and ao_radius; several times.",
    ),
    meshes_option,
    click.option(
        "--size",
        "sizes",
        multiple=True,
        type=PixelSize(),
        default=("800x600",),
        show_default=True,
        help="Of the image in pixels; several times.",
    ),
    device_option,
    _samples("rays", 512, "Rays per pixel of true occlusion."),
    _samples("paths", 256, "Paths per pixel of true light."),
    _samples("points", 512, "Points per pixel of what a screen-space technique converges to."),
    click.option(
        "--attenuation",
        default="none",
        show_default=True,
        type=click.Choice(["none", "linear", "quadratic", "exponential"]),
        help="How true occlusion fades with distance.",
    ),
)
"""Argument and options that say which cases, and what they are held to."""


def _takes_cases(command: F) -> F:
    for decorate in reversed(_CASES):
        command = decorate(command)
    return command


@click.command("bench")
@_takes_cases
@click.option("--lanes", type=int, help="Force 1, 8 or 16 lanes.")
@click.option("--storage", type=click.Choice(["buffer", "image"]), help="Force what kernels read.")
@seconds_option(1.0, most=600.0)
@click.option("--no-errors", is_flag=True, help="Measure times only.")
@own_option
@scheduler_option
@output_option
@click.option(
    "--markdown", type=click.Path(path_type=Path), help="Write a summary, .md, with plots and pictures beside it."
)
@click.option("--list", "only_list", is_flag=True, help="List the cases and measure nothing.")
@click.option(
    "--compare",
    "compared",
    nargs=2,
    type=click.Path(path_type=Path),
    metavar="BEFORE.json AFTER.json",
    help="Tell what got slower or worse beyond noise; exit status 1 if anything did.",
)
@click.option(
    "--report",
    is_flag=True,
    help="Report a first run on a device instead: agreement with stored results, and each kernel's time beside its "
    "prediction; of the first --size. Exit status 1 if a technique differs.",
)
@json_option
def bench_command(
    patterns: tuple[str, ...],
    scenes: tuple[str, ...],
    meshes: Path | None,
    sizes: tuple[Size, ...],
    device: str | None,
    lanes: int | None,
    storage: str | None,
    seconds: float,
    no_errors: bool,
    own: bool,
    scheduler: str | None,
    output: Path | None,
    markdown: Path | None,
    only_list: bool,
    compared: tuple[Path, Path] | None,
    report: bool,
    as_json: bool,
    **truths: Any,
) -> None:
    """Measure run time against error.

    A CASE is family.setting.scene.COLUMNSxROWS, such as ssao.16.hall.800x600; * and ? stand for
    any characters, and later parts may be left out: `ssao`, `'ssao*.16'`. Without any, all are
    measured. Truths are made once and kept (see `ssgi truth`). `ssgi bench frame
    mitsuba-frame-oidn` measures whole frames beside a path tracer.

    With --scheduler one worker of each machine measures, that with the resource MACHINE=1, a scene
    at a size at a time; machines must be alike.
    """
    if compared:
        _compare(*compared)
        return
    for path, suffix in ((output, ".json"), (markdown, ".md")):
        check_output(path, suffix)
    if report:
        with human_errors():
            runtime = Runtime.open(device, lanes=lanes, storage=storage)
        _report(runtime, sizes[0], output, markdown, as_json)
        return
    families = OWN if own else FAMILIES
    with human_errors():
        if markdown is not None:
            require_plots()  # before anything is measured
        runtime = Runtime.open(device, lanes=lanes, storage=storage)
        views = views_of(scenes, runtime, meshes)
        cases = suite.select(patterns, list(views), sizes, families)
        if only_list:
            for case in cases:
                click.echo(case.name)
            return
        settings, errors = TruthSettings(**truths), not no_errors
        with progress_bar() as step:
            if scheduler is None:
                found = suite.measure(
                    cases,
                    views,
                    runtime,
                    truths=settings,
                    seconds=seconds,
                    errors=errors,
                    families=families,
                    report=step,
                )
                stamp = document.stamp(runtime)
            else:
                places = farm.places_of(cases, dict(zip(views, scenes, strict=True)))
                asked = farm.Asked(
                    settings,
                    device,
                    meshes,
                    lanes=lanes,
                    storage=storage,
                    seconds=seconds,
                    errors=errors,
                    pictures=markdown is not None,
                )
                stamp, found = farm.measure(scheduler, places, asked, step)
        mark(found.results)
        doc = {**stamp, **suite.entries(found, settings, seconds)}
        if output is not None:
            document.write(output, doc)
        if markdown is not None:
            summary.write(markdown, doc, found.pictures)
    if as_json:
        click.echo(document.text(doc))
    else:
        table.show(doc, Console())
    if found.interrupted:
        kept = f"; {len(found.results)} of {len(cases)} cases are kept" if found.results else ""
        click.echo(f"Aborted!{kept}", err=True)
        sys.exit(130)
    if not found.results:
        reasons = sorted({entry["reason"] for entry in found.skipped})
        click.echo(f"Error: nothing was measured: {'; '.join(reasons)}", err=True)
        sys.exit(1)
    for path in (output, markdown):
        if path is not None:
            click.echo(f"wrote {path}", err=True)


def _report(runtime: Runtime, size: Size, output: Path | None, markdown: Path | None, as_json: bool) -> None:
    """Make the report of a first run, print it and write it."""
    with human_errors():
        with progress_bar() as step:
            found = first_run.first_run(runtime, size, step)
        page = first_run.page(found)
        if output is not None:
            document.write(output, found)
        if markdown is not None:
            with replacement(markdown) as file:
                file.write_text(page, encoding="utf-8")
    click.echo(document.text(found) if as_json else page, nl=False)
    if first_run.failing(found):
        sys.exit(1)


@click.command("truth")
@_takes_cases
@scheduler_option
@click.option("--rebuild", is_flag=True, help="Make them anew, in place of those that are kept.")
@click.option("--list", "only_list", is_flag=True, help="List what is kept, and its size.")
@click.option("--clear", is_flag=True, help="Delete what is kept.")
@json_option
def truth_command(
    patterns: tuple[str, ...],
    scenes: tuple[str, ...],
    meshes: Path | None,
    sizes: tuple[Size, ...],
    device: str | None,
    scheduler: str | None,
    rebuild: bool,
    only_list: bool,
    clear: bool,
    as_json: bool,
    **truths: Any,
) -> None:
    """Make the truths that the benchmark's cases are held to, and keep them.

    Takes cases as `ssgi bench` does. A run that is interrupted goes on where it stopped. Exit
    status 1 if any could not be made. With --scheduler workers make them, a scene at a size a
    task; they keep them in the same folder, which SSGI_CL_CACHE names.
    """
    with human_errors():
        if clear:
            click.echo(f"freed {store.clear() / 2**20:.1f} MiB in {store.truth_folder()}")
            return
        if not only_list:
            runtime = Runtime.open(device)
            views = views_of(scenes, runtime, meshes)
            settings = TruthSettings(**truths, rebuild=rebuild)
            cases = suite.select(patterns, list(views), sizes)
            with progress_bar() as step:
                if scheduler is None:
                    wrong = suite.make_truths(cases, views, runtime, settings, report=step)
                else:
                    places = farm.places_of(cases, dict(zip(views, scenes, strict=True)))
                    wrong = farm.make_truths(scheduler, places, farm.Asked(settings, device, meshes), step)
        else:
            wrong = []
        _list_truths(as_json)
        for text in wrong:
            click.echo(text, err=True)
        if wrong:
            sys.exit(1)


def _list_truths(as_json: bool) -> None:
    entries = store.stored()
    if as_json:
        files = [{"file": str(entry.path), "bytes": entry.bytes, "description": entry.description} for entry in entries]
        click.echo(json.dumps(files, indent=1))
        return
    for entry in entries:
        click.echo(f"{entry.path.name}  {entry.bytes / 2**20:.1f} MiB  {_size_text(entry)}")
    total = sum(entry.bytes for entry in entries)
    click.echo(f"{len(entries)} files, {total / 2**20:.1f} MiB in {store.truth_folder()}")


def _size_text(entry: store.Stored) -> str:
    if entry.description is None:
        return "unreadable"
    rows, columns = entry.description["camera"]["size"]
    return f"{columns} x {rows}{', not finished' if '.partial' in entry.path.suffixes else ''}"


def _compare(before: Path, after: Path) -> None:
    with human_errors():
        comparison = compare.compare(document.read(before), document.read(after))
    compare.show(comparison, Console())
    if comparison.failed:
        sys.exit(1)
