"""The command `ssgi graph`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ssgi_cl.cli.frame_arguments import frame_arguments
from ssgi_cl.cli.render import render_command
from ssgi_cl.core.atomic import replacement
from ssgi_cl.frame.record import GraphRecord
from ssgi_cl.frame.render import render
from ssgi_cl.frame.skips import OUTPUTS, SKIPS, chosen_outputs
from ssgi_cl.io.console import checked_output, human_errors, printable, progress

WRITERS = {".dot": GraphRecord.to_dot, ".mmd": GraphRecord.to_mermaid, ".json": GraphRecord.to_json}
_NOT_SHARED = ("output", "views", "explain", "as_json", "scene", "cameras", "frames", "again", "scheduler")
"""Parameters of `ssgi render` that do not shape a frame, or that this command has itself."""


@click.command("graph")
@click.argument("scene", metavar="SCENE")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="The graph: .dot for Graphviz, .mmd for Mermaid, .json for all numbers.",
)
@click.option(
    "--outputs",
    metavar="NAMES",
    help="What the frame is to hold, separated by commas, "
    f"out of {', '.join(OUTPUTS)}; what they do not need is culled. By default image and "
    "radiance, and AO and indirect light where the image needs them.",
)
@click.option(
    "--again", is_flag=True, help="Draw the next frame of the same inputs, which reuses the results of the one before."
)
@human_errors
def graph_command(scene: str, output: Path, outputs: str | None, again: bool, **options: Any) -> None:
    """Render a frame of SCENE as `ssgi render` does, and draw its frame graph: the stages with
    their times, the device memory of each resource and the stages between which it is needed, and
    what was culled, skipped or reused and why. A stage that takes more than 25 % of the frame is a
    group of its kernels.

    Times are milliseconds on the device, beside those that the host spent in the stage. The JSON
    has the keys device, outputs, memory (bytes: used, peak, limit), stages and resources. A stage
    has name, state (ran, reused, idle, unneeded or culled), why, ms, host_ms, latest_ms, reads,
    hints, writes, passes and skips; a resource has name, device_bytes, given, output, kept, writer,
    and the first and last stage that touch it.
    """
    checked_output(output, tuple(WRITERS))
    names = None if outputs is None else [name.strip() for name in outputs.split(",")]
    chosen_outputs(names)
    skips = set(SKIPS) if again else set(SKIPS) - {"unchanged"}
    if options["no_skips"]:
        skips = set()
    with progress(False) as step:
        loaded, camera, lights, arguments = frame_arguments(scene, options, step)
        step("compiling kernels")
        render(loaded, camera, lights, outputs=names, skips=skips, **arguments)
        step("rendering")
        frame = render(loaded, camera, lights, outputs=names, skips=skips, **arguments)
        step("writing the file")
        text = WRITERS[output.suffix.lower()](frame.graph)
        with replacement(output) as path:
            path.write_text(text, encoding="utf-8")
    click.echo(printable(f"wrote {output}"))


graph_command.params += [option for option in render_command.params if option.name not in _NOT_SHARED]
