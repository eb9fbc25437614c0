"""Scenes by name, or by their file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.errors import SceneError
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import default_ao_radius
from ssgi_cl.rasterize import load_scene
from ssgi_cl.rasterize.files.load import READERS
from ssgi_cl.rasterize.raster.default_camera import camera_from_json, default_camera, default_lights
from ssgi_cl.rasterize.scenes import SCENE_NAMES, BuiltinScene, is_scene, make_scene

_PIXELS = (800, 600)
_SPOT = "-spot"
_YFOV = math.radians(50.0)


class MissingMeshError(SceneError):
    """A view's mesh is not where it is looked for."""


def views_of(names: Sequence[str], runtime: Runtime, meshes: Path | None = None) -> dict[str, BuiltinScene]:
    """Return name -> scene with lights and a view.

    Args:
        names: built-in or generated scenes (see `make_scene`), one whose lights stand in for what
            its surfaces emit with "-spot" for these lights alone, or files, which get the name of the
            file without its ending, and where that has other letters than a-z, 0-9, _ and -, an
            underscore. A file is a mesh, with its camera in NAME.scene.json beside it if there is
            one, else that of the mesh's file if it has one, or a view: NAME.json with a camera (see
            `camera_from_json`) and `mesh`, the file of the mesh, as seen from `meshes`. Either may
            have `ao_radius`, how far ambient occlusion reaches in scene units; without, see
            `default_ao_radius`.
        runtime: the device that looks round in a file's scene for a view.
        meshes: the folder of the views' meshes; each view's own without.

    Raises:
        ValueError: two scenes have one name, no scene is called so and no file either, or what
            is said of a view is not usable.
        MissingMeshError: the mesh of a view is not there; a SceneError.
        SceneError: a file can't be read.
    """
    found: dict[str, BuiltinScene] = {}
    for name in names:
        if is_scene(name):
            view = make_scene(name)
        elif name.endswith(_SPOT) and is_scene(name.removesuffix(_SPOT)):
            view = _without_emission(make_scene(name.removesuffix(_SPOT)))
        elif Path(name).is_file() or Path(name).suffix.lower() in (*READERS, ".json"):
            view = _from_file(Path(name), runtime, meshes)
        else:
            raise ValueError(f"scene is {name!r}: expected a file or one of {SCENE_NAMES}")
        if view.name in found:
            raise ValueError(f"two scenes are called {view.name!r}: expected different names")
        found[view.name] = view
    return found


def _without_emission(view: BuiltinScene) -> BuiltinScene:
    """Return a view by the lights that stand in for its emission, if they do."""
    if not view.lights_stand_in:
        raise ValueError(f"scene is {view.name + _SPOT!r}: the lights of {view.name} stand in for no emission")
    materials = tuple(replace(material, emission=(0.0, 0.0, 0.0)) for material in view.scene.materials)
    return replace(view, name=view.name + _SPOT, scene=replace(view.scene, materials=materials), lights_stand_in=False)


def _from_file(path: Path, runtime: Runtime, meshes: Path | None) -> BuiltinScene:
    mesh, radius = path, None
    about = path if path.suffix == ".json" else path.with_name(path.stem + ".scene.json")
    camera = None
    if about == path or about.is_file():
        camera = camera_from_json(about, *_PIXELS)
        fields = json.loads(about.read_text(encoding="utf-8"))
        if about == path:
            mesh = (meshes or path.parent) / _mesh(path, fields)
        if "ao_radius" in fields:
            radius = checks.number(f"ao_radius in {about}", fields["ao_radius"], low=0, above=True, unit="scene units")
        if not mesh.is_file():
            raise MissingMeshError(f"{mesh}: there is no such file (--meshes FOLDER)")
    scene = load_scene(mesh)
    for own in scene.cameras.values():
        if camera is None and own.kind == "perspective":
            camera = own.sized(*_PIXELS)
    camera = camera or default_camera(scene, *_PIXELS, _YFOV, runtime)
    return BuiltinScene(
        name=re.sub(r"[^A-Za-z0-9_-]", "_", path.stem),
        scene=scene,
        eye=_vector(camera.position),
        target=_vector(camera.position - camera.view[2, :3]),
        up=_vector(camera.view[1, :3]),
        yfov=2.0 * math.atan(1.0 / float(camera.projection[1, 1])),
        lights=scene.lights or default_lights(scene, camera, runtime),
        ao_radius=radius or default_ao_radius(scene, camera, runtime),
    )


def _mesh(path: Path, fields: dict[str, Any]) -> str:
    """Return the name of the mesh that a view is of."""
    if not isinstance(fields.get("mesh"), str):
        raise ValueError(f"the view {path} lacks mesh: expected the name of a mesh's file")
    return str(fields["mesh"])


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
