"""Streaks of ambient occlusion by blur and slices: `python -m ssgi_cl.bench.experiments.streaks --help`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import KINDS, make_scene
from ssgi_cl.techniques.ao.slices import ScanParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.truth import metrics
from ssgi_cl.truth.layers import layered_occlusion
from ssgi_cl.truth.ray_ao import RayAo
from ssgi_cl.tuning.context import Context

SCANS = [name for name, each in TECHNIQUES.items() if issubclass(each.params, ScanParams)]
"""Techniques that scan slices."""
SETTINGS: dict[str, dict[str, Any]] = {
    "blur radius 2": {"blur_radius": 2},
    "blur radius 3 that cancels the tile": {"blur_radius": 3},
    "blur radius 4, a wider Gaussian": {"blur_radius": 4},
    "3 slices, blur radius 2": {"slices": 3, "blur_radius": 2},
    "every other pixel, blur radius 3": {"checkerboard": True, "blur_radius": 3},
}
"""Parameters that differ from the defaults."""
FLOOR = "rays against the layer"
"""Error of all that the depth layer holds; techniques that guess what is behind it may get below."""
FRAMES = 64
"""Patterns of which the mean is what no pattern changes."""
BOX = "cornell_box"
BOX_RADIUS = 0.15
"""At which its stripes are seen best, scene units."""


@dataclass(frozen=True)
class Streaks:
    """A setting in one view.

    Attributes:
        setting: key in `SETTINGS`, or `FLOOR`.
        error, ssim: of A against rays, see `metrics`.
        flip, streaks: on smooth surfaces.
        pattern: streaks against the mean of many patterns.
    """

    setting: str
    error: float
    ssim: float
    flip: float
    streaks: float
    pattern: float


def found(context: Context, technique_name: str, radius: float, rays: int) -> list[Streaks]:
    """Return all settings of a technique in a view, and the floor."""
    kind, params = TECHNIQUES[technique_name].technique, TECHNIQUES[technique_name].params
    rays_a, rays_error = RayAo(context.view.scene)(context.camera, radius, rays, gbuffer=context.host_gbuffer)
    smooth = context.smooth_surfaces & context.seen
    noise = math.sqrt(float(np.mean(rays_error[smooth].astype(np.float64) ** 2))) if smooth.any() else 0.0
    plain = smooth.any()

    def judged(name: str, a: NDArray[np.float32], even: NDArray[np.float32] | None = None) -> Streaks:
        return Streaks(
            name,
            metrics.rmse(a, rays_a, context.seen),
            metrics.ssim(a, rays_a, context.seen),
            metrics.flip(a, rays_a, smooth) if plain else math.nan,
            metrics.streaks(a, rays_a, smooth, noise=noise) if plain else math.nan,
            metrics.streaks(a, even, smooth) if plain and even is not None else math.nan,
        )

    result = [judged(FLOOR, layered_occlusion(context.host_gbuffer, radius, rays).mean)]
    for name, choice in SETTINGS.items():
        technique = kind(context.runtime, context.size, params(radius=radius, **choice))
        many = []
        for frame in range(FRAMES):
            technique.params = params(radius=radius, frame=frame, **choice)
            many.append(technique(context.gbuffer).copy())
        result.append(judged(name, many[0], np.mean(many, axis=0)))
    return result


def table(all_found: Sequence[Streaks]) -> str:
    """Return a table of Markdown: a row a setting, means over the views in which it has a value."""
    lines = ["| | RMSE | SSIM | FLIP, smooth | streaks | of the pattern |", "|---|---:|---:|---:|---:|---:|"]
    for name in (FLOOR, *SETTINGS):
        own = [one for one in all_found if one.setting == name]

        def shown(what: str, own: Sequence[Streaks] = own) -> str:
            known = [value for value in (getattr(one, what) for one in own) if math.isfinite(value)]
            return number(mean(known)) if known else "-"

        ssim = mean(one.ssim for one in own)
        lines.append(
            f"| {name} | {shown('error')} | {ssim:.3f} | {shown('flip')} | {shown('streaks')} | {shown('pattern')} |"
        )
    return "\n".join(lines)


@click.command()
@click.option("--technique", type=click.Choice(SCANS), default="gtao", show_default=True)
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(400, 401), show_default=True)
@click.option("--size", type=PixelSize(), default="320x240", show_default=True)
@click.option("--rays", default=256, show_default=True, type=click.IntRange(8, 1 << 20))
@device_option
def main(
    technique: str, kinds: tuple[str, ...], seeds: tuple[int, ...], size: tuple[int, int], rays: int, device: str | None
) -> None:
    """Print errors and streaks of ambient occlusion in the Cornell box, and on generated scenes.

    The floor is the error of rays against the layer alone.
    """
    runtime = Runtime.open(device)
    box = Context(runtime, make_scene(BOX).views()[0], (300, 400))
    click.echo(f"{BOX}, radius {BOX_RADIUS:g}, 400 x 300\n\n{table(found(box, technique, BOX_RADIUS, 2 * rays))}\n")
    collected: list[Streaks] = []
    for name in (f"{kind}-{seed}" for kind in kinds for seed in seeds):
        context = Context(runtime, make_scene(name).views()[0], size)
        collected += found(context, technique, context.radius, rays)
        click.echo(name, err=True)
    click.echo(f"{len(kinds) * len(seeds)} generated scenes\n\n{table(collected)}")


if __name__ == "__main__":
    main()
