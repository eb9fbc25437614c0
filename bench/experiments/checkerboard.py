"""Error over time of scans of every other pixel: `python -m ssgi_cl.bench.experiments.checkerboard --help`."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import click

from ssgi_cl.bench.options import PixelSize, device_option
from ssgi_cl.bench.scene_sets import MESH_VIEWS, VIEWS
from ssgi_cl.bench.wording import number
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import KINDS, REPORTED
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of
from ssgi_cl.tuning.trials import geometric_mean

SETTINGS: dict[str, tuple[type[OcclusionTechnique], type[Any], dict[str, Any]]] = {
    "gtao": (Gtao, GtaoParams, {}),
    "gtao, checkerboard": (Gtao, GtaoParams, {"checkerboard": True}),
    "bitmask_ao": (BitmaskAo, BitmaskParams, {}),
    "bitmask_ao, 9 taps": (BitmaskAo, BitmaskParams, {"taps": 9}),
    "bitmask_ao, 1 slice, blur radius 3": (BitmaskAo, BitmaskParams, {"slices": 1, "blur_radius": 3}),
    "bitmask_ao, half size, blur at full size": (
        BitmaskAo,
        BitmaskParams,
        {"resolution": "half", "blur_resolution": "full"},
    ),
    "bitmask_ao, checkerboard": (BitmaskAo, BitmaskParams, {"checkerboard": True}),
    "bitmask_ao, checkerboard, blur radius 3": (BitmaskAo, BitmaskParams, {"checkerboard": True, "blur_radius": 3}),
    "bitmask_ao, checkerboard, blur radius 3, 16 taps": (
        BitmaskAo,
        BitmaskParams,
        {"checkerboard": True, "blur_radius": 3, "taps": 16},
    ),
}
"""Class, parameters and those of them that differ from the defaults."""
FIRST, USUAL = "gtao", "bitmask_ao"
"""The setting whose time, and the one whose error the others are compared with."""


@dataclass(frozen=True)
class Found:
    """A setting in one view.

    Attributes:
        setting: key in `SETTINGS`.
        scene: name of the view.
        error: RMSE against rays.
        ms: processor time of a frame of the technique, median, without drawing and copies.
    """

    setting: str
    scene: str
    error: float
    ms: float


def found(context: Context, runs: int) -> list[Found]:
    """Return all settings in a view, their times measured in turn."""
    runtime, gbuffer = context.runtime, context.gbuffer
    made = {
        name: kind(runtime, context.size, params(radius=context.radius, **choice))
        for name, (kind, params, choice) in SETTINGS.items()
    }
    truth = context.occlusion().mean
    results = {name: technique(gbuffer) for name, technique in made.items()}  # compiles and allocates
    times: dict[str, list[float]] = {name: [] for name in made}
    for _ in range(runs):
        for name, technique in made.items():
            start = time.process_time()
            with runtime.frame():
                technique.run(gbuffer)
            runtime.finish()
            times[name].append(1e3 * (time.process_time() - start))
    return [
        Found(name, context.view.name, metrics.rmse(a, truth, context.seen), median(times[name]))
        for name, a in results.items()
    ]


def table(all_found: Sequence[Found]) -> str:
    """Return a table of Markdown: a row a setting, geometric means over the views."""
    lines = ["| | RMSE | of bitmask_ao's | greatest | time of GTAO's |", "|---|---:|---:|---:|---:|"]
    by = {(one.setting, one.scene): one for one in all_found}
    scenes = list(dict.fromkeys(one.scene for one in all_found))
    for name in SETTINGS:
        own = [by[name, scene] for scene in scenes]
        errors = [one.error / by[USUAL, one.scene].error for one in own]
        times = [one.ms / by[FIRST, one.scene].ms for one in own]
        lines.append(
            f"| {name} | {number(geometric_mean([one.error for one in own]))} | {geometric_mean(errors):.3f} | "
            f"{max(errors):.2f} | {geometric_mean(times):.2f} |"
        )
    return "\n".join(lines)


@click.command()
@click.option("--kind", "kinds", multiple=True, default=tuple(KINDS), show_default=True, help="Several times.")
@click.option("--seed", "seeds", multiple=True, type=int, default=(600, 601), show_default=True)
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
        names = [*(str(VIEWS / f"{name}.json") for name in MESH_VIEWS), *REPORTED]
    collected: list[Found] = []
    for name in names:  # one after the other: a mesh is large
        for view in views_of((name,), runtime, meshes).values():
            context = Context(runtime, view.views()[0], size, TruthSettings(rays=truth_rays))
            collected += found(context, runs)
            click.echo(context.view.name, err=True)
    click.echo(table(collected))


if __name__ == "__main__":
    main()
