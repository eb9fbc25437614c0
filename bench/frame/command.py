"""The command `ssgi bench frame`."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from ssgi_cl.bench import document as documents
from ssgi_cl.bench.options import (
    PixelSize,
    check_output,
    device_option,
    human_errors,
    meshes_option,
    output_option,
    own_option,
    progress_bar,
)
from ssgi_cl.bench.peers import mitsuba_frame
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.files.load import READERS
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.tuning.measured_scenes import views_of

from . import report
from .ablation import ablation
from .measure import measure, reference, variants
from .modes import DEFAULT, MODES


@click.command("frame")
@click.option(
    "--scene",
    "scenes",
    multiple=True,
    metavar="NAME|FILE",
    help="A built-in scene, a mesh or a view, as of `ssgi bench`; several times. By "
    "default all that are built in, and with --meshes each mesh of the folder.",
)
@meshes_option
@click.option("--size", type=PixelSize(), default="800x600", show_default=True, help="Of the image in pixels.")
@device_option
@click.option(
    "--mode",
    "modes",
    multiple=True,
    type=click.Choice(list(MODES)),
    help="Of our frames; several times, by default all.",
)
@click.option(
    "--samples",
    multiple=True,
    type=click.IntRange(1, 4096),
    default=mitsuba_frame.SAMPLES,
    show_default=True,
    help="Per pixel of the path tracer that frames are compared with; several times.",
)
@own_option
@click.option(
    "--frames",
    default=5,
    show_default=True,
    type=click.IntRange(1, 1000),
    help="With a moving camera, whose median time is taken.",
)
@click.option(
    "--truth-paths",
    default=1024,
    show_default=True,
    type=click.IntRange(2, 1 << 20),
    help="Paths per pixel of the reference.",
)
@click.option(
    "--ablation",
    "ablate",
    is_flag=True,
    help="Replace the terms of our frames by those of the reference, one at a time.",
)
@click.option(
    "--strips",
    type=click.Path(path_type=Path, file_okay=False),
    help="Write pictures there: frame, reference, error, path tracer, its error.",
)
@output_option
@click.option("--markdown", type=click.Path(path_type=Path), help="Write the tables, .md.")
def frame_command(
    scenes: tuple[str, ...],
    meshes: Path | None,
    size: Size,
    device: str | None,
    modes: tuple[str, ...],
    samples: tuple[int, ...],
    own: bool,
    frames: int,
    truth_paths: int,
    ablate: bool,
    strips: Path | None,
    output: Path | None,
    markdown: Path | None,
) -> None:
    """Measure whole frames: wall time against FLIP and relative MSE, beside a path tracer.

    The reference is `ssgi_cl.truth.radiance` with all bounces and pixels as boxes. FLIP is of
    pictures by one tone curve, with the reference's exposure.
    """
    for path, suffix in ((output, ".json"), (markdown, ".md")):
        check_output(path, suffix)
    chosen = {name: MODES[name] for name in modes or MODES}
    found = []
    with human_errors():
        runtime = Runtime.open(device)
        names = scenes or [*BUILTIN_SCENES, *(mesh_names(meshes) if meshes else ())]
        views = [one for view in views_of(names, runtime, meshes).values() for one in variants(view)]
        if strips is not None:
            strips.mkdir(parents=True, exist_ok=True)
        stamp = documents.stamp(runtime)
        click.echo(headline(stamp))
        with progress_bar() as step:
            for view in views:
                expected = reference(view, size, truth_paths, step)
                rows, skipped = measure(
                    view,
                    size,
                    runtime,
                    expected.mean,
                    frames=frames,
                    modes=chosen,
                    samples=() if own else samples,
                    progress=step,
                )
                mean = float(expected.mean.mean())
                noise = float(np.mean(expected.error)) / mean if mean > 0.0 else 0.0
                result = report.SceneResult(view.name, size, noise, rows, skipped)
                if ablate:
                    for name in modes or (DEFAULT,):
                        result.ablations[name] = ablation(
                            view, size, runtime, MODES[name], paths=truth_paths, progress=step
                        )
                if strips is not None:
                    report.write_strips(strips, view.name, rows, expected.mean)
                found.append(result)
                click.echo(report.markdown([result], "").lstrip())
        if output is not None:
            documents.write(output, report.document(found, stamp))
        if markdown is not None:
            text = report.markdown(found, headline(stamp))
            markdown.write_text(text, encoding="utf-8")
    for path in (output, markdown):
        if path is not None:
            click.echo(f"wrote {path}", err=True)


def headline(stamp: dict[str, object]) -> str:
    """Return machine, device and revision in a line."""
    machine, device = (dict(stamp[name]) for name in ("machine", "device"))  # type: ignore[call-overload]
    return f"{device['label']}; {machine['cpu']}, {machine['threads']} threads; {stamp['created']}"


def mesh_names(folder: Path) -> list[str]:
    """Return the meshes in the folders of a folder; of the views in docs/views these instead."""
    views = sorted(Path("docs/views").glob("*.json"))
    texts = {view: view.read_text(encoding="utf-8") for view in views}
    names = []
    for mesh in sorted(path for path in folder.glob("*/*") if path.suffix.lower() in READERS):
        if mesh.stem.endswith(".relative"):  # the same once more, for tests of readers
            continue
        shown = [view for view, text in texts.items() if f'"{mesh.relative_to(folder)}"' in text]
        names.append(str(shown[0] if shown else mesh))
    return names
