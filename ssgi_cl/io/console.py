"""Shared parts of the commands: options, error messages, progress, the report at the end."""

from __future__ import annotations

import json
import math
import os
import re
import resource
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from difflib import get_close_matches
from functools import wraps
from io import StringIO
from pathlib import Path
from threading import Lock
from typing import Any, Protocol

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ssgi_cl.core import checks
from ssgi_cl.core.errors import KernelBuildError, SsgiError, shown
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime

DEFAULT_FOV = 50.0
"""Degrees, vertical."""


_SILENT = Lock()


@contextmanager
def silent() -> Iterator[None]:
    """Let nothing be printed meanwhile to `sys.stdout`, which is that of all threads: one does so at a time."""
    with _SILENT, redirect_stdout(StringIO()):
        yield


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """A number of bytes, such as 4GiB, 512MiB or 2000000000."""

    name = "BYTES"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        found = re.fullmatch(r"(\d+(?:\.\d+)?) *([KMGT]i?B?)?", str(value).strip(), re.IGNORECASE)
        if found is None:
            self.fail(f"{shown(str(value))}: expected a number of bytes, such as 4GiB or 512MiB", param, ctx)
        unit = (found[2] or "").upper()
        base = 1024 if "I" in unit or len(unit) == 1 else 1000
        return int(float(found[1]) * base ** (" KMGT".index(unit[:1] or " ")))


memory_option = click.option(
    "--max-memory",
    type=Bytes(),
    help="Memory for the image at most, such as 4GiB: larger ones are read, computed and written by bands of rows.",
)
device_option = click.option(
    "--device",
    metavar="WORDS",
    help="Words of the device's label, such as 'pocl 3.1'; by default SSGI_CL_DEVICE, else the fastest found.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
VECTOR: dict[str, Any] = {"nargs": 3, "type": float, "metavar": "X Y Z"}


def human_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the library's errors into one line (a compiler's log apart) and exit status 1."""

    @wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except Exception as error:
            # A broken pipe: whoever reads the output has gone, such as `head`.
            ends = BrokenPipeError, click.exceptions.Exit, click.Abort, click.ClickException
            if isinstance(error, ends) or not is_expected(error):
                raise
            raise click.ClickException(printable(one_line(error))) from error

    return run


def is_expected(error: Exception) -> bool:
    """Return whether a command may meet the error; any other is a fault of the program."""
    kinds = (SsgiError, ValueError, TypeError, OSError, MemoryError, RecursionError)
    return isinstance(error, kinds) or _is_opencl(error)


def _is_opencl(error: Exception) -> bool:
    module = sys.modules.get("pyopencl")  # imported with the first device
    return module is not None and isinstance(error, module.Error)


def one_line(error: Exception) -> str:
    """Return what is said of an error: one line, but for a compiler's log."""
    if isinstance(error, KernelBuildError):
        return str(error)
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{os.fsdecode(error.filename)}: {error.strerror}"
    first, *rest = str(error).splitlines() or [type(error).__name__]
    text = " ".join([first, "; ".join(line.strip() for line in rest)]).strip()
    if _is_opencl(error):
        text = f"the OpenCL driver failed: {text}"
    elif isinstance(error, MemoryError):
        text = f"out of memory: {text}"
    elif isinstance(error, RecursionError):
        text = f"nested too deeply: {text}"
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if (_is_opencl(error) or isinstance(error, MemoryError)) and most != resource.RLIM_INFINITY:
        text += f" (ulimit -v allows the process {most / 2**20:.0f} MiB)"
    return text


def printable(text: str) -> str:
    """Return text with bytes of file names that are not UTF-8 as \\xNN."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


class Step(Protocol):
    """Names the step under way, and tells the share of it that is done where that is known."""

    def __call__(self, text: str, share: float | None = None) -> None: ...


@contextmanager
def progress(silent: bool) -> Iterator[Step]:
    """Give a function that names the step under way; shown on a terminal, on standard error."""
    console = Console(stderr=True)
    columns = SpinnerColumn(), TextColumn("{task.description}"), BarColumn(20), TimeElapsedColumn()
    hidden = silent or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        task = progress.add_task("", total=None)

        def step(text: str, share: float | None = None) -> None:
            total = None if share is None else 1.0
            progress.update(task, description=escape(printable(text)), completed=share or 0.0, total=total)
            # Rich takes None for no change.
            progress.tasks[0].total = total

        yield step


def checked_output(path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise if `path` has another suffix or can't be written, before work is spent on it."""
    if path.suffix.lower() not in suffixes:
        raise click.UsageError(f"--output is {path}: expected a name that ends in {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise click.ClickException(f"--output is {path}: there is no folder {path.parent}")
    if path.is_dir():
        raise click.ClickException(f"--output is {path}: it is a folder, expected a file's name")
    folder = os.path.dirname(os.path.realpath(path))  # of the file itself, which is replaced
    if not os.access(folder, os.W_OK | os.X_OK):
        raise click.ClickException(f"--output is {path}: no file can be made in the folder {folder}")


def yfov_of(options: dict[str, Any], default: float) -> float:
    """Return the vertical field of view in radians."""
    if options["fov"] is None:
        return default
    degrees = checks.number("--fov", options["fov"], low=0.01, high=179.0, unit="degrees")
    return math.radians(degrees)


def wrapped(text: str, indent: str) -> str:
    width = max(40, min(100, shutil.get_terminal_size().columns))
    return textwrap.fill(
        text, width, initial_indent=indent, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


class GroupedCommand(click.Command):
    """A command whose help lists options under headings.

    Args:
        groups: heading -> names of its options, as the command's function has them; what is in none comes last,
            under "Other options".
    """

    def __init__(self, *args: Any, groups: Mapping[str, Sequence[str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        options = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        lines = {option.name: line for option in options if (line := option.get_help_record(ctx)) is not None}
        named = {name for names in self.groups.values() for name in names}
        rest = [name for name in lines if name not in named]
        for heading, names in (*self.groups.items(), ("Other options", rest)):
            listed = [lines[name] for name in names if name in lines]
            if listed:
                with formatter.section(heading):
                    formatter.write_dl(listed)


class NearestChoice(click.Choice):  # type: ignore[type-arg]  # no generic before click 8.2
    """One of some names; a misspelt one is answered with the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        near = get_close_matches(str(value), self.choices, 1)
        if value not in self.choices and near:
            listed = ", ".join(map(repr, self.choices))
            self.fail(f"{value!r} is not one of {listed}; did you mean {near[0]!r}?", param, ctx)
        return super().convert(value, param, ctx)


def report(
    as_json: bool,
    runtime: Runtime,
    passes: Sequence[PassTime],
    files: list[Path],
    facts: dict[str, Any],
    *,
    explain: bool = False,
) -> None:
    """Print what ran; with `explain` also what was left out, why, and what that saves."""
    if as_json:
        entries = [
            {"name": p.name, "ms": round(p.ms, 4), "skipped": p.skipped or None, "saved_ms": round(p.saved, 4)}
            for p in passes
        ]
        about = {**facts, "device": runtime.info.label, "variant": str(runtime.variant), "passes": entries}
        print(json.dumps({**about, "files": [printable(str(path)) for path in files]}, indent=1))
        return
    click.echo(f"{runtime.info.label}, {runtime.variant}")
    table = Table("pass", "ms")
    table.columns[1].justify = "right"
    for name, (count, ms, skipped) in _merged(passes).items():
        label = f"{name} x {count}" if count > 1 else name
        table.add_row(label, f"{ms:.2f}" if not skipped else f"skipped: {skipped}")
    table.add_section()
    table.add_row("sum", f"{sum(p.ms for p in passes):.2f}")
    console = Console()
    console.print(table)
    if explain:
        console.print(_explanation(passes))
    if "exposure" in facts:
        click.echo(f"exposure {facts['exposure']:.4g}")
    for note in facts.get("notes", ()):
        console.print(printable(note), highlight=False, markup=False)
    for path in files:
        console.print(printable(f"wrote {path}"), highlight=False, markup=False)


def _explanation(passes: Sequence[PassTime]) -> Table:
    """Return the table of what was left out."""
    table = Table("left out", "why", "saves ms, by estimate")
    table.columns[2].justify = "right"
    left_out = [p for p in passes if p.skipped]
    for p in left_out:
        table.add_row(p.name, p.skipped, f"{p.saved:.2f}" if p.saved else "not known")
    table.add_section()
    ran, saved = (sum(times) for times in ((p.ms for p in passes), (p.saved for p in left_out)))
    table.add_row("sum", f"beside {ran:.2f} ms that ran", f"{saved:.2f}")
    return table


def _merged(passes: Sequence[PassTime]) -> dict[str, tuple[int, float, str]]:
    """Return name -> (count, milliseconds, why skipped) in order of first appearance."""
    merged: dict[str, tuple[int, float, str]] = {}
    for p in passes:
        count, ms, _ = merged.get(p.name, (0, 0.0, ""))
        merged[p.name] = (count + 1, ms + p.ms, p.skipped)
    return merged
