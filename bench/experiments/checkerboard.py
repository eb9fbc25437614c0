"""Error over time of scans of every other pixel: `python -m ssgi_cl.bench.experiments.checkerboard --help`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import click

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.scene_sets import MESH_VIEWS, VIEWS
from ssgi_cl.bench.wording import number
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import KINDS, REPORTED
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of
from ssgi_cl.tuning.trials import geometric_mean

TWICE_GTAO = {"checkerboard": True, "blur_radius": 3, "taps": 16}
"""Parameters of `bitmask_ao` that take about twice the time of GTAO."""


@dataclass(frozen=True)
class Setting:
    """What is measured.

    Attributes:
        kind, params: class of the technique, and of its parameters.
        choice: parameters that differ from the defaults.
        thickness: whether that of closed surfaces is drawn.
    """

    kind: type[OcclusionTechnique]
    params: type[Any]
    choice: dict[str, Any] = field(default_factory=dict)
    thickness: bool = False


SETTINGS = {
    "ssao": Setting(Ssao, SsaoParams),
    "hbao": Setting(Hbao, HbaoParams),
    "gtao": Setting(Gtao, GtaoParams),
    "gtao, 4 slices, 12 taps": Setting(Gtao, GtaoParams, {"slices": 4, "taps": 12}),
    "gtao, checkerboard": Setting(Gtao, GtaoParams, {"checkerboard": True}),
    "bitmask_ao": Setting(BitmaskAo, BitmaskParams),
    "bitmask_ao, 9 taps": Setting(BitmaskAo, BitmaskParams, {"taps": 9}),
    "bitmask_ao, 1 slice, blur radius 3": Setting(BitmaskAo, BitmaskParams, {"slices": 1, "blur_radius": 3}),
    "bitmask_ao, half size, blur at full size": Setting(
        BitmaskAo, BitmaskParams, {"resolution": "half", "blur_resolution": "full"}
    ),
    "bitmask_ao, checkerboard": Setting(BitmaskAo, BitmaskParams, {"checkerboard": True}),
    "bitmask_ao, checkerboard, blur radius 3": Setting(
        BitmaskAo, BitmaskParams, {"checkerboard": True, "blur_radius": 3}
    ),
    "bitmask_ao, checkerboard, blur radius 3, 16 taps": Setting(BitmaskAo, BitmaskParams, TWICE_GTAO),
    "bitmask_ao, thickness": Setting(BitmaskAo, BitmaskParams, {}, thickness=True),
    **{
        f"bitmask_ao, thickness, checkerboard, blur radius 3, {taps} taps": Setting(
            BitmaskAo, BitmaskParams, {**TWICE_GTAO, "taps": taps}, thickness=True
        )
        for taps in (16, 12, 9)
    },
    "bitmask_ao, thickness, half size, blur at full size": Setting(
        BitmaskAo, BitmaskParams, {"resolution": "half", "blur_resolution": "full"}, thickness=True
    ),
}
WITHOUT_VIEWS = (
    "bunny/stanford-bunny.obj",
    "japanese_garden/japanese_garden.glb",
    "spot/spot_triangulated.obj",
    "teapot/teapot.obj",
)
"""Meshes that are measured with their own camera, or one that sees all of them."""
FIRST, USUAL = "gtao", "bitmask_ao"
"""The setting whose time, and the one whose error the others are compared with."""


@dataclass(frozen=True)
class Found:
    """A setting in one view.

    Attributes:
        setting: key in `SETTINGS`.
        scene: name of the view.
        error: RMSE against rays.
        ms: processor time of the technique with its blur, median.
        drawn_ms: the same with drawing.
    """

    setting: str
    scene: str
    error: float
    ms: float
    drawn_ms: float


def found(context: Context, runs: int) -> list[Found]:
    """Return all settings in a view, their times measured in turn."""
    runtime = context.runtime
    rasterizers = {thickness: Rasterizer(runtime, context.size, thickness=thickness) for thickness in (False, True)}

    def draw(*, thickness: bool) -> DeviceGBuffer:
        with runtime.frame():
            target = rasterizers[thickness].render(device_scene(context.view.scene, runtime), context.camera)
            target.derive()
        runtime.finish()
        return target

    made = {
        name: setting.kind(runtime, context.size, setting.params(radius=context.radius, **setting.choice))
        for name, setting in SETTINGS.items()
    }
    truth = context.occlusion().mean
    # Compiles and allocates.
    results = {name: made[name](draw(thickness=setting.thickness)) for name, setting in SETTINGS.items()}
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in made}
    for _ in range(runs):
        for name, technique in made.items():
            start = time.process_time()
            gbuffer = draw(thickness=SETTINGS[name].thickness)
            drawn = time.process_time()
            with runtime.frame():
                technique.run(gbuffer)
            runtime.finish()
            end = time.process_time()
            times[name].append((1e3 * (end - drawn), 1e3 * (end - start)))
    return [
        Found(
            name,
            context.view.name,
            metrics.rmse(a, truth, context.seen),
            median(alone for alone, _ in times[name]),
            median(whole for _, whole in times[name]),
        )
        for name, a in results.items()
    ]


def table(all_found: Sequence[Found]) -> str:
    """Return a table of Markdown: a row a setting, geometric means over the views."""
    lines = [
        "| | RMSE | of bitmask_ao's | greatest | greatest of the best's | time of GTAO's | with drawing |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    by = {(one.setting, one.scene): one for one in all_found}
    scenes = list(dict.fromkeys(one.scene for one in all_found))
    best = {scene: min(one.error for one in all_found if one.scene == scene) for scene in scenes}
    for name in SETTINGS:
        own = [by[name, scene] for scene in scenes]
        errors = [one.error / by[USUAL, one.scene].error for one in own]
        of_best = max(one.error / best[one.scene] for one in own)
        alone = [one.ms / by[FIRST, one.scene].ms for one in own]
        drawn = [one.drawn_ms / by[FIRST, one.scene].drawn_ms for one in own]
        lines.append(
            f"| {name} | {number(geometric_mean([one.error for one in own]))} | {geometric_mean(errors):.3f} | "
            f"{max(errors):.2f} | {of_best:.2f} | {geometric_mean(alone):.2f} | {geometric_mean(drawn):.2f} |"
        )
    return "\n".join(lines)


@click.command()
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(620, 621), show_default=True)
@click.option("--meshes", type=click.Path(path_type=Path), help="Folder of meshes to measure in their place.")
@click.option("--size", type=PixelSize(), default="640x480", show_default=True)
@click.option("--truth-rays", default=128, show_default=True, type=click.IntRange(2, 1 << 20))
@click.option("--runs", default=5, show_default=True, type=click.IntRange(1))
@device_option
def main(
    kinds: tuple[str, ...],
    seeds: tuple[int, ...],
    meshes: Path | None,
    size: tuple[int, int],
    truth_rays: int,
    runs: int,
    device: str | None,
) -> None:
    """Print errors and times of one-layer scans of all pixels, and of every other one, on generated scenes."""
    runtime = Runtime.open(device)
    names = [f"{kind}-{seed}" for kind in kinds for seed in seeds]
    if meshes is not None:
        views = (str(VIEWS / f"{name}.json") for name in MESH_VIEWS)
        names = [*views, *REPORTED, *(str(meshes / name) for name in WITHOUT_VIEWS)]
    collected: list[Found] = []
    for name in names:  # one after the other: a mesh is large
        for view in views_of((name,), runtime, meshes).values():
            context = Context(runtime, view.views()[0], size, TruthSettings(rays=truth_rays))
            collected += found(context, runs)
            own = [one for one in collected if one.scene == context.view.name]
            errors = ", ".join(f"{one.setting}: {number(one.error)}" for one in own)
            click.echo(f"{context.view.name}: {errors}", err=True)
    click.echo(table(collected))


if __name__ == "__main__":
    main()
