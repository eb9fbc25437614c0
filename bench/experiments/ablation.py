"""Sources of a frame's error: `python -m ssgi_cl.bench.experiments.ablation --help`.

Its terms are replaced by those of the reference, one by one.

Light adds up, so that the frame is the sum of frames by part of the light, and the reference the
sum of references by the same parts. Pixels of glossy surfaces are a term of their own: what a lobe
mirrors has all parts in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl import truth
from ssgi_cl.bench.cases.frame import MODES
from ssgi_cl.bench.errors import picture_flip
from ssgi_cl.bench.options import PixelSize, device_option, human_errors, meshes_option, progress_bar
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.rasterize.scenes import REPORTED, BuiltinScene
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.truth import Truth, metrics
from ssgi_cl.tuning.measured_scenes import views_of

Progress = Callable[[str, float], object]
Terms = dict[str, NDArray[np.float64]]

NOTHING, EDGES = "nothing", "edges (pixel filter)"
NOISE = "all of it, noise of the reference aside"
DIRECT, SKY, EMISSION, FIRST, LATER, GLOSSY = (
    "direct light and its shadows",
    "sky",
    "emission",
    "bounce 1",
    "later bounces",
    "glossy surfaces",
)

DIRECT_ALONE: Mapping[str, Mapping[str, Any]] = {"direct": {}, "multires": {"indirect": False}}
"""Frame -> what to change for direct light, of punctual lights, emission and environments; where no
change gives it, reflected light is subtracted from the frame."""
ONE_BOUNCE: Mapping[str, Any] = {"bounces": 1}
"""Changes to other frames for direct light and one bounce."""


class FrameError(NamedTuple):
    """Errors of a frame.

    Attributes:
        flip: see `picture_flip`.
        mrse: mean of (v - r)^2 / (r + 0.01)^2, of radiance.
        bias: mean difference over the reference's mean.
        mottling: see `metrics.mottling`; 0 where no smooth surface is seen.
    """

    flip: float
    mrse: float
    bias: float
    mottling: float


@dataclass(frozen=True)
class Replaced:
    """A term of a frame.

    Attributes:
        term: which.
        alone: errors of the frame with this term from the reference.
        kept: errors of the reference with this term from the frame; None where that says nothing.
        share: the term's part of the reference's light.
    """

    term: str
    alone: FrameError
    kept: FrameError | None
    share: float


def ablation(
    view: BuiltinScene,
    size: Size,
    runtime: Runtime,
    mode: str = "default",
    *,
    paths: int = 256,
    progress: Progress = lambda text, share: None,
) -> list[Replaced]:
    """Return the errors of a frame as it is, with each term replaced, and with none but the noise.

    `mode` is a key of `MODES`.
    """
    told = reference(view, size, paths, progress)
    expected = told.mean.astype(np.float64)
    seen = gbuffer(view.scene, view.camera(size[1], size[0]), runtime=runtime)
    glossy, smooth = _glossy(seen), metrics.smooth_surfaces(seen)

    def errors(image: NDArray[np.float64]) -> FrameError:
        return _errors(image, expected, smooth)

    true = _apart(_true_terms(view, size, seen, paths, progress), glossy)
    ours = _apart(_own_terms(view, size, runtime, mode), glossy)
    frame = sum(ours.values(), np.zeros_like(expected))
    light = float(expected.mean()) or 1.0
    found = [Replaced(NOTHING, errors(frame), None, 1.0)]
    for term, value in true.items():
        found.append(Replaced(
            term, errors(frame - ours[term] + value), errors(expected - value + ours[term]),
            float(value.mean()) / light,
        ))  # fmt: skip
    both = true[FIRST] + true[LATER] - ours[FIRST] - ours[LATER]
    found.append(Replaced(
        "all bounces", errors(frame + both), errors(expected - both),
        float((true[FIRST] + true[LATER]).mean()) / light,
    ))  # fmt: skip
    # A frame without error is as far from the reference as that is from what it converges to.
    noise = np.random.default_rng(0).standard_normal(expected.shape) * told.error
    found.append(Replaced(NOISE, errors(np.maximum(expected + noise, 0.0)), None, 1.0))
    return found


def _errors(image: NDArray[np.float64], expected: NDArray[np.float64], smooth: NDArray[np.bool_]) -> FrameError:
    value, true = (np.maximum(light.astype(np.float32), 0.0).astype(np.float64) for light in (image, expected))
    mean = float(true.mean())
    bias = float((value - true).mean()) / mean if mean > 0.0 else 0.0
    mottling = metrics.mottling(value, true, smooth) if true[smooth].any() else 0.0
    return FrameError(picture_flip(value, true), metrics.mrse(value, true), bias, mottling)


def reference(view: BuiltinScene, size: Size, paths: int, progress: Progress = lambda text, share: None) -> Truth:
    """Return the radiance that frames of a view are held to: pixels as boxes, all bounces."""
    return truth.radiance(
        view.scene,
        view.camera(size[1], size[0]),
        view.own_lights,
        paths,
        box_filter=True,
        progress=lambda share: progress(f"reference of {view.name}", share),
    )


def _glossy(seen: GBuffer) -> NDArray[np.bool_]:
    """Return where glossy surfaces are seen, [rows, columns, 1]."""
    if seen.specular is None:
        return np.zeros((*seen.size, 1), np.bool_)
    found: NDArray[np.bool_] = np.any(np.asarray(seen.specular) > 0.0, axis=-1, keepdims=True)
    return found


def _apart(terms: Terms, glossy: NDArray[np.bool_]) -> Terms:
    """Return the terms without these pixels, whose light is a term of its own, pixel filter aside."""
    if not glossy.any():
        return terms
    light = {term: value for term, value in terms.items() if term != EDGES}
    return {
        **{term: np.where(glossy, 0.0, value) for term, value in light.items()},
        GLOSSY: np.where(glossy, sum(light.values()), 0.0),
        EDGES: terms[EDGES],
    }


def _parts(view: BuiltinScene) -> dict[str, tuple[Scene, tuple[Light, ...]]]:
    """Return scene and lights of each part of the direct light; what shines nowhere is left out."""
    dark = replace(view.scene, materials=tuple(replace(m, emission=(0.0,) * 3) for m in view.scene.materials))
    skies = tuple(light for light in view.own_lights if isinstance(light, Environment))
    punctual_lights = tuple(light for light in view.own_lights if not isinstance(light, Environment))
    parts = {DIRECT: (dark, punctual_lights), SKY: (dark, skies)}
    found = {term: part for term, part in parts.items() if part[1]}
    if any(material.emits for material in view.scene.materials):
        found[EMISSION] = (view.scene, ())
    return found


def _true_terms(view: BuiltinScene, size: Size, seen: GBuffer, paths: int, progress: Progress) -> Terms:
    camera = view.camera(size[1], size[0])

    def made(scene: Scene, lights: tuple[Light, ...], bounces: Any) -> NDArray[np.float64]:
        title = f"{bounces} bounces of {len(lights)} lights, {view.name}"
        return truth.radiance(
            scene, camera, lights, paths, bounces, progress=lambda share: progress(title, share)
        ).mean.astype(np.float64)

    parts = _parts(view)
    direct = {term: made(*part, 0) for term, part in parts.items() if term != EMISSION}
    if EMISSION in parts:
        # What is seen of it; what it lights is a bounce, as in frames.
        emission = np.zeros((*size, 3)) if seen.emission is None else seen.emission
        direct[EMISSION] = np.asarray(emission, np.float64)
    once, every = (made(view.scene, view.own_lights, bounces) for bounces in (1, "all"))
    straight = sum(direct.values(), np.zeros_like(every))
    box = reference(view, size, paths, progress).mean.astype(np.float64)
    return {**direct, FIRST: once - straight, LATER: every - once, EDGES: box - every}


def _own_terms(view: BuiltinScene, size: Size, runtime: Runtime, mode: str) -> Terms:
    camera = view.camera(size[1], size[0])

    def made(scene: Scene, lights: tuple[Light, ...], options: dict[str, Any]) -> Any:
        found = render(scene, camera, lights, outputs=("radiance",), runtime=runtime, **options)
        return found.radiance.astype(np.float64)

    def unreflected(scene: Scene, lights: tuple[Light, ...], options: dict[str, Any]) -> Any:
        found = render(
            scene, camera, lights, outputs=("radiance", "ao", "indirect", "gbuffer"), runtime=runtime, **options
        )
        seen = found.gbuffer
        if found.indirect is None or seen is None:
            return found.radiance.astype(np.float64)
        gaps = 1.0 if found.ao is None or rays_meet_triangles(scene) else np.minimum(2.0 * found.ao, 1.0)[..., None]
        albedo, depth = (np.asarray(a, np.float64) for a in (seen.albedo, seen.depth))
        reflected = albedo / np.pi * gaps * found.indirect.astype(np.float64)
        return found.radiance - np.where(np.isfinite(depth)[..., None], reflected, 0.0)

    whole, alone = {**MODES[mode], "edges": 0}, DIRECT_ALONE.get(mode)
    direct = {
        term: unreflected(*part, whole) if alone is None else made(*part, {**whole, **alone})
        for term, part in _parts(view).items()
    }
    every = made(view.scene, view.own_lights, whole)
    straight = sum(direct.values(), np.zeros_like(every))
    once = every
    if mode not in DIRECT_ALONE:  # which has no later bounces
        once = made(view.scene, view.own_lights, {**whole, **ONE_BOUNCE})
    smooth = made(view.scene, view.own_lights, dict(MODES[mode]))
    return {**direct, FIRST: once - straight, LATER: every - once, EDGES: smooth - every}


def told(terms: list[Replaced]) -> str:
    """Return the lines of a Markdown table."""
    errors = "mottling | rel. MSE"
    lines = [f"| replaced by its truth | light | FLIP | {errors} | FLIP if it alone is ours | {errors} |"]
    lines.append("|---|" + 7 * "---:|")
    for term in terms:
        alone, kept = (
            " | | " if of is None else f"{of.flip:.3f} | {of.mottling:.3f} | {of.mrse:.3g}"
            for of in (term.alone, term.kept)
        )
        lines.append(f"| {term.term} | {100.0 * term.share:.1f} % | {alone} | {kept} |")
    return "\n".join(lines)


@click.command()
@click.option("--scene", "scenes", multiple=True, default=REPORTED, show_default=True, help="As of `ssgi bench`.")
@meshes_option
@click.option("--size", type=PixelSize(), default="400x300", show_default=True, help="Of the image in pixels.")
@device_option
@click.option("--mode", default="default", show_default=True, type=click.Choice(list(MODES)), help="Of our frames.")
@click.option("--truth-paths", default=128, show_default=True, type=click.IntRange(2, 1 << 20), help="Per pixel.")
def main(
    scenes: tuple[str, ...], meshes: Path | None, size: Size, device: str | None, mode: str, truth_paths: int
) -> None:
    """Replace the terms of frames by those of the reference, one at a time."""
    with human_errors():
        runtime = Runtime.open(device)
        with progress_bar() as step:
            for view in views_of(scenes, runtime, meshes).values():
                found = ablation(view, size, runtime, mode, paths=truth_paths, progress=step)
                click.echo(f"## {view.name}, {size[1]} x {size[0]}, `{mode}`\n\n{told(found)}\n")


if __name__ == "__main__":
    main(prog_name="python -m ssgi_cl.bench.experiments.ablation")
