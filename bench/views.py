"""The scenes that are measured: built-in ones by name, any other by its file."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ssgi_cl.camera import Camera
from ssgi_cl.rasterize import load_scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.render import AO_RADIUS_SHARE
from ssgi_cl.runtime import Runtime
from ssgi_cl.viewpoint import camera_from_json, default_camera, default_lights

_PIXELS = (800, 600)
_YFOV = math.radians(50.0)


def views_of(names: Sequence[str], runtime: Runtime) -> dict[str, BuiltinScene]:
    """Return name -> scene with lights and a view.

    Args:
        names: keys of `BUILTIN_SCENES`, or files, which get the name of the file without its
            ending, and where that has other letters than a-z, 0-9, _ and -, an underscore.
        runtime: the device that looks round in a file's scene for a view.

    Raises:
        ValueError: two scenes have one name, or no scene is called so and no file either.
        SceneError: a file can't be read.
    """
    found: dict[str, BuiltinScene] = {}
    for name in names:
        if name in BUILTIN_SCENES:
            view = BUILTIN_SCENES[name]()
        elif Path(name).suffix:
            view = _from_file(Path(name), runtime)
        else:
            raise ValueError(
                f"scene is {name!r}: expected a file or one of {', '.join(BUILTIN_SCENES)}"
            )
        if view.name in found:
            raise ValueError(f"two scenes are called {view.name!r}: expected different names")
        found[view.name] = view
    return found


def _from_file(path: Path, runtime: Runtime) -> BuiltinScene:
    scene = load_scene(path)
    beside = path.with_name(path.stem + ".scene.json")
    if beside.is_file():
        camera = camera_from_json(beside, *_PIXELS)
    else:
        camera = default_camera(scene, *_PIXELS, _YFOV, runtime)
    low, high = scene.bounds
    return BuiltinScene(
        name=re.sub(r"[^A-Za-z0-9_-]", "_", path.stem),
        scene=scene,
        eye=_vector(camera.position),
        target=_vector(camera.position - camera.view[2, :3]),
        up=_vector(camera.view[1, :3]),
        yfov=_vertical_fov(camera),
        lights=tuple(default_lights(scene, camera, runtime)),
        ao_radius=AO_RADIUS_SHARE * (float(np.linalg.norm(high - low)) or 1.0),
    )


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _vertical_fov(camera: Camera) -> float:
    return 2.0 * math.atan(1.0 / float(camera.projection[1, 1]))
