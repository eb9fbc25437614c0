"""Slow pans as test cases for whole frames: flicker, FLIP and RMSE of each frame, with a history and without.

A command of its own for any scene: `python -m ssgi_cl.bench.experiments.pans --help`. The reference of a frame is the
mean of `--samples` frames of other patterns, which has the technique's bias and little of its noise (of scenes that
move over four sets of surfels). With `--paths`
FLIP is against path-traced frames too. Where pycvvdp is installed, ColorVideoVDP judges the sequences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import steadiness
from ssgi_cl.bench.experiments.shots import SHOTS, Shot
from ssgi_cl.bench.peers.mitsuba_frame import DENOISERS, PathFrames
from ssgi_cl.bench.peers.mitsuba_rays import missing
from ssgi_cl.bench.wording import NOTHING, markdown
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.io import png
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import load_scene
from ssgi_cl.rasterize.raster.default_camera import default_camera, default_lights
from ssgi_cl.rasterize.scenes import is_scene, make_scene
from ssgi_cl.techniques.filters.tonemap import auto_exposure, tonemap
from ssgi_cl.truth import metrics
from ssgi_cl.truth.radiance import radiance

Image = NDArray[np.float32]

TURN = np.radians(0.35)
"""By which the camera turns in a frame: about a pixel of 240 columns."""
FIRST = 8
"""Frame from which on figures count: a history has begun by then."""
ORDERS = 4
"""Of triangles, of which scenes that move have surfels in a reference."""
METHODS = ("one frame", "history")
HEAD = ("scene", "method", "flicker", "pops, %", "FLIP", "FLIP, paths", "RMSE", "CVVDP, JOD", "ms")
FRAMES_A_SECOND = 24.0


def pan(name: str, size: Size, frames: int, runtime: Runtime) -> list[Shot]:
    """Return a camera that turns about the vertical, of a built-in or generated scene or a file; or one of `SHOTS`."""
    height, width = size
    if name in SHOTS:
        return [lit(shot, runtime) for shot in SHOTS[name](size, frames)]
    if is_scene(name):
        built = make_scene(name)
        first, scene = built.camera(width, height), built.scene
        lights: Sequence[Light] = built.own_lights
    else:
        scene = load_scene(name)
        first = default_camera(scene, width, height, runtime=runtime)
        lights = scene.lights or default_lights(scene, first, runtime)
    shots = []
    for number in range(frames):
        c, s = np.cos(TURN * number), np.sin(TURN * number)
        turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        view = np.eye(4)
        view[:3, :3] = first.view[:3, :3] @ turn
        view[:3, 3] = -view[:3, :3] @ first.position
        camera = Camera(view=view, projection=first.projection, width=width, height=height)
        shots.append(Shot(scene, camera, 0.0, tuple(lights)))
    return shots


def lit(shot: Shot, runtime: Runtime) -> Shot:
    """Return a frame with lights: its own, else those that suit its camera."""
    return shot if shot.lights else replace(shot, lights=tuple(default_lights(shot.scene, shot.camera, runtime)))


def filmed(shots: Sequence[Shot], runtime: Runtime) -> tuple[dict[str, list[Image]], dict[str, float], list[GBuffer]]:
    """Return radiance of the frames by method, median milliseconds of a frame by method, and G-buffers with motion.

    Both methods take turns.
    """
    size = shots[0].camera.size
    renderers = {name: Renderer(runtime, size, exposure=1.0, history=name == "history") for name in METHODS}
    images: dict[str, list[Image]] = {name: [] for name in METHODS}
    ms: dict[str, list[float]] = {name: [] for name in METHODS}
    gbuffers = []
    for number, shot in enumerate(shots):
        for name, renderer in renderers.items():
            frame = renderer(shot.scene, shot.camera, shot.lights, outputs=("radiance",))
            images[name].append(frame.radiance)
            ms[name].append(sum(each.ms for each in frame.passes if not each.skipped))
        earlier = shots[max(number - 1, 0)]
        gbuffers.append(
            drawn(
                shot.scene, shot.camera, previous_camera=earlier.camera, previous_scene=earlier.scene, runtime=runtime
            )
        )
    return images, {name: float(np.median(values[1:])) for name, values in ms.items()}, gbuffers


def references(shots: Sequence[Shot], samples: int, runtime: Runtime) -> list[Image]:
    """Return the reference of each frame from `FIRST` on; of others black images.

    Where scenes differ from frame to frame each has other surfels, whose noise is to be little, too: the reference is
    then a mean over `ORDERS` of the scene's triangles, so many samples of each.
    """
    moves = any(shot.scene is not shots[0].scene for shot in shots)
    orders = ORDERS if moves else 1

    def reference(shot: Shot) -> Image:
        found = []
        for order in range(orders):
            scene = shuffled(shot.scene, order) if moves else shot.scene
            frame = render(
                scene, shot.camera, shot.lights, samples=samples, exposure=1.0, outputs=("radiance",), runtime=runtime
            )
            found.append(frame.radiance)
        return np.asarray(np.mean(found, axis=0), np.float32)

    begin = min(FIRST, len(shots) - 2)
    black = np.zeros((*shots[0].camera.size, 3), np.float32)
    return [reference(shot) if number >= begin else black for number, shot in enumerate(shots)]


def shuffled(scene: Scene, seed: int) -> Scene:
    """Return a scene with its triangles in another order."""
    order = np.random.default_rng(seed).permutation(len(scene.triangles))
    return replace(scene, triangles=scene.triangles[order], material_ids=scene.material_ids[order])


def traced(shots: Sequence[Shot], paths: int) -> list[Image]:
    """Return the path-traced truth of each frame from `FIRST` on, means over pixels; of others black images."""
    begin = min(FIRST, len(shots) - 2)
    return [
        radiance(shot.scene, shot.camera, shot.lights, paths, box_filter=True).mean
        if number >= begin
        else np.zeros((*shot.camera.size, 3), np.float32)
        for number, shot in enumerate(shots)
    ]


def denoised(shots: Sequence[Shot]) -> list[Image]:
    """Return each frame of one path a pixel, denoised by Open Image Denoise, which has no history."""
    found: list[Image] = []
    scene, frames = None, None
    for shot in shots:
        if frames is None or shot.scene is not scene:
            scene, frames = shot.scene, PathFrames(shot.scene, shot.lights, 1, DENOISERS["oidn"])
        found.append(frames.frame(shot.camera))
    return found


def measured(
    images: Mapping[str, Sequence[Image]],
    wanted: Sequence[Image],
    gbuffers: Sequence[GBuffer],
    runtime: Runtime,
    truth: Sequence[Image] | None = None,
) -> dict[str, dict[str, float]]:
    """Return flicker, share of pops, FLIP (mean over frames, one exposure), RMSE relative to the mean, and FLIP against
    the path-traced truth if there is one, by method."""
    begin = min(FIRST, len(wanted) - 2)
    exposure = auto_exposure(wanted[begin])
    found: dict[str, dict[str, float]] = {}

    def shown(image: Image) -> Image:
        return tonemap(image, exposure=exposure, runtime=runtime).astype(np.float32) / np.float32(255.0)

    def flip(own: Sequence[Image], others: Sequence[Image]) -> float:
        return float(np.mean([metrics.flip(shown(a), shown(b)) for a, b in zip(own, others, strict=True)]))

    level = float(np.mean(wanted[begin:]))
    for name, own in images.items():
        late = own[begin:]
        masks = [np.ones(image.shape[:2], bool) for image in late]
        found[name] = {
            "flicker": steadiness.flicker(late, wanted[begin:], gbuffers[begin:]),
            "pops": steadiness.pops(late, wanted[begin:], gbuffers[begin:]),
            "flip": flip(late, wanted[begin:]),
            "rmse": steadiness.rmse(late, wanted[begin:], masks) / level,
        }
        if truth is not None:
            found[name]["paths"] = flip(late, truth[begin:])
        quality = video_quality([shown(one) for one in late], [shown(one) for one in wanted[begin:]])
        if quality is not None:
            found[name]["vdp"] = quality
    return found


def video_quality(own: Sequence[Image], wanted: Sequence[Image]) -> float | None:
    """Return how like another a sequence of pictures in [0, 1] looks, in just-objectionable differences below 10; None
    where pycvvdp is not installed.

    Mantiuk et al. 2024, "ColorVideoVDP: A Visual Difference Predictor for Image, Video and Display Distortions", for a
    display of 4K at `FRAMES_A_SECOND`.
    """
    if find_spec("pycvvdp") is None:
        return None
    metric = import_module("pycvvdp").cvvdp(display_name="standard_4k", device=import_module("torch").device("cpu"))
    quality, _ = metric.predict(np.stack(own), np.stack(wanted), dim_order="FHWC", frames_per_second=FRAMES_A_SECOND)
    return float(quality)


def rows(name: str, found: Mapping[str, Mapping[str, float]], ms: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Return the rows of a table."""
    return [
        (
            name,
            method,
            f"{own['flicker']:.4f}",
            f"{100.0 * own['pops']:.2f}",
            f"{own['flip']:.4f}",
            f"{own['paths']:.4f}" if "paths" in own else NOTHING,
            f"{own['rmse']:.3f}",
            f"{own['vdp']:.2f}" if "vdp" in own else NOTHING,
            f"{ms[method]:.0f}" if method in ms else NOTHING,
        )
        for method, own in found.items()
    ]


def table(
    names: Sequence[str],
    size: Size,
    frames: int,
    samples: int,
    runtime: Runtime,
    folder: Path | None = None,
    *,
    paths: int = 0,
    peer: bool = False,
) -> str:
    """Return the lines of a Markdown table; in `folder`, if any, the frames of all methods lie then as PNG.

    With `paths` FLIP is against a truth of so many paths a pixel too, and with `peer` there are frames of one path,
    denoised.
    """
    lines: list[tuple[str, ...]] = []
    for name in names:
        shots = pan(name, size, frames, runtime)
        images, ms, gbuffers = filmed(shots, runtime)
        if peer:
            images["1 path, OIDN"] = denoised(shots)
        wanted = references(shots, samples, runtime)
        truth = traced(shots, paths) if paths else None
        stem = name if is_scene(name) else Path(name).stem
        lines += rows(stem, measured(images, wanted, gbuffers, runtime, truth), ms)
        if folder is not None:
            _write(folder, stem.replace(" ", "-"), {**images, "reference": wanted}, auto_exposure(wanted[-1]), runtime)
    return "\n".join(markdown(HEAD, lines, "ll" + 7 * "r"))


def _write(folder: Path, stem: str, images: Mapping[str, Sequence[Image]], exposure: float, runtime: Runtime) -> None:
    for method, own in images.items():
        for number, image in enumerate(own, 1):
            picture = tonemap(image, exposure=exposure, runtime=runtime)
            png.write(folder / f"{stem}.{method.replace(', ', '-').replace(' ', '-')}.{number:04d}.png", picture)


@click.command()
@click.argument("scenes", nargs=-1, required=True)
@click.option("--size", type=(int, int), default=(240, 180), show_default=True, help="Columns and rows.")
@click.option("--frames", default=24, show_default=True, type=click.IntRange(3, 1000), help="Of each pan.")
@click.option("--samples", default=32, show_default=True, type=click.IntRange(1, 1024), help="Of the references.")
@click.option("--pictures", type=click.Path(path_type=Path, file_okay=False, exists=True), help="Folder for frames.")
@click.option("--paths", default=0, show_default=True, type=click.IntRange(0, 1 << 20), help="A pixel, of the truth.")
@click.option("--peer", is_flag=True, help="Frames of one path, denoised by Open Image Denoise, too.")
def main(
    scenes: tuple[str, ...],
    size: tuple[int, int],
    frames: int,
    samples: int,
    pictures: Path | None,
    paths: int,
    peer: bool,
) -> None:
    """Print flicker, pops, FLIP and RMSE of whole frames with a history and without: of slow pans through SCENES, or of
    sequences of `shots.SHOTS` by name."""
    why = missing(denoised=True) if peer else ""
    if why:
        click.echo(why)
    own: Size = (size[1], size[0])
    click.echo(table(scenes, own, frames, samples, Runtime.open(), pictures, paths=paths, peer=peer and not why))


if __name__ == "__main__":
    main()
