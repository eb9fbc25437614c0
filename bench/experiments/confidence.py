"""Calibration of `ao_confidence` against rays: `python -m ssgi_cl.bench.experiments.confidence --help`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import click
import numpy as np

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.rasterize.scenes import KINDS, make_scene
from ssgi_cl.techniques.ao.confidence import ao_confidence
from ssgi_cl.techniques.catalogue import CATALOGUE, of_kind
from ssgi_cl.tuning.context import Context, TruthSettings

OVERSCAN = 0.1
"""Of several layers."""
LAYERS = (1, 2, 4)
SURE = (0.9, 0.92, 0.94, 0.96)
"""Confidences from which on a pixel counts as sure."""


@dataclass(frozen=True)
class Counted:
    """Pixels of a view that are sure.

    Attributes:
        technique, layers, sure: what is computed, of how many depth layers, and the least confidence.
        pixels, seen: how many are sure, of how many that show a surface.
        squares: sum of the squared errors of A in them.
    """

    technique: str
    layers: int
    sure: float
    pixels: int
    seen: int
    squares: float


def counted(context: Context) -> Iterator[Counted]:
    """Yield the pixels of a view that are sure, of every technique, number of layers and limit."""
    truth, seen = context.occlusion().mean, context.seen
    for layers in LAYERS:
        drawn = gbuffer(
            context.view.scene,
            context.camera,
            layers=layers,
            overscan=OVERSCAN if layers > 1 else 0.0,
            thickness=True,
            runtime=context.runtime,
        )
        for entry in (CATALOGUE[name] for name in of_kind("ao")):
            a = entry.function(drawn, context.radius, runtime=context.runtime)
            confidence = ao_confidence(drawn, a, context.radius, runtime=context.runtime)
            for sure in SURE:
                where = seen & (confidence >= sure)
                squares = float(np.sum((a - truth)[where].astype(np.float64) ** 2))
                pixels = int(np.count_nonzero(where))
                yield Counted(entry.name, layers, sure, pixels, int(np.count_nonzero(seen)), squares)


def table(found: Sequence[Counted]) -> str:
    """Return a table of Markdown: a row a technique and number of layers, over the pixels of all views."""
    limits = sorted({one.sure for one in found})
    titles = "".join(f" {sure:g}: sure | RMSE |" for sure in limits)
    lines = [f"| | layers |{titles}", "|---|---:|" + "---:|---:|" * len(limits)]
    for name, layers in dict.fromkeys((one.technique, one.layers) for one in found):
        cells = []
        for sure in limits:
            own = [one for one in found if (one.technique, one.layers, one.sure) == (name, layers, sure)]
            pixels = sum(one.pixels for one in own)
            error = number((sum(one.squares for one in own) / pixels) ** 0.5) if pixels else "-"
            cells.append(f" {pixels / sum(one.seen for one in own):.0%} | {error} |")
        lines.append(f"| {name} | {layers} |{''.join(cells)}")
    return "\n".join(lines)


@click.command()
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(400, 401), show_default=True)
@click.option("--size", type=PixelSize(), default="320x240", show_default=True)
@click.option("--truth-rays", default=256, show_default=True, type=click.IntRange(2, 1 << 20))
@device_option
def main(
    kinds: tuple[str, ...], seeds: tuple[int, ...], size: tuple[int, int], truth_rays: int, device: str | None
) -> None:
    """Print the share of pixels that are sure on generated scenes, and the error of A in them."""
    runtime = Runtime.open(device)
    found: list[Counted] = []
    for name in (f"{kind}-{seed}" for kind in kinds for seed in seeds):
        found += counted(Context(runtime, make_scene(name), size, TruthSettings(rays=truth_rays)))
        click.echo(name, err=True)
    click.echo(table(found))


if __name__ == "__main__":
    main()
