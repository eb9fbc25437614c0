"""The command line: `ssgi render`, `ssgi graph`, `ssgi apply`, `ssgi bench` and others.

A command's module is imported when the command is asked for: `ssgi --help` starts no part of the library.
"""

from __future__ import annotations

import logging
import sys
from difflib import get_close_matches
from importlib import import_module
from typing import NamedTuple

import click

from ssgi_cl.version import __version__


class _Entry(NamedTuple):
    """Where a command is, and its line in the list of commands."""

    module: str
    name: str
    summary: str


COMMANDS = {
    "apply": _Entry("ssgi_cl.cli.apply", "apply_command", "Apply TECHNIQUE to the G-buffer in IN.exr."),
    "bench": _Entry("ssgi_cl.bench.command", "bench_command", "Measure run time and error of CASES."),
    "devices": _Entry("ssgi_cl.cli.devices", "devices_command", "List OpenCL devices and the build of the kernels."),
    "doctor": _Entry(
        "ssgi_cl.cli.doctor", "doctor_command", "Say what of OpenCL works here, and how to mend the rest."
    ),
    "graph": _Entry("ssgi_cl.cli.graph", "graph_command", "Render a frame of SCENE and draw its frame graph."),
    "info": _Entry("ssgi_cl.cli.scene_info", "info_command", "Say what is in SCENE, without rendering it."),
    "render": _Entry("ssgi_cl.cli.render", "render_command", "Render SCENE to a picture or to an EXR file."),
    "truth": _Entry("ssgi_cl.bench.command", "truth_command", "Compute references of CASES and keep them."),
    "view": _Entry("ssgi_cl.cli.view", "view_command", "Show SCENE or a G-buffer in the browser."),
    "warmup": _Entry("ssgi_cl.cli.warmup", "warmup_command", "Compile the kernels, so that later commands need not."),
}
"""The commands by name."""


class _Commands(click.Group):
    """A group whose commands are imported when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        entry = COMMANDS.get(cmd_name)
        if entry is None:
            return None
        command: click.Command = getattr(import_module(entry.module), entry.name)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            near = get_close_matches(args[0], COMMANDS, 1)
            guess = f" Did you mean {near[0]!r}?" if near else f" There are {', '.join(COMMANDS)}."
            ctx.fail(f"No such command {args[0]!r}.{guess}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.summary) for name, entry in COMMANDS.items()])


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="ssgi")
def main() -> None:
    """Image-space global illumination on G-buffers, on any OpenCL device."""
    logger = logging.getLogger("ssgi_cl.compiling")
    if not any(isinstance(handler, _OnStandardError) for handler in logger.handlers):
        logger.addHandler(_OnStandardError(logging.INFO))
        logger.setLevel(logging.INFO)


class _OnStandardError(logging.Handler):
    """Prints records on what is standard error at that time."""

    def emit(self, record: logging.LogRecord) -> None:
        click.echo(record.getMessage(), err=True)


if __name__ == "__main__":
    sys.exit(main())
