"""The command `ssgi view`."""

from __future__ import annotations

from pathlib import Path

import click

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io.console import device_option, human_errors, printable, progress


@click.command("view")
@click.argument("source", metavar="SCENE|FILE")
@click.option("--host", default="localhost", show_default=True, help="Address to listen to. Any other lets others in.")
@click.option(
    "--port", type=click.IntRange(1, 65535), default=8080, show_default=True, help="The next free one is taken."
)
@click.option(
    "--environment",
    "environments",
    multiple=True,
    metavar="PATH",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="A latitude-longitude image (.exr, .hdr) to choose in the page; several times. The page reads no other file.",
)
@device_option
@human_errors
def view_command(source: str, host: str, port: int, environments: tuple[Path, ...], device: str | None) -> None:
    """Show SCENE, or the G-buffer in FILE (.exr, .npz), in the browser, with controls for every parameter.

    SCENE is as of `ssgi render`. The address of the page is printed; Ctrl-C ends it.
    """
    from ssgi_cl.cli.frame_arguments import check_scene
    from ssgi_cl.viewer.gbuffer_file import ENDINGS
    from ssgi_cl.viewer.view import view

    if Path(source).suffix.lower() not in ENDINGS:
        check_scene(source)
    with progress(False) as step:
        step(f"opening {source}")
        window = view(source, environments=environments, host=host, port=port, runtime=Runtime.open(device))
    for note in window.source.notes:
        click.echo(printable(f"note: {note}"), err=True)
    click.echo(f"{source} at {window.url} (Ctrl-C ends it)")
    window.wait()
    window.close()
