"""Slow pans as test cases for whole frames: flicker, FLIP and RMSE of each frame, with a history and without.

A command of its own for any scene: `python -m ssgi_cl.bench.experiments.pans --help`. The reference of a frame is the
mean of `--samples` frames of other patterns, which has the technique's bias and little of its noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import steadiness
from ssgi_cl.bench.wording import markdown
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

Image = NDArray[np.float32]

TURN = np.radians(0.35)
"""By which the camera turns in a frame: about a pixel of 240 columns."""
FIRST = 8
"""Frame from which on figures count: a history has begun by then."""
METHODS = ("one frame", "history")
HEAD = ("scene", "method", "flicker", "FLIP", "RMSE", "ms")


class Pan(NamedTuple):
    """A sequence of whole frames.

    Attributes:
        scene, lights: of all frames.
        cameras: one a frame.
    """

    scene: Scene
    lights: Sequence[Light]
    cameras: Sequence[Camera]


def pan(name: str, size: Size, frames: int, runtime: Runtime) -> Pan:
    """Return a camera that turns about the vertical, of a built-in or generated scene or a file."""
    height, width = size
    if is_scene(name):
        built = make_scene(name)
        first, scene = built.camera(width, height), built.scene
        lights: Sequence[Light] = built.own_lights
    else:
        scene = load_scene(name)
        first = default_camera(scene, width, height, runtime=runtime)
        lights = scene.lights or default_lights(scene, first, runtime)
    cameras = []
    for number in range(frames):
        c, s = np.cos(TURN * number), np.sin(TURN * number)
        turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        view = np.eye(4)
        view[:3, :3] = first.view[:3, :3] @ turn
        view[:3, 3] = -view[:3, :3] @ first.position
        cameras.append(Camera(view=view, projection=first.projection, width=width, height=height))
    return Pan(scene, lights, cameras)


def filmed(made: Pan, runtime: Runtime) -> tuple[dict[str, list[Image]], dict[str, float], list[GBuffer]]:
    """Return radiance of the frames by method, median milliseconds of a frame by method, and G-buffers with motion.

    Both methods take turns.
    """
    size = made.cameras[0].size
    renderers = {name: Renderer(runtime, size, exposure=1.0, history=name == "history") for name in METHODS}
    images: dict[str, list[Image]] = {name: [] for name in METHODS}
    ms: dict[str, list[float]] = {name: [] for name in METHODS}
    gbuffers = []
    for number, camera in enumerate(made.cameras):
        for name, renderer in renderers.items():
            frame = renderer(made.scene, camera, made.lights, outputs=("radiance",))
            images[name].append(frame.radiance)
            ms[name].append(sum(each.ms for each in frame.passes if not each.skipped))
        earlier = made.cameras[max(number - 1, 0)]
        gbuffers.append(drawn(made.scene, camera, previous_camera=earlier, runtime=runtime))
    return images, {name: float(np.median(values[1:])) for name, values in ms.items()}, gbuffers


def references(made: Pan, samples: int, runtime: Runtime) -> list[Image]:
    """Return the reference of each frame."""
    return [
        render(
            made.scene, camera, made.lights, samples=samples, exposure=1.0, outputs=("radiance",), runtime=runtime
        ).radiance
        for camera in made.cameras
    ]


def measured(
    images: Mapping[str, Sequence[Image]], wanted: Sequence[Image], gbuffers: Sequence[GBuffer], runtime: Runtime
) -> dict[str, dict[str, float]]:
    """Return flicker, FLIP (mean over frames, one exposure), and RMSE relative to the mean, by method."""
    begin = min(FIRST, len(wanted) - 2)
    exposure = auto_exposure(wanted[begin])
    found: dict[str, dict[str, float]] = {}

    def shown(radiance: Image) -> Image:
        return tonemap(radiance, exposure=exposure, runtime=runtime).astype(np.float32) / np.float32(255.0)

    level = float(np.mean(wanted[begin:]))
    for name, own in images.items():
        late = own[begin:]
        masks = [np.ones(image.shape[:2], bool) for image in late]
        found[name] = {
            "flicker": steadiness.flicker(late, wanted[begin:], gbuffers[begin:]),
            "flip": float(
                np.mean([metrics.flip(shown(a), shown(b)) for a, b in zip(late, wanted[begin:], strict=True)])
            ),
            "rmse": steadiness.rmse(late, wanted[begin:], masks) / level,
        }
    return found


def rows(name: str, found: Mapping[str, Mapping[str, float]], ms: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Return the rows of a table."""
    return [
        (name, method, f"{own['flicker']:.4f}", f"{own['flip']:.4f}", f"{own['rmse']:.3f}", f"{ms[method]:.0f}")
        for method, own in found.items()
    ]


def table(
    names: Sequence[str], size: Size, frames: int, samples: int, runtime: Runtime, folder: Path | None = None
) -> str:
    """Return the lines of a Markdown table; in `folder`, if any, the frames of both methods lie then as PNG."""
    lines: list[tuple[str, ...]] = []
    for name in names:
        made = pan(name, size, frames, runtime)
        images, ms, gbuffers = filmed(made, runtime)
        wanted = references(made, samples, runtime)
        stem = name if is_scene(name) else Path(name).stem
        lines += rows(stem, measured(images, wanted, gbuffers, runtime), ms)
        if folder is not None:
            _write(folder, stem, {**images, "reference": wanted}, auto_exposure(wanted[0]), runtime)
    return "\n".join(markdown(HEAD, lines, "ll" + 4 * "r"))


def _write(folder: Path, stem: str, images: Mapping[str, Sequence[Image]], exposure: float, runtime: Runtime) -> None:
    for method, own in images.items():
        for number, radiance in enumerate(own, 1):
            picture = tonemap(radiance, exposure=exposure, runtime=runtime)
            png.write(folder / f"{stem}.{method.replace(' ', '-')}.{number:04d}.png", picture)


@click.command()
@click.argument("scenes", nargs=-1, required=True)
@click.option("--size", type=(int, int), default=(240, 180), show_default=True, help="Columns and rows.")
@click.option("--frames", default=24, show_default=True, type=click.IntRange(3, 1000), help="Of each pan.")
@click.option("--samples", default=32, show_default=True, type=click.IntRange(1, 1024), help="Of the references.")
@click.option("--pictures", type=click.Path(path_type=Path, file_okay=False, exists=True), help="Folder for frames.")
def main(scenes: tuple[str, ...], size: tuple[int, int], frames: int, samples: int, pictures: Path | None) -> None:
    """Print flicker, FLIP and RMSE of whole frames of slow pans through SCENES, with a history and without."""
    click.echo(table(scenes, (size[1], size[0]), frames, samples, Runtime.open(), pictures))


if __name__ == "__main__":
    main()
