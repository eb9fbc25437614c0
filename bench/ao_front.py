"""Record what `ssgi_cl.ao` chooses from beside the presets of techniques: `python -m ssgi_cl.bench.ao_front --help`.

Scans of every other pixel, the bitmask where the rasteriser draws the ends of solids, and drawing. Times are ratios to
that of GTAO's defaults, measured in turn, on processors in processor time: a busy machine changes them little.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import click

from ssgi_cl.core.atomic import replacement
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, margin_of
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.ao.occlusion import prepared_for
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.presets.front import SCANS, scans
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.trials import geometric_mean
from ssgi_cl.tuning.tunables import described
from ssgi_cl.version import __version__

from .options import device_option, progress_bar
from .presets import written_as
from .scene_sets import OVERSCAN, SceneSets

LAYERS = (1, 2, 4)
OTHERS = {"checkerboard": True, "blur_radius": 3}
"""Of scans of every other pixel."""


@dataclass(frozen=True)
class Setting:
    """A setting of a technique that is recorded.

    Attributes:
        technique: its name.
        parameters: that differ from the defaults.
        thickness: whether the G-buffer has it.
    """

    technique: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    thickness: bool = False


USUAL = Setting("gtao")
"""What times are ratios to."""
SETTINGS = (
    *(Setting("gtao", {"slices": slices, "checkerboard": True}) for slices in (1, 2)),
    *(
        Setting("bitmask_ao", {"slices": slices, "taps": 16, **OTHERS}, thickness)
        for thickness in (False, True)
        for slices in (1, 2, 3, 4)
    ),
    *(Setting("bitmask_ao", {"slices": slices}, thickness=True) for slices in (1, 2, 4, 8)),
    Setting("bitmask_ao", {"resolution": "half", "blur_resolution": "full"}, thickness=True),
)


def taken_ms(runtime: Runtime, run: Callable[[], object]) -> float:
    """Return the processor time of a run on a processor, else the device's."""
    if runtime.info.kind == "cpu":
        start = time.process_time()
        run()
        runtime.finish()
        return 1e3 * (time.process_time() - start)
    with runtime.frame():
        run()
        return sum(entry.ms for entry in runtime.times())


def _runner(setting: Setting, gbuffer: DeviceGBuffer, radius: float) -> Callable[[], Any]:
    kind = TECHNIQUES[setting.technique]
    technique = prepared_for(kind.technique, gbuffer, kind.params(radius=radius, **setting.parameters))
    return lambda: technique.run(gbuffer)


def errors(contexts: Sequence[Context], settings: Sequence[Setting], layers: int, overscan: float) -> list[float]:
    """Return the geometric mean of the RMSE over views, of each setting."""
    found: list[list[float]] = []
    for context in contexts:
        truth, drawn = context.occlusion().mean, _drawn(context, layers, overscan)
        own = []
        for setting in settings:
            with context.runtime.frame():
                a = _runner(setting, drawn[setting.thickness], context.radius)().download()[0]
            own.append(metrics.rmse(a, truth, context.seen))
        found.append(own)
    return [geometric_mean(each) for each in zip(*found, strict=True)]


def times(contexts: Sequence[Context], settings: Sequence[Setting], layers: int, runs: int) -> list[float]:
    """Return the time of each setting over that of `USUAL`, all measured in turn; of sums over the views."""
    every = (USUAL, *settings)
    sums = [0.0 for _ in every]
    for context in contexts:
        drawn = _drawn(context, layers, OVERSCAN)
        calls = [_runner(setting, drawn[setting.thickness], context.radius) for setting in every]
        sums = [before + own for before, own in zip(sums, _medians(context.runtime, calls, runs), strict=True)]
    return [own / sums[0] for own in sums[1:]]


def drawing(contexts: Sequence[Context], layers: int, overscan: float, runs: int) -> tuple[float, float]:
    """Return the times of drawing without thickness and with it over that of `USUAL` with one layer, medians over the
    views; all are measured in turn."""
    found = []
    for context in contexts:
        scene = device_scene(context.view.scene, context.runtime)

        def draw(rasterizer: Rasterizer, scene: Any = scene, context: Context = context) -> None:
            rasterizer.render(scene, context.camera).derive()

        calls = [_runner(USUAL, context.layered(1, OVERSCAN), context.radius)]
        for thickness in (False, True):
            rasterizer = _rasterizer(context, layers, overscan, thickness=thickness)
            calls.append(partial(draw, rasterizer))
        usual, *drawn = _medians(context.runtime, calls, runs)
        found.append([own / usual for own in drawn])
    without, with_it = (median(own) for own in zip(*found, strict=True))
    return without, with_it


def _medians(runtime: Runtime, calls: Sequence[Callable[[], object]], runs: int) -> list[float]:
    """Return the median time of each call, all of them measured in turn; of several runs after the first."""
    took: list[list[float]] = [[] for _ in calls]
    for number in range(runs + 1):
        for own, call in zip(took, calls, strict=True):
            ms = taken_ms(runtime, call)
            if number:
                own.append(ms)
    return [median(own) for own in took]


def _rasterizer(context: Context, layers: int, overscan: float, *, thickness: bool) -> Rasterizer:
    margin = margin_of(context.camera, overscan)
    return Rasterizer(context.runtime, context.size, layers=layers, margin=margin, thickness=thickness)


def _drawn(context: Context, layers: int, overscan: float) -> dict[bool, DeviceGBuffer]:
    """Return a view's G-buffers without thickness and with it."""
    return {given: context.layered(layers, overscan, thickness=given) for given in (False, True)}


def settings_of(sets: SceneSets, layers: int, ratios: Sequence[float]) -> Iterator[dict[str, Any]]:
    """Yield the record of each setting, whose times over GTAO's are given, for a number of layers."""
    tuning, validation = sets.contexts["tuning"], sets.contexts["validation"]
    whole, cut = (errors(tuning, SETTINGS, layers, overscan) for overscan in (OVERSCAN, 0.0))
    other = errors(validation, SETTINGS, layers, OVERSCAN)
    for number, setting in enumerate(SETTINGS):
        yield {
            "technique": setting.technique,
            "layers": layers,
            "thickness": setting.thickness,
            "parameters": dict(setting.parameters),
            "times": float(f"{ratios[number]:.4g}"),
            "error": float(f"{whole[number]:.4g}"),
            "error_cut": float(f"{cut[number]:.4g}"),
            "validation": float(f"{other[number]:.4g}"),
        }


@click.command()
@device_option
@click.option("--runs", default=5, show_default=True, type=click.IntRange(1), help="Of which times are medians.")
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="By default the library's own.")
@click.option("--keep-times", is_flag=True, help="Find errors anew, and take the times from the record.")
def main(device: str | None, runs: int, output: Path | None, *, keep_times: bool) -> None:
    """Record errors and times of the settings, on the scenes for tuning and those for validation."""
    with progress_bar() as report:
        sets = SceneSets(Runtime.open(device), progress=report)
        settings: list[dict[str, Any]] = []
        drawn: list[dict[str, float]] = []
        before = scans()
        for number, layers in enumerate(LAYERS):
            report(f"{layers} layers", number / len(LAYERS))
            if keep_times:
                ratios = [known["times"] for known in before["settings"] if known["layers"] == layers]
                settings += settings_of(sets, layers, ratios)
                continue
            settings += settings_of(sets, layers, times(sets.contexts["tuning"], SETTINGS, layers, runs))
            for overscan in (0.0, OVERSCAN):
                own = (float(f"{ms:.4g}") for ms in drawing(sets.contexts["tuning"], layers, overscan, runs))
                kind = {"layers": layers, "overscan": overscan}
                drawn.append(kind | dict(zip(("without thickness", "with thickness"), own, strict=True)))
    runtime = sets.runtime
    document = {
        "format": SCANS,
        "recorded by": "python -m ssgi_cl.bench.ao_front",
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "version": __version__,
        "device": runtime.info.label,
        "variant": str(runtime.variant),
        "size": list(sets.size),
        "overscan": OVERSCAN,
        "truth": {"rays": sets.truth.rays, "attenuation": sets.truth.attenuation, "weighting": "cosine"},
        "scenes": {name: described(sets.views[name]) for name in ("tuning", "validation")},
        "drawn": drawn,
        "settings": settings,
    }
    if keep_times:
        document |= {key: before[key] for key in ("date", "version", "device", "variant", "drawn")}
    path = output or Path(presets.__file__).parent / presets.FRONT
    with replacement(path) as file:
        file.write_text(written_as(document) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
