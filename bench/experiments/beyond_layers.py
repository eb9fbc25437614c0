"""Rays where depth layers do not know, and their time: `python -m ssgi_cl.bench.experiments.beyond_layers --help`."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.wording import number
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import gbuffer as drawn
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.techniques.ao.confidence import ao_confidence
from ssgi_cl.techniques.filters.bilateral import bilateral_blur
from ssgi_cl.truth import metrics
from ssgi_cl.truth.ray_ao import RayAo
from ssgi_cl.tuning.context import Context, TruthSettings

T = TypeVar("T")
Floats = NDArray[np.float32]

LAYERS = (1, 2, 4)
OVERSCAN = 0.1
"""Of several layers."""
RAYS = (1, 4)
"""Of every pixel, blurred."""
BLUR_RADIUS, BLUR_DEPTH_SIGMA = 3, 0.002
"""Of the blur of rays, as techniques have it."""
SHARE = 0.1
"""Of the pixels, at most, that rays are cast for, those of the least confidence."""
RAYS_THERE = (8, 16, 64)
"""For each of them."""


@dataclass(frozen=True)
class Way:
    """A way to ambient occlusion in one view.

    Attributes:
        name: what is computed.
        error: RMSE against rays.
        ms: wall time of all that it takes: drawing, upload, search tree, download; 0 of what needs the reference.
    """

    name: str
    error: float
    ms: float


def timed(run: Callable[[], T], runs: int) -> tuple[T, float]:
    """Return what a function returns, and its median wall time in ms after a call that compiles."""
    result = run()
    took = []
    for _ in range(runs):
        start = time.perf_counter()
        result = run()
        took.append(1e3 * (time.perf_counter() - start))
    return result, median(took)


def rays_for(context: Context, surfaces: GBuffer, where: NDArray[np.bool_] | None, rays: int) -> Floats:
    """Return A by rays for some pixels or for all; the search tree is built anew."""
    chosen = copy(surfaces)
    if where is not None:
        rows, columns = surfaces.margin
        first = np.asarray(surfaces.first("depth"))
        depth = np.full_like(first, np.inf)
        inside = np.s_[rows : first.shape[0] - rows, columns : first.shape[1] - columns]
        depth[inside] = np.where(where, first[inside], np.inf)
        object.__setattr__(chosen, "depth", depth)
        object.__setattr__(chosen, "normal", surfaces.first("normal"))
        object.__setattr__(chosen, "thickness", None)
    caster = RayAo(context.view.scene)
    return caster(context.camera, context.radius, rays, gbuffer=chosen, estimate_error=False)[0]


def ways(context: Context, runs: int) -> list[Way]:
    """Return all ways in a view."""
    runtime, radius = context.runtime, context.radius
    truth, seen = context.occlusion().mean, context.seen
    found: list[Way] = []

    def add(name: str, a: Floats, ms: float) -> None:
        found.append(Way(name, metrics.rmse(a, truth, seen), ms))

    def surfaces(layers: int) -> GBuffer:
        overscan = OVERSCAN if layers > 1 else 0.0
        return drawn(
            context.view.scene, context.camera, layers=layers, overscan=overscan, thickness=True, runtime=runtime
        )

    single, drawing = timed(lambda: drawn(context.view.scene, context.camera, runtime=runtime), runs)
    for rays in RAYS:
        a, ms = timed(
            lambda rays=rays: bilateral_blur(  # type: ignore[misc]
                rays_for(context, single, None, rays),
                single,
                radius=BLUR_RADIUS,
                depth_sigma=BLUR_DEPTH_SIGMA,
                runtime=runtime,
            ),
            runs,
        )
        add(f"{rays} rays a pixel, blurred" if rays > 1 else "1 ray a pixel, blurred", a, drawing + ms)
    for layers in LAYERS:
        here = f"{layers} layers" if layers > 1 else "1 layer"
        layered, drawing = timed(lambda layers=layers: surfaces(layers), runs)  # type: ignore[misc]
        a, ms = timed(lambda layered=layered: bitmask_ao(layered, radius, runtime=runtime), runs)  # type: ignore[misc]
        add(here, a, drawing + ms)
        confidence, doubting = timed(
            lambda layered=layered, a=a: ao_confidence(layered, a, radius, runtime=runtime),  # type: ignore[misc]
            runs,
        )
        where = least(confidence, seen)
        for rays in RAYS_THERE:
            exact, casting = timed(
                lambda layered=layered, where=where, rays=rays: rays_for(  # type: ignore[misc]
                    context, layered, where, rays
                ),
                runs,
            )
            together = drawing + ms + doubting + casting
            add(f"{here}, {rays} rays where confidence is least", np.where(where, exact, a), together)
        add(f"{here}, the reference where confidence is least", np.where(where, truth, a), 0.0)
        worst = least(-np.abs(a - truth), seen)
        add(f"{here}, the reference where the error is greatest", np.where(worst, truth, a), 0.0)
    return found


def least(values: Floats, seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the share of pixels that have the least values, of those that show a surface."""
    count = min(int(SHARE * seen.size), int(np.count_nonzero(seen)))
    order = np.argsort(np.where(seen, values, np.inf), axis=None, kind="stable")[:count]
    where = np.zeros(seen.size, bool)
    where[order] = True
    return where.reshape(seen.shape)


def table(found: Sequence[Way]) -> str:
    """Return a table of Markdown: a row a way."""
    lines = ["| | RMSE | ms |", "|---|---:|---:|"]
    return "\n".join(
        [*lines, *(f"| {way.name} | {number(way.error)} | {f'{way.ms:.0f}' if way.ms else '-'} |" for way in found)]
    )


@click.command()
@click.option("--scene", default="hall", show_default=True)
@click.option("--size", type=PixelSize(), default="800x600", show_default=True)
@click.option("--truth-rays", default=512, show_default=True, type=click.IntRange(2, 1 << 20))
@click.option("--runs", default=3, show_default=True, type=click.IntRange(1))
@device_option
def main(scene: str, size: tuple[int, int], truth_rays: int, runs: int, device: str | None) -> None:
    """Print errors and wall times of rays, of layers, and of layers with rays for a tenth of the pixels."""
    context = Context(Runtime.open(device), make_scene(scene).views()[0], size, TruthSettings(rays=truth_rays))
    click.echo(table(ways(context, runs)))


if __name__ == "__main__":
    main()
