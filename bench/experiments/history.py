"""Sequences with and without the history of earlier frames: `python -m ssgi_cl.bench.experiments.history --help`.

A row a sequence of `shots.SHOTS` and method. Errors are of the frames from the eighth on: against rays (ambient
occlusion alone), and against the technique's model, the mean of `MODEL` frames of other patterns. `ONE_OLD` is the
model of the frame before where the motion leads: what a history without any noise errs by after one frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import steadiness
from ssgi_cl.bench.experiments.pans import table
from ssgi_cl.bench.experiments.shots import SHOTS, Shot, shots_of
from ssgi_cl.bench.wording import NOTHING, markdown
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm as drawn_map
from ssgi_cl.rasterize.scenes import is_scene
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.temporal.accumulate import Accumulate, AccumulateParams, Clamp, accumulate
from ssgi_cl.truth import metrics
from ssgi_cl.truth.ray_ao import ray_ao

Image = NDArray[np.float32]

FIRST = 8
"""Frame from which on errors count: a history has begun by then."""
MODEL = 64
"""Frames whose mean is the model."""
PAN = 24
"""Frames of a pan, at most."""
PATTERN = 4
"""Pixels along the side of the square that the pattern of lights repeats with."""
SAMPLES = 64
"""Texels that a pixel gathers light from."""
YOUNG: dict[str, Any] = {"young": 4, "clamp_sigma": 2.0}
"""Parameters of the accumulation in the rows that have it: for cameras and things that move."""
ONE_OLD = "model, one frame old"
"""Row of what a history without noise errs by after one frame."""
MANY, FEW = 8, 1
"""Slices without a history, and with one."""
_HEAD = (
    "sequence",
    "method",
    "RMSE, rays",
    "RMSE, model",
    "FLIP, model",
    "temporal noise",
    "RMSE, uncovered",
    "lag, frames",
)


@dataclass
class Film:
    """A sequence, its references, and what each method makes of it.

    Attributes:
        gbuffers: of the frames, with motion.
        world, model: references of the frames; `world` is empty for light.
        images: by method, one a frame.
        switched: frame in which the light changes, or 0.
    """

    gbuffers: list[GBuffer] = field(default_factory=list)
    world: list[Image] = field(default_factory=list)
    model: list[Image] = field(default_factory=list)
    images: dict[str, list[Image]] = field(default_factory=dict)
    switched: int = 0


def occlusion(gbuffer: GBuffer, shot: Shot, frame: int, slices: int, runtime: Runtime) -> Image:
    """Return unblurred ambient occlusion of a frame."""
    return gtao(gbuffer, radius=shot.radius, slices=slices, frame=frame, blur_radius=0, runtime=runtime)


def light(gbuffer: GBuffer, shot: Shot, frame: int, maps: Sequence[Any], runtime: Runtime) -> Image:
    """Return irradiance by one bounce, the pattern of whose samples lies elsewhere in each of 16 frames."""
    rows, columns = gbuffer.size
    before, above = frame % PATTERN, frame // PATTERN % PATTERN
    part = shot.camera.cropped(-before, -above, columns + PATTERN - 1, rows + PATTERN - 1)
    found = rsm_gather(drawn(shot.scene, part, runtime=runtime), maps, SAMPLES, pattern="rotated", runtime=runtime)
    return found[above : above + rows, before : before + columns]


def film(shots: Iterator[Shot], rays: int, runtime: Runtime, **params: Any) -> Film:
    """Return a sequence with what the methods make of it.

    Args:
        shots: its frames.
        rays: per pixel of the reference.
        runtime: the device.
        **params: of `accumulate`.
    """
    made = Film()
    before: Shot | None = None
    history: History | None = None
    filled: History | None = None
    for number, shot in enumerate(shots):
        earlier = before or shot
        gbuffer = drawn(
            shot.scene, shot.camera, previous_camera=earlier.camera, previous_scene=earlier.scene, runtime=runtime
        )
        if shot.switched:
            made.switched = number
        if shot.bounce:
            maps = [drawn_map(shot.scene, each, size=256, runtime=runtime) for each in shot.lights]
            one = light(gbuffer, shot, number, maps, runtime)
            made.model.append(np.stack([light(gbuffer, shot, k, maps, runtime) for k in range(16)]).mean(axis=0))
            values = {f"{SAMPLES} samples": one}
        else:
            device = on_device(gbuffer, runtime)
            turned = [gtao_of(device, shot, 1000 + k, runtime) for k in range(MODEL)]
            made.model.append(np.stack(turned).mean(axis=0, dtype=np.float64).astype(np.float32))
            if rays:
                made.world.append(ray_ao(shot.scene, shot.camera, shot.radius, rays, gbuffer=gbuffer, seed=number))
            one = occlusion(gbuffer, shot, number, FEW, runtime)
            many = occlusion(gbuffer, shot, number, MANY, runtime)
            values = {f"{FEW} slice": one, f"{MANY} slices": many}
        previous = made.gbuffers[-1] if made.gbuffers else None
        mean, history = accumulate(one, gbuffer, previous, history, runtime=runtime, **params)
        joined, filled = accumulate(one, gbuffer, previous, filled, runtime=runtime, **{**YOUNG, **params})
        first = next(iter(values))
        means = {f"{first}, history": mean, f"{first}, history, young": joined}
        if not shot.bounce:
            means[ONE_OLD] = one_old(made, gbuffer, runtime)
        for name, image in {**values, **means}.items():
            made.images.setdefault(name, []).append(image)
        made.gbuffers.append(gbuffer)
        before = shot
    return made


def one_old(made: Film, gbuffer: GBuffer, runtime: Runtime) -> Image:
    """Return the model of the frame before where the motion leads; of the frame itself in pixels that begin anew."""
    now = made.model[-1]
    if len(made.model) < 2:
        return now
    _, before = accumulate(made.model[-2], made.gbuffers[-1], runtime=runtime)
    mean, _ = accumulate(now, gbuffer, made.gbuffers[-1], before, clamp="none", runtime=runtime)
    # The mean of both frames, or, where it begins anew, of this one.
    return np.asarray(2.0 * mean - now, np.float32)


def gtao_of(device: Any, shot: Shot, frame: int, runtime: Runtime) -> Image:
    """Return ambient occlusion of one slice of a G-buffer in device memory."""
    return gtao(device, radius=shot.radius, slices=FEW, frame=frame, blur_radius=0, runtime=runtime)


def measured(made: Film) -> dict[str, dict[str, float]]:
    """Return the measures of each method, by name; those that do not apply are left out."""
    there = [np.isfinite(np.asarray(gbuffer.depth)) for gbuffer in made.gbuffers]
    fresh = [a & b for a, b in zip(steadiness.uncovered(made.gbuffers), there, strict=True)]
    begin = min(FIRST, len(there) - 1)
    found: dict[str, dict[str, float]] = {}
    for name, images in made.images.items():
        late, model, masks = images[begin:], made.model[begin:], there[begin:]
        own = {"model": steadiness.rmse(late, model, masks), "flip": flip(late, model, masks)}
        if made.world:
            own["world"] = steadiness.rmse(late, made.world[begin:], masks)
        own["noise"] = steadiness.temporal_noise(late, model, masks) if len(late) > 1 else float("nan")
        if any(mask.any() for mask in fresh[begin:]):
            own["uncovered"] = steadiness.rmse(late, model, fresh[begin:])
        if made.switched:
            own["lag"] = steadiness.lag(images, made.model, made.switched)
        found[name] = own
    return found


def flip(images: Sequence[Image], references: Sequence[Image], masks: Sequence[NDArray[np.bool_]]) -> float:
    """Return the mean FLIP of images: of occlusion as it is, of light HDR-FLIP."""
    one = metrics.flip if images[0].ndim == 2 else metrics.hdr_flip
    return float(np.mean([one(i, r, m) for i, r, m in zip(images, references, masks, strict=True)]))


def told(results: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    """Return the lines of a Markdown table of what `measured` returned, by sequence."""
    lines = []
    for shot, methods in results.items():
        for method, own in methods.items():
            cells = [
                f"{own[key]:.4f}" if key in own else NOTHING for key in ("world", "model", "flip", "noise", "uncovered")
            ]
            frames = f"{own['lag']:.0f}" if "lag" in own else NOTHING
            lines.append((shot, method, *cells, "never" if frames == "-1" else frames))
    return "\n".join(markdown(_HEAD, lines, "ll" + 6 * "r"))


def times(size: Size, repeats: int, runtime: Runtime) -> dict[str, float]:
    """Return milliseconds of a frame of ambient occlusion by each method, in device memory.

    Medians of runs that take turns in one process.
    """
    shots = list(SHOTS["path through the hall"](size, 2))
    gbuffers = [drawn(s.scene, s.camera, previous_camera=shots[0].camera, runtime=runtime) for s in shots]
    before, now = (on_device(g, runtime, place=place) for place, g in enumerate(gbuffers))
    accumulation = Accumulate(runtime, size, AccumulateParams(fast=1))  # clamps from the second frame on
    one, many = (
        Gtao(runtime, size, GtaoParams(radius=shots[0].radius, slices=slices, blur_radius=0)) for slices in (FEW, MANY)
    )
    with runtime.frame():
        history = accumulation.run(before, one.run(before))

    def with_history() -> None:
        accumulation.run(now, one.run(now), previous=before, history=history)

    methods = {
        f"{FEW} slice": lambda: one.run(now),
        f"{FEW} slice, history": with_history,
        f"{MANY} slices": lambda: many.run(now),
    }
    return alternated(methods, repeats, runtime)


def alternated(methods: Mapping[str, Any], repeats: int, runtime: Runtime) -> dict[str, float]:
    """Return the median milliseconds of each method; they take turns, after one turn that does not count."""
    found: dict[str, list[float]] = {name: [] for name in methods}
    for turn in range(repeats + 1):
        for name, run in methods.items():
            with runtime.frame():
                run()
            runtime.finish()
            if turn:
                found[name].append(sum(entry.ms for entry in runtime.times() if not entry.skipped))
    return {name: float(np.median(values)) for name, values in found.items()}


@click.command()
@click.option("--size", type=(int, int), default=(240, 180), show_default=True, help="Columns and rows.")
@click.option("--frames", default=32, show_default=True, type=click.IntRange(2, 1000), help="Of each sequence.")
@click.option("--rays", default=64, show_default=True, help="Of the reference, per pixel; 0: no reference by rays.")
@click.option(
    "--shot", "names", multiple=True, help=f"One of {', '.join(SHOTS)}, or a scene to walk through; several. All."
)
@click.option("--clamp", type=click.Choice(("neighbourhood", "fast", "none")), help="Of the accumulation.")
@click.option("--repeats", default=25, show_default=True, help="Turns of the timing.")
@click.option("--whole", multiple=True, metavar="SCENE", help="A slow pan of whole frames too; several.")
@click.option("--samples", default=32, show_default=True, type=click.IntRange(1, 1024), help="Of their references.")
def main(
    size: tuple[int, int],
    frames: int,
    rays: int,
    names: tuple[str, ...],
    clamp: Clamp | None,
    repeats: int,
    whole: tuple[str, ...],
    samples: int,
) -> None:
    """Print RMSE, FLIP, temporal noise, ghosting and lag of sequences with and without a history, then of whole frames
    flicker, FLIP and RMSE."""
    runtime = Runtime.open()
    params = {} if clamp is None else {"clamp": clamp}
    own: Size = (size[1], size[0])
    results = {
        name: measured(film(shots_of(name, own, frames, runtime), rays, runtime, **params)) for name in names or SHOTS
    }
    click.echo(
        told({name if name in SHOTS or is_scene(name) else Path(name).stem: own for name, own in results.items()})
    )
    for name, ms in times(own, repeats, runtime).items():
        click.echo(f"{name}: {ms:.2f} ms")
    if whole:
        click.echo(table(whole, own, min(frames, PAN), samples, runtime))


if __name__ == "__main__":
    main()
