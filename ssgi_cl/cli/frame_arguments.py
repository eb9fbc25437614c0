"""What the options of `ssgi render` say: the scene, its camera and lights, and how they are drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import shown
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io.console import DEFAULT_FOV, yfov_of
from ssgi_cl.rasterize.files.load import READERS

if TYPE_CHECKING:
    from ssgi_cl.core.scene import Scene
    from ssgi_cl.rasterize.scenes import BuiltinScene

_OUTDOORS = (DirectionalLight, Environment)
"""Lights that --environment replaces."""
CULL = {"file": None, "all": True, "none": False}
"""Values of --cull, and what `load_scene` takes for them."""
_AS_GIVEN = (
    *("preset", "indirect", "method", "vpls", "glossy_vpls", "indirect_ao", "layers", "auxiliary_cameras", "edges"),
    *("ao_samples", "shadow_size", "rsm_size", "exposure", "samples"),
)
"""Options that are arguments of `render` as they are."""


def frame_arguments(
    scene: str, options: dict[str, Any], step: Callable[[str], None], view: Camera | None = None
) -> tuple[Scene, Camera, tuple[Light, ...], dict[str, Any]]:
    """Return the scene, the camera, the lights and the other arguments of `render` but `skips`.

    Args:
        scene: as given on the command line.
        options: of the command `ssgi render` that shape a frame.
        step: is called with the name of each step.
        view: the camera, in place of what the options say.
    """
    from ssgi_cl.rasterize.scenes import is_scene, make_scene

    given = [f"--{name}" for name in ("eye", "target", "up", "fov") if options[name] is not None]
    if options["camera"] is not None and given:
        raise click.UsageError(f"--camera and {given[0]} exclude each other")
    check_scene(scene)
    around = None if options["environment"] is None else _environment(options["environment"])
    step("opening the device")
    runtime = Runtime.open(options["device"])
    step(f"loading {scene}")
    loaded, camera, lights, radius = (
        _builtin(make_scene(scene), options, view)
        if is_scene(scene)
        else _from_file(Path(scene), options, runtime, view)
    )
    if around is not None:
        lights = (*(light for light in lights if not isinstance(light, _OUTDOORS)), around)
    if options["ambient"] is not None:
        lights = (*lights, Environment(options["ambient"]))
    arguments = {
        **{name: options[name] for name in _AS_GIVEN},
        "bounces": _bounces(options["bounces"]),
        "ao": {"none": False, None: True}.get(options["ao"], options["ao"]),
        "ao_radius": radius if options["ao_radius"] is None and not _whole(options) else options["ao_radius"],
        "runtime": runtime,
    }
    return loaded, camera, lights, arguments


def _whole(options: dict[str, Any]) -> bool:
    """Return whether options ask for all light, emission included, and not one technique."""
    return options["indirect"] is None and options["bounces"] != "0"


def _bounces(text: str | None) -> int | str | None:
    """Return what --bounces says; `render` checks its range."""
    if text in (None, "all"):
        return text
    try:
        return int(text)
    except ValueError:
        raise click.UsageError(f"--bounces is {text!r}: expected an integer from 0 on, or 'all'") from None


def _environment(text: str) -> Environment:
    """Return the environment of an image file, or of one radiance: three numbers with commas."""
    parts = text.split(",")
    try:
        radiance = [float(part) for part in parts]
    except ValueError:
        return Environment.load(text)
    if len(radiance) != 3:
        raise click.UsageError(f"--environment {shown(text)}: expected a file or R,G,B")
    return Environment(radiance)


def check_scene(name: str) -> None:
    """Raise unless there is such a scene or file, or the name ends like a scene file's, which is read later."""
    from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, SCENE_NAMES, is_scene

    if is_scene(name):
        return
    path, scenes = Path(name), SCENE_NAMES
    if path.is_dir():
        raise ValueError(f"scene is {name!r}: it is a folder; expected a file or {scenes}")
    if not path.exists() and path.suffix.lower() not in READERS:
        near = get_close_matches(name, BUILTIN_SCENES, 1)
        guess = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"scene is {name!r}: there is no such file; expected one or {scenes}{guess}")


def _size(options: dict[str, Any]) -> tuple[int, int]:
    """Return (width, height); the camera checks them."""
    width, height = options["width"], options["height"]
    return 800 if width is None else width, 600 if height is None else height


def scene_of_file(path: Path, options: dict[str, Any]) -> Scene:
    """Return the scene of a file, as the options say."""
    from ssgi_cl.rasterize import load_scene

    return load_scene(path, textures=not options.get("no_textures"), cull=CULL[options.get("cull", "file")])


def _builtin(
    builtin: BuiltinScene, options: dict[str, Any], view: Camera | None
) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    width, height = _size(options)
    if view is not None:
        camera = view
    elif options["camera"] is not None:
        camera = _camera_file(Path(options["camera"]), options)
    else:
        camera = Camera.look_at(
            builtin.eye if options["eye"] is None else options["eye"],
            builtin.target if options["target"] is None else options["target"],
            builtin.up if options["up"] is None else options["up"],
            yfov=yfov_of(options, builtin.yfov),
            width=width,
            height=height,
        )
    lights = builtin.own_lights if _whole(options) else builtin.lights
    return builtin.scene, camera, lights, builtin.ao_radius


def _from_file(
    path: Path, options: dict[str, Any], runtime: Runtime, view: Camera | None
) -> tuple[Scene, Camera, tuple[Light, ...], float | None]:
    from ssgi_cl.rasterize.raster.default_camera import default_lights

    if (options["eye"] is None) != (options["target"] is None):
        raise click.UsageError("--eye and --target go together")
    if options["up"] is not None and options["eye"] is None:
        raise click.UsageError("--up needs --eye and --target")
    width, height = _size(options)
    yfov = yfov_of(options, math.radians(DEFAULT_FOV))
    # The camera's size and the rest of it are checked before a large scene is loaded.
    Camera.look_at((0, 0, 1), (0, 0, 0), yfov=yfov, width=width, height=height)
    camera = view
    if options["eye"] is not None:
        camera = Camera.look_at(
            options["eye"], options["target"], options["up"] or (0.0, 1.0, 0.0), yfov=yfov, width=width, height=height
        )
    elif options["camera"] is not None:
        file = Path(options["camera"])
        if file.suffix.lower() == ".json" or file.is_file():
            camera = _camera_file(file, options)
    scene = scene_of_file(path, options)
    camera = camera or _camera_of(scene, path, options, runtime)
    lights = scene.lights or default_lights(scene, camera, runtime, emission=_whole(options))
    return scene, camera, lights, None


def _camera_of(scene: Scene, path: Path, options: dict[str, Any], runtime: Runtime) -> Camera:
    """Return the camera of a file's scene that was asked for by its name, or the default one."""
    from ssgi_cl.rasterize.raster.default_view import file_camera

    name = options["camera"]
    if name is not None and name not in scene.cameras:
        known = ", ".join(map(shown, scene.cameras)) or "none"
        raise ValueError(f"--camera is {name!r}: there is no such file, and {path} has no such camera (it has {known})")
    if name is not None:
        return scene.cameras[name].sized(*_size(options))
    yfov = None if options["fov"] is None else yfov_of(options, 0.0)
    return file_camera(scene, path, options["width"], options["height"], yfov, runtime)


def _camera_file(path: Path, options: dict[str, Any]) -> Camera:
    from ssgi_cl.rasterize.raster.default_camera import camera_from_json

    return camera_from_json(path, options["width"], options["height"])
