"""Lights and cameras of a glTF document: KHR_lights_punctual and the core format's cameras."""

from __future__ import annotations

import math
from itertools import chain, count

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import shown
from ssgi_cl.core.lights import DirectionalLight, Light, PointLight, SpotLight
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.rasterize.files.gltf_document import item
from ssgi_cl.rasterize.files.gltf_schema import LIGHTS, Json

Matrix = NDArray[np.float64]

LUMENS_PER_WATT = 683.0
"""By which candela and lux become W/sr and W/m^2: the candela's definition, at 555 nm. Blender
multiplies its watts by it when it writes, so that its lights come back as they were."""

_WIDEST_CONE = 1.5  # radians, of SpotLight


def lights_of(document: Json, placed: list[tuple[int, Matrix]], notes: list[str]) -> tuple[Light, ...]:
    """Return the lights of placed nodes; `notes` gets what of them is not drawn.

    A point light of I cd has a radiant intensity of I / 683 W/sr, a directional one of E lx an
    irradiance of E / 683 W/m^2, each times its linear colour. A spot's soft edge becomes a sharp
    one with the same flux: cos(cone_angle) = (2 cos(inner) + cos(outer)) / 3, from the square law
    of the extension's implementation note.
    """
    entries = document.get("extensions", {}).get(LIGHTS, {}).get("lights", [])
    lights: list[Light] = []
    for index, matrix in placed:
        node = document["nodes"][index]
        reference = node.get("extensions", {}).get(LIGHTS)
        if reference is None:
            continue
        source: Json = item(entries, reference["light"], f"the light of node {index}")
        name = shown(node.get("name") or source.get("name") or f"light {index}")
        lights += placed_light(source, matrix, name, notes)
    return tuple(lights)


def placed_light(source: Json, matrix: Matrix, name: str, notes: list[str]) -> list[Light]:
    """Return the light of a description in a list, empty if it cannot be used, which `notes` then says.

    Args:
        source: as the extension KHR_lights_punctual has it.
        matrix: [4, 4], of its node.
        name: fit to be printed.
        notes: gets what of it is not drawn.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused by the light
            light = _light(source, matrix)
    except (ValueError, TypeError) as error:
        notes.append(f"light {name} is left out: {error}")
        return []
    if "range" in source:
        notes.append(f"light {name}: its range is not used, light falls off with distance only")
    cone = _cone(source)
    if source["type"] == "spot" and cone[1] - cone[0] > math.radians(1.0):
        soft, hard = tuple(map(math.degrees, cone)), math.degrees(_sharp(*cone))
        notes.append(
            f"light {name}: its soft edge from {soft[0]:.1f} to {soft[1]:.1f} degrees is drawn "
            f"as a sharp one of the same flux at {hard:.1f}"
        )
    return [light]


def _light(source: Json, matrix: Matrix) -> Light:
    kind = source["type"]
    color = np.array(source.get("color", [1.0] * 3), np.float64)
    strength = color * (source.get("intensity", 1.0) / LUMENS_PER_WATT)
    if kind == "point":
        return PointLight(matrix[:3, 3], strength)
    if kind == "directional":
        return DirectionalLight(-_axis(matrix, 2), strength)
    if kind != "spot":
        raise ValueError(f"type is {shown(kind)}: expected 'point', 'spot' or 'directional'")
    inner, outer = _cone(source)
    if not 0.0 <= inner < outer <= math.pi / 2 + 1e-6:
        raise ValueError(f"its cone angles are {inner:g} and {outer:g}: expected 0 <= inner < outer <= pi / 2")
    return SpotLight(matrix[:3, 3], -_axis(matrix, 2), _sharp(inner, outer), strength)


def _cone(source: Json) -> tuple[float, float]:
    """Return the half-angles of a spot between which its light fades, in radians."""
    spot = source.get("spot", {})
    return float(spot.get("innerConeAngle", 0.0)), float(spot.get("outerConeAngle", math.pi / 4))


def _sharp(inner: float, outer: float) -> float:
    """Return the half-angle of the cone that sends the flux of one that fades.

    With u the cosine to the axis, intensity falls as ((u - cos(outer)) / (cos(inner) - cos(outer)))
    squared, whose integral over u is a third of the cosines' difference.
    """
    cosine = (2.0 * math.cos(inner) + math.cos(outer)) / 3.0
    return min(math.acos(min(cosine, 1.0)), _WIDEST_CONE)


def cameras_of(document: Json, placed: list[tuple[int, Matrix]], notes: list[str]) -> dict[str, SceneCamera]:
    """Return name -> camera of placed nodes; `notes` gets those that cannot be used.

    Names are those of nodes, else of cameras, else "camera N" with the node's number; one that is
    taken gets " (2)" and so on.
    """
    entries = document.get("cameras", [])
    cameras: dict[str, SceneCamera] = {}
    for index, matrix in placed:
        node = document["nodes"][index]
        if "camera" not in node:
            continue
        source: Json = item(entries, node["camera"], f"the camera of node {index}")
        plain = str(node.get("name") or source.get("name") or f"camera {index}")
        numbered = (f"{plain} ({number})" for number in count(2))
        name = next(each for each in chain([plain], numbered) if each not in cameras)
        cameras |= placed_camera(source, matrix, name, notes)
    return cameras


def placed_camera(source: Json, matrix: Matrix, name: str, notes: list[str]) -> dict[str, SceneCamera]:
    """Return the camera of a description by its name, none if it cannot be used, which `notes` then says.

    Args:
        source: as glTF has it.
        matrix: [4, 4], of its node.
        name: as the scene has it.
        notes: gets why it is left out.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused by the camera
            return {name: _camera(source, matrix)}
    except (ValueError, TypeError) as error:
        notes.append(f"camera {shown(name)} is left out: {error}")
        return {}


def _camera(source: Json, matrix: Matrix) -> SceneCamera:
    # Axes of the node without its scale; a mirrored node's camera is not mirrored.
    back, up = _axis(matrix, 2), _axis(matrix, 1)
    right = np.cross(up, back)
    length = float(np.linalg.norm(right))
    if not length > 1e-6:
        raise ValueError("the axes of its node are parallel")
    right /= length
    view = np.eye(4)
    view[:3, :3] = right, np.cross(back, right), back
    view[:3, 3] = -view[:3, :3] @ matrix[:3, 3]
    kind = source["type"]
    if kind not in ("perspective", "orthographic") or kind not in source:
        raise ValueError(f"type is {shown(kind)}: expected 'perspective' or 'orthographic'")
    values: Json = source[kind]
    if kind == "perspective":
        return SceneCamera(
            view=view,
            height=values["yfov"],
            aspect=values.get("aspectRatio"),
            near=values["znear"],
            far=values.get("zfar", math.inf),
        )
    wide, tall = values["xmag"], values["ymag"]
    if not (wide > 0 and tall > 0):
        raise ValueError(f"xmag and ymag are {wide:g} and {tall:g}: expected numbers > 0")
    return SceneCamera(
        view=view, kind="orthographic", height=2.0 * tall, aspect=wide / tall, near=values["znear"], far=values["zfar"]
    )


def _axis(matrix: Matrix, index: int) -> NDArray[np.float64]:
    """Return a node's axis in world space, of unit length."""
    axis: NDArray[np.float64] = matrix[:3, index]
    length = float(np.linalg.norm(axis))
    if not 1e-30 < length < 1e30:
        raise ValueError("the axes of its node have no usable length")
    return axis / length
