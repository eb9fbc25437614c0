"""Options, errors in a line and progress of the benchmark's commands."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ssgi_cl.device.arrays import Size
from ssgi_cl.io.console import device_option, is_expected, json_option, one_line, printable

__all__ = [
    "PixelSize",
    "check_output",
    "device_option",
    "human_errors",
    "json_option",
    "meshes_option",
    "output_option",
    "own_option",
    "progress_bar",
    "scheduler_option",
    "seconds_option",
]


class PixelSize(click.ParamType[Size]):
    """COLUMNSxROWS on the command line, (rows, columns) within."""

    name = "COLUMNSxROWS"

    def convert(self, value: Any, param: Any, ctx: Any) -> Size:
        """Return (rows, columns)."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", value)
        sides = [int(side) for side in match.groups()] if match else [0]
        if not all(1 <= side <= 16384 for side in sides):
            self.fail(f"{value!r}: expected COLUMNSxROWS, 1 to 16384 pixels each", param, ctx)
        return sides[1], sides[0]


meshes_option = click.option(
    "--meshes",
    envvar="SSGI_CL_MESHES",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="The folder of the meshes of views such as those of docs/views; by default SSGI_CL_MESHES.",
)

output_option = click.option("-o", "--output", type=click.Path(path_type=Path), help="Write the results, .json.")
scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask distributed scheduler, such as tcp://host:8786, whose workers do scenes and sizes side by side.",
)
own_option = click.option("--own", is_flag=True, help="Leave out what other programs do.")


def seconds_option(default: float, most: float = 60.0) -> Callable[[Any], Any]:
    """Return the option `--seconds`, up to `most`."""
    return click.option(
        "--seconds",
        default=default,
        show_default=True,
        type=click.FloatRange(0.01, most),
        help="How long each case is repeated.",
    )


def check_output(path: Path | None, suffix: str) -> None:
    if path is None:
        return
    if path.suffix.lower() != suffix:
        raise click.UsageError(f"the file is {path}: expected a name that ends in {suffix}")
    if not path.parent.is_dir():
        raise click.ClickException(f"the file is {path}: there is no folder {path.parent}")


@contextmanager
def human_errors() -> Iterator[None]:
    """Show errors and warnings as a line each, without the place in the code."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        click.echo(f"warning: {' '.join(str(message).split())}", err=True)

    try:
        with warnings.catch_warnings():
            warnings.showwarning = show
            yield
    except (click.exceptions.Exit, click.Abort, click.ClickException):
        raise
    except Exception as error:
        if not is_expected(error):
            raise
        raise click.ClickException(printable(" ".join(one_line(error).split()))) from error


@contextmanager
def progress_bar() -> Iterator[Callable[[str, float], None]]:
    """Give a function that shows what is under way, how much is done and how long the rest takes.

    On a terminal, on standard error.
    """
    console = Console(stderr=True)
    with Progress(
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda text, share: progress.update(task, description=text, completed=share)
