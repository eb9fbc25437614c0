"""The command `ssgi warmup`: compiles kernels before anyone waits for them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any, get_args

import click

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import AoTechnique, OneBounce, Preset
from ssgi_cl.device.progress import told
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.frame.skips import ONE_PICTURE
from ssgi_cl.io.console import device_option, human_errors, json_option
from ssgi_cl.rasterize import gbuffer
from ssgi_cl.rasterize.raster.default_camera import default_camera, default_lights
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, make_scene
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.ssdo.ssdo import ssdo

WIDTH, HEIGHT = 160, 120
"""Pixels of what is drawn: enough that all sizes of work-groups and all levels of detail occur."""
SCENES = (*BUILTIN_SCENES, "room-1", "foliage-1")
"""They need all that frames can need: punctual lights and skies, textures, cut-outs, glass, gloss, emission."""


@click.command("warmup")
@device_option
@json_option
@human_errors
def warmup_command(device: str | None, as_json: bool) -> None:
    """Compile the kernels that `ssgi render`, its --ao and --indirect techniques and `ssgi apply` use, into the
    driver's cache.

    Small pictures are drawn in each way, because drivers finish compiling a kernel when it first runs. Kernels depend
    on the device and on the version of this program: once after each installation is enough.
    """
    start = perf_counter()
    runtime = Runtime.open(device)
    runtime.programs.announced = True
    with told(not as_json, "compiling kernels") as tell:
        steps = _steps(runtime)
        for number, step in enumerate(steps, 1):
            step()
            if tell is not None:
                tell(number / len(steps))
    seconds = perf_counter() - start
    facts = {
        "device": runtime.info.label,
        "variant": str(runtime.variant),
        "programs": runtime.builds,
        "new": runtime.programs.record.new,
        "seconds": round(seconds, 2),
    }
    if as_json:
        print(json.dumps(facts, indent=1))
        return
    click.echo(f"{facts['device']}, {facts['variant']}")
    click.echo(f"{facts['programs']} programs, {facts['new']} of them compiled for the first time, in {seconds:.1f} s")


def _steps(runtime: Runtime) -> list[Callable[[], object]]:
    """Return what makes the device compile, step by step."""
    box, outdoors = make_scene("cornell_box"), make_scene("terrace")
    camera = box.camera(WIDTH, HEIGHT)
    steps: list[Callable[[], object]] = [partial(_frame, runtime, name) for name in SCENES]
    for name in ("cornell_box", "terrace"):
        steps += [partial(_frame, runtime, name, bounces=0, ao=ao) for ao in get_args(AoTechnique)]
        steps += [partial(_frame, runtime, name, indirect=indirect) for indirect in get_args(OneBounce)]
    for way in ({}, {"bounces": 0}, {"indirect": "ssdo"}):
        steps.append(partial(_frame, runtime, "workshop", layers=2, **way))
    steps.append(lambda: default_lights(box.scene, default_camera(box.scene, WIDTH, HEIGHT, 0.9, runtime), runtime))
    # Files may lack normals, which are then found from depth.
    seen = gbuffer(box.scene, camera, runtime=runtime)
    for given in (seen, GBuffer(camera=camera, depth=seen.depth)):
        for technique in TECHNIQUES.values():
            settings: tuple[Preset | None, ...] = (None, *get_args(Preset))
            steps += [partial(technique.function, given, 0.1, preset=preset, runtime=runtime) for preset in settings]
        steps.append(partial(ssdo, given, outdoors.lights, 0.1, runtime=runtime))
    return steps


def _frame(runtime: Runtime, name: str, **options: Any) -> None:
    """Draw a scene as `ssgi render` does with options, and as `gi.render` does without being asked for more."""
    scene = make_scene(name)
    lights = scene.lights if options else scene.own_lights
    camera = scene.camera(WIDTH, HEIGHT)
    for more in ({"skips": ONE_PICTURE}, {"skips": ONE_PICTURE, "gbuffer": True}, {}):
        render(scene.scene, camera, lights, runtime=runtime, **more, **options)
