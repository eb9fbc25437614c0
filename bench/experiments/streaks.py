"""Streaks of GTAO by blur and slices: `python -m ssgi_cl.bench.experiments.streaks --help`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Any

import click
import numpy as np

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import KINDS, make_scene
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.truth import metrics
from ssgi_cl.truth.ray_ao import RayAo
from ssgi_cl.tuning.context import Context

SETTINGS: dict[str, dict[str, Any]] = {
    "blur radius 2": {"blur_radius": 2},
    "blur radius 3 that cancels the tile": {},
    "blur radius 4, a wider Gaussian": {"blur_radius": 4},
    "3 slices, blur radius 2": {"slices": 3, "blur_radius": 2},
    "every other pixel": {"checkerboard": True},
}
"""Parameters that differ from the defaults."""
FRAMES = 64
"""Patterns of which the mean is what no pattern changes."""
BOX = "cornell_box"
BOX_RADIUS = 0.15
"""At which its stripes are seen best, scene units."""


@dataclass(frozen=True)
class Streaks:
    """A setting in one view.

    Attributes:
        setting: key in `SETTINGS`.
        error, ssim, streaks: of A against rays, see `metrics`.
        pattern: streaks against the mean of many patterns.
    """

    setting: str
    error: float
    ssim: float
    streaks: float
    pattern: float


def found(context: Context, radius: float, rays: int) -> list[Streaks]:
    """Return all settings in a view."""
    rays_a, rays_error = RayAo(context.view.scene)(context.camera, radius, rays, gbuffer=context.host_gbuffer)
    smooth = context.smooth_surfaces & context.seen
    noise = math.sqrt(float(np.mean(rays_error[smooth].astype(np.float64) ** 2))) if smooth.any() else 0.0
    result = []
    for name, choice in SETTINGS.items():
        technique = Gtao(context.runtime, context.size, GtaoParams(radius=radius, **choice))
        many = []
        for frame in range(FRAMES):
            technique.params = GtaoParams(radius=radius, frame=frame, **choice)
            many.append(technique(context.gbuffer).copy())
        a, even = many[0], np.mean(many, axis=0)
        result.append(
            Streaks(
                name,
                metrics.rmse(a, rays_a, context.seen),
                metrics.ssim(a, rays_a, context.seen),
                metrics.streaks(a, rays_a, smooth, noise=noise) if smooth.any() else math.nan,
                metrics.streaks(a, even, smooth) if smooth.any() else math.nan,
            )
        )
    return result


def table(all_found: Sequence[Streaks]) -> str:
    """Return a table of Markdown: a row a setting, means over the views."""
    lines = ["| | RMSE | SSIM | streaks | of the pattern |", "|---|---:|---:|---:|---:|"]
    for name in SETTINGS:
        own = [one for one in all_found if one.setting == name]
        lined = [one for one in own if math.isfinite(one.streaks)]
        streaks, pattern = (
            number(mean(getattr(one, what) for one in lined)) if lined else "-" for what in ("streaks", "pattern")
        )
        error, ssim = (mean(getattr(one, what) for one in own) for what in ("error", "ssim"))
        lines.append(f"| {name} | {number(error)} | {ssim:.3f} | {streaks} | {pattern} |")
    return "\n".join(lines)


@click.command()
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(400, 401), show_default=True)
@click.option("--size", type=PixelSize(), default="320x240", show_default=True)
@click.option("--rays", default=256, show_default=True, type=click.IntRange(8, 1 << 20))
@device_option
def main(kinds: tuple[str, ...], seeds: tuple[int, ...], size: tuple[int, int], rays: int, device: str | None) -> None:
    """Print RMSE, SSIM and streaks of GTAO in the Cornell box, and on generated scenes."""
    runtime = Runtime.open(device)
    box = Context(runtime, make_scene(BOX).views()[0], (300, 400))
    click.echo(f"{BOX}, radius {BOX_RADIUS:g}, 400 x 300\n\n{table(found(box, BOX_RADIUS, 2 * rays))}\n")
    collected: list[Streaks] = []
    for name in (f"{kind}-{seed}" for kind in kinds for seed in seeds):
        context = Context(runtime, make_scene(name).views()[0], size)
        collected += found(context, context.radius, rays)
        click.echo(name, err=True)
    click.echo(f"{len(kinds) * len(seeds)} generated scenes\n\n{table(collected)}")


if __name__ == "__main__":
    main()
