"""What data on where surfaces end are worth to `bitmask_ao`: `python -m ssgi_cl.bench.experiments.thickness --help`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import click

from ssgi_cl import truth
from ssgi_cl.bench.options import PixelSize, device_option, meshes_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, downloaded, margin_of
from ssgi_cl.rasterize.scenes import KINDS
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskParams
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of
from ssgi_cl.tuning.trials import geometric_mean

OVERSCAN = 0.1
"""Of several layers."""
LAYERS = (1, 2, 4)


@dataclass(frozen=True)
class Worth:
    """Errors of one view and number of layers, against rays.

    Attributes:
        scene: name of the view.
        layers: of depth.
        floor, guessed, known: RMSE of rays against the layers, and of `bitmask_ao` by default, without and with the
            thickness that the rasteriser draws.
    """

    scene: str
    layers: int
    floor: float
    guessed: float
    known: float


class Drawn:
    """A view's G-buffer, and `bitmask_ao` of it, drawn anew in each call.

    Args:
        context: the view.
        layers: of depth.
        thickness: whether that is drawn too.
        taps: of a side of a slice where it is; by default those of `BitmaskParams`.
        overscan: share of the image on every side.
    """

    def __init__(
        self, context: Context, layers: int, *, thickness: bool, taps: int | None = None, overscan: float = 0.0
    ) -> None:
        self._context = context
        margin = margin_of(context.camera, overscan)
        self._rasterizer = Rasterizer(context.runtime, context.size, layers=layers, margin=margin, thickness=thickness)
        params = BitmaskParams(radius=context.radius)
        if thickness and taps is not None:
            params = replace(params, taps=taps)
        self._technique = BitmaskAo(context.runtime, context.size, params, margin, layers=layers)

    def draw(self) -> DeviceGBuffer:
        """Draw the G-buffer and return it."""
        context = self._context
        with context.runtime.frame():
            target = self._rasterizer.render(device_scene(context.view.scene, context.runtime), context.camera)
            target.derive()
        return target

    def error(self) -> float:
        """Return the RMSE against rays."""
        context = self._context
        return metrics.rmse(self._technique(self.draw()), context.occlusion().mean, context.seen)

    def floor(self) -> float:
        """Return the RMSE of rays against the layers."""
        context = self._context
        found = truth.layered_occlusion(downloaded(self.draw()), context.radius, context.truths.rays)
        return metrics.rmse(found.mean, context.occlusion().mean, context.seen)

    def cpu_ms(self) -> float:
        """Return the processor time of drawing and `bitmask_ao` together, in ms."""
        start = time.process_time()
        self._technique(self.draw())
        self._context.runtime.finish()
        return 1e3 * (time.process_time() - start)


def worth(context: Context, layers: int, taps: int | None = None) -> Worth:
    """Return what thickness is worth in a view; `taps` as of `Drawn`."""
    overscan = OVERSCAN if layers > 1 else 0.0
    guessed, known = (Drawn(context, layers, thickness=given, taps=taps, overscan=overscan) for given in (False, True))
    return Worth(context.view.name, layers, guessed.floor(), guessed.error(), known.error())


def ratios(context: Context, runs: int, taps: int | None = None) -> tuple[float, float]:
    """Return the time with one layer and thickness, and with two layers, over that with one layer.

    Processor time, the three measured one after the other; medians of the ratios of so many runs. `taps` as of `Drawn`.
    """
    one, thick, two = (
        Drawn(context, layers, thickness=given, taps=taps) for layers, given in ((1, False), (1, True), (2, False))
    )
    for each in (one, thick, two):
        each.cpu_ms()  # compiles and allocates
    found = []
    for _ in range(runs):
        base = one.cpu_ms()
        found.append((thick.cpu_ms() / base, two.cpu_ms() / base))
    return median(first for first, _ in found), median(second for _, second in found)


def table(found: Sequence[Worth]) -> str:
    """Return a table of Markdown: a row a number of layers, geometric means over the scenes."""
    lines = [
        "| layers | floor | guessed | of the floor | known | of the floor | greatest | scene |",
        "|---|---:|---:|---:|---:|---:|---:|---|",
    ]
    for layers in sorted({one.layers for one in found}):
        own = [one for one in found if one.layers == layers]
        floor, guessed, known = (
            geometric_mean([getattr(one, name) for one in own]) for name in ("floor", "guessed", "known")
        )
        most = max(own, key=lambda one: one.known / one.floor)
        lines.append(
            f"| {layers} | {number(floor)} | {number(guessed)} | {guessed / floor:.2f} | {number(known)} | "
            f"{known / floor:.2f} | {most.known / most.floor:.2f} | {most.scene} |"
        )
    return "\n".join(lines)


@click.command()
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(400, 401, 402), show_default=True)
@click.option("--scene", "scenes", multiple=True, help="In place of generated ones; as of `ssgi bench`. Several times.")
@meshes_option
@click.option("--size", type=PixelSize(), default="320x240", show_default=True)
@click.option("--truth-rays", default=256, show_default=True, type=click.IntRange(2, 1 << 20))
@click.option("--runs", default=0, show_default=True, help="Measure times in so many runs, and no errors.")
@click.option("--taps", type=click.IntRange(1, 64), help="Where thickness is known; by default as many as without.")
@device_option
def main(
    kinds: tuple[str, ...],
    seeds: tuple[int, ...],
    scenes: tuple[str, ...],
    meshes: Path | None,
    size: tuple[int, int],
    truth_rays: int,
    runs: int,
    taps: int | None,
    device: str | None,
) -> None:
    """Print the error of `bitmask_ao` with guessed and with known ends of surfaces, on generated scenes by default.

    The floor is the error of rays against the layers alone.
    """
    runtime = Runtime.open(device)
    found = []
    names = scenes or tuple(f"{kind}-{seed}" for kind in kinds for seed in seeds)
    for name, view in views_of(names, runtime, meshes).items():
        context = Context(runtime, view, size, TruthSettings(rays=truth_rays))
        if runs:
            thick, two = ratios(context, runs, taps)
            click.echo(f"{name}: time of one layer with thickness {thick:.2f}, of two layers {two:.2f} of one layer's")
            continue
        for layers in LAYERS:
            found.append(worth(context, layers, taps))
            one = found[-1]
            errors = ", ".join(number(error) for error in (one.floor, one.guessed, one.known))
            click.echo(f"{name}, {layers} layers: floor, guessed, known: {errors}", err=True)
    if found:
        click.echo(table(found))


if __name__ == "__main__":
    main()
