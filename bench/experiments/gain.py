"""Gain of more samples: `python -m ssgi_cl.bench.experiments.gain --help`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ssgi_cl.bench.options import PixelSize, device_option, meshes_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import REPORTED
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of

from .cost import TECHNIQUES

MOST = 32
"""Slices that stand for samples without end."""


@dataclass(frozen=True)
class Gain:
    """Error of a technique against rays with its default slices, and with `MOST` everywhere.

    No choice of where to put some more samples errs less than as many everywhere, but for luck.

    Attributes:
        technique: key in `TECHNIQUES` of `cost`.
        scene: name of the view.
        usual, most: RMSE, blurred as by default.
    """

    technique: str
    scene: str
    usual: float
    most: float

    @property
    def share(self) -> float:
        """Part of the error that is gone with the most samples."""
        return 1.0 - self.most / self.usual


def gains(context: Context, names: Sequence[str], most: int = MOST) -> list[Gain]:
    """Return what techniques gain on a view.

    Args:
        context: the view, with its truth.
        names: keys of `TECHNIQUES` of `cost`.
        most: slices, in place of the defaults'.
    """
    truth = context.occlusion().mean
    settings: tuple[dict[str, Any], ...] = ({}, {"slices": most})
    found = []
    for name in names:
        make, kind = TECHNIQUES[name]
        usual, best = (
            metrics.rmse(
                make(context.runtime, context.size, kind(radius=context.radius, **more))(context.gbuffer),
                truth,
                context.seen,
            )
            for more in settings
        )
        found.append(Gain(name, context.view.name, usual, best))
    return found


def table(found: Sequence[Gain]) -> str:
    """Return gains as a table of Markdown: a row a technique and view."""
    lines = [f"| | scene | RMSE by default | with {MOST} slices | less by |", "|---|---|---:|---:|---:|"]
    lines += (
        f"| {gain.technique} | {gain.scene} | {number(gain.usual)} | {number(gain.most)} | {100.0 * gain.share:.1f} % |"
        for gain in found
    )
    return "\n".join(lines)


@click.command()
@click.option(
    "--scene", "scenes", multiple=True, default=REPORTED, show_default=True, metavar="NAME|FILE", help="Several times."
)
@meshes_option
@click.option("--size", type=PixelSize(), default="400x300", show_default=True)
@click.option(
    "--technique", "names", multiple=True, type=click.Choice(list(TECHNIQUES)), help="Several times; all without."
)
@device_option
@click.option("--truth-rays", default=512, show_default=True, type=click.IntRange(2, 1 << 20))
def main(
    scenes: tuple[str, ...],
    meshes: Path | None,
    size: tuple[int, int],
    names: tuple[str, ...],
    device: str | None,
    truth_rays: int,
) -> None:
    """Print by how much the error against rays sinks with far more samples in every pixel.

    That bounds what any importance map could gain that puts some more where it matters.
    """
    runtime = Runtime.open(device)
    try:
        views = views_of(scenes, runtime, meshes)
    except ValueError as error:
        raise click.ClickException(str(error)) from error
    found = [
        gain
        for view in views.values()
        for gain in gains(Context(runtime, view, size, TruthSettings(rays=truth_rays)), names or tuple(TECHNIQUES))
    ]
    click.echo(table(found))


if __name__ == "__main__":
    main()
