"""Sequences of frames on the command line: options, progress with the time left, and the report of each frame."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ssgi_cl.core.errors import SequenceError
from ssgi_cl.io.console import checked_output, printable
from ssgi_cl.sequences.cluster import connected
from ssgi_cl.sequences.frame_names import FrameNames, frame_range, gaps
from ssgi_cl.sequences.frame_result import FrameResult, FrameResults
from ssgi_cl.sequences.map_frames import map_frames

MOST_LISTED = 20
"""Failures and gaps that are printed, at most."""


def cameras_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --cameras, --fps, --history and --video."""
    for option in (
        click.option(
            "--video",
            metavar="FILE",
            type=click.Path(path_type=Path),
            help="Write the pictures of --cameras, .png, as an .mp4 file too (extra 'video').",
        ),
        click.option(
            "--history",
            is_flag=True,
            help="Reuse light of earlier frames of --cameras, which are then the frames of one shot, in their order.",
        ),
        click.option(
            "--fps",
            type=float,
            default=24.0,
            show_default=True,
            help="Frames a second of an animation in --cameras, and of --video.",
        ),
        click.option(
            "--cameras",
            "cameras",
            metavar="FILE",
            type=click.Path(path_type=Path),
            help="A picture for each camera of a JSON file: a list of such cameras, or an object that has it as "
            "'cameras'; or for each frame of an animation of a .glb or .gltf file, of the first camera that moves or "
            "of --camera. The output's name needs #### for their numbers, from 1 on.",
        ),
    ):
        command = option(command)
    return command


def frames_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --frames, --again and --scheduler."""
    for option in (
        click.option(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask distributed scheduler, such as tcp://host:8786, whose workers do the frames.",
        ),
        click.option("--again", is_flag=True, help="Do frames that are done already, too."),
        click.option(
            "--frames",
            metavar="RANGE",
            help="Frames of a sequence, such as 1-240 or 1-99x2,120; by default all there are.",
        ),
    ):
        command = option(command)
    return command


def run_frames(
    work: Callable[..., Any],
    names: FrameNames,
    output: Path,
    *,
    frames: str | None,
    again: bool,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Do the frames of a sequence and report them; exit with status 1 if any failed.

    Raises:
        click.UsageError: the output has no place for a number.
        SequenceError: there is no frame, or the cluster fails.
    """
    into = numbered(output, (".exr",), names)
    if into == names:
        raise click.UsageError(f"--output is {output}: those are the inputs; expected another name")
    numbers = frame_range(frames) if frames is not None else names.found()
    if not numbers:
        raise SequenceError(f"{names}: there is no such frame")
    missing = [] if frames is not None else gaps(numbers)
    if missing and not as_json:
        listed = ", ".join(map(str, missing[:MOST_LISTED])) + (" ..." if len(missing) > MOST_LISTED else "")
        click.echo(f"frames that are not there: {listed}", err=True)
    inputs, files = [names.path(n) for n in numbers], [into.path(n) for n in numbers]
    report_frames(work, inputs, files, again=again, scheduler=scheduler, as_json=as_json)


def numbered(output: Path, suffixes: tuple[str, ...], example: object) -> FrameNames:
    """Return the pattern of the outputs, before work is spent on it.

    Raises:
        click.UsageError: it has no place for a number, or another suffix.
        click.ClickException: its folder is not there.
    """
    names = FrameNames.of(output)
    if names is None:
        raise click.UsageError(
            f"--output is {output}: expected #### for the numbers of frames in its name, as in {example}"
        )
    checked_output(names.path(1), suffixes)
    return names


def report_frames(
    work: Callable[..., Any],
    inputs: Sequence[Any],
    files: Sequence[Path],
    *,
    again: bool,
    scheduler: str | None,
    as_json: bool,
) -> None:
    """Do frames and report them; exit with status 1 if any failed."""
    console, out = Console(stderr=True), sys.stdout  # which reading in another thread replaces for moments
    columns = (TextColumn("frames"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with ExitStack() as stack:
        bar = stack.enter_context(Progress(*columns, console=console, disable=as_json or not console.is_terminal))
        client = None if scheduler is None else stack.enter_context(connected(scheduler))
        task = bar.add_task("", total=len(inputs))

        def shown(finished: int, total: int, left: float) -> None:
            bar.update(task, completed=finished)

        def told(result: FrameResult) -> None:
            if as_json:
                print(json.dumps(_line(result)), file=out, flush=True)

        results = map_frames(work, inputs, files, client=client, again=again, progress=shown, finished=told)
    _summary(results, as_json)
    if results.failed:
        sys.exit(1)


def _line(result: FrameResult) -> dict[str, Any]:
    line: dict[str, Any] = {}
    if isinstance(result.input, (str, os.PathLike)):  # and no camera
        line["input"] = printable(result.name)
    line |= {"output": printable(str(result.output))}
    line |= {"state": result.state, "seconds": round(result.seconds, 4)}
    return {**line, "reason": printable(result.reason)} if result.reason else line


def _summary(results: FrameResults, as_json: bool) -> None:
    counts = {state: sum(each.state == state for each in results) for state in ("done", "skipped", "failed")}
    if as_json:
        print(json.dumps({"frames": len(results), **counts}), flush=True)
        return
    click.echo(f"{len(results)} frames: {', '.join(f'{count} {state}' for state, count in counts.items())}")
    for each in results.failed[:MOST_LISTED]:
        click.echo(printable(f"failed: {each.name}: {each.reason}"), err=True)
    if len(results.failed) > MOST_LISTED:
        click.echo(f"and {len(results.failed) - MOST_LISTED} more", err=True)
