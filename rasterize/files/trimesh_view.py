"""Lights and the camera of a scene of trimesh, as far as they were set: it makes some when it is asked for them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.scene import lighting

from ssgi_cl.core.errors import shown
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.rasterize.files.gltf_schema import Json
from ssgi_cl.rasterize.files.gltf_view import placed_camera, placed_light

_TYPES = {lighting.PointLight: "point", lighting.SpotLight: "spot", lighting.DirectionalLight: "directional"}


def view_of(source: trimesh.Scene) -> tuple[tuple[Light, ...], dict[str, SceneCamera], list[str]]:
    """Return the lights and the camera of a scene, and a line for each thing of them that is not drawn.

    Units are glTF's: candela and lux, of which 683 are a W/sr and a W/m^2. Colours are linear.
    """
    notes: list[str] = []
    lights: list[Light] = []
    # Private, as asking by the public name makes lights and puts them into the graph.
    given: Any = getattr(source, "_lights", None) or ()
    if not _automatic(source, given):
        for light in given:
            matrix = _matrix(source, light.name)
            name = shown(str(light.name))
            if matrix is None:
                notes.append(f"light {name} is left out: no node of the scene places it")
            else:
                lights += placed_light(_described(light), matrix, name, notes)
    cameras: dict[str, SceneCamera] = {}
    if source.has_camera:
        camera = source.camera
        name = str(camera.name)
        matrix = _matrix(source, name)
        if matrix is None:
            notes.append(f"camera {shown(name)} is left out: no node of the scene places it")
        else:
            across, down = (math.radians(float(angle)) for angle in camera.fov)
            lens: Json = {"yfov": down, "aspectRatio": math.tan(0.5 * across) / math.tan(0.5 * down)}
            lens |= {"znear": float(camera.z_near), "zfar": float(camera.z_far)}
            cameras = placed_camera({"type": "perspective", "perspective": lens}, matrix, name, notes)
    return tuple(lights), cameras, notes


def _automatic(source: trimesh.Scene, given: Any) -> bool:
    """Return whether the lights are those that trimesh makes: two plain points at the corners of the bounds."""
    plain = lighting.PointLight()  # type: ignore[no-untyped-call]
    if len(given) != 2 or source.bounds is None:
        return False
    for light, corner in zip(given, source.bounds, strict=True):
        matrix = _matrix(source, light.name)
        alike = type(light) is lighting.PointLight and light.intensity == plain.intensity and light.radius is None
        if not alike or not np.array_equal(light.color, plain.color):
            return False
        if matrix is None or not np.allclose(matrix[:3, 3], corner):
            return False
    return True


def _matrix(source: trimesh.Scene, name: str) -> NDArray[np.float64] | None:
    """Return [4, 4] of a node in the world; None if there is none."""
    if name not in source.graph.nodes:
        return None
    return np.asarray(source.graph[name][0], np.float64)


def _described(light: Any) -> Json:
    """Return a light as glTF describes one."""
    kind = next((name for each, name in _TYPES.items() if isinstance(light, each)), type(light).__name__)
    color = (np.asarray(light.color, np.float64)[:3] / 255.0).tolist()
    described: Json = {"type": kind, "color": color, "intensity": float(light.intensity)}
    if light.radius is not None and kind != "directional":
        described["range"] = float(light.radius)
    if kind == "spot":
        outer = float(light.outerConeAngle)
        # trimesh allows both to be the same, a sharp edge; glTF does not.
        described["spot"] = {"innerConeAngle": min(light.innerConeAngle, outer * (1.0 - 1e-9)), "outerConeAngle": outer}
    return described
