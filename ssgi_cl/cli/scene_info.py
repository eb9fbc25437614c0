"""The command `ssgi info`."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import Any

import click
import numpy as np

from ssgi_cl.cli.render import frame_arguments, render_command
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.frame.params import CONTACT, cell_size
from ssgi_cl.frame.render import default_ao_radius
from ssgi_cl.io.console import human_errors, json_option, printable, progress
from ssgi_cl.rasterize.scenes import is_scene, make_scene

_SHAPING = ("eye", "target", "up", "fov", "camera", "environment", "ambient", "width", "height", "device")
"""Options of `ssgi render` that this command has too."""


@click.command("info")
@click.argument("scene", metavar="SCENE")
@json_option
@human_errors
def info_command(scene: str, as_json: bool, **options: Any) -> None:
    """Say what SCENE holds and how `ssgi render` draws it: bounds, triangles, materials, textures,
    cameras and lights, with the camera, the lights and the AO radius that are used by default or
    with the options given, and what of the file is not drawn.

    Lengths are scene units, directions and positions world space, angles degrees; lights are in W.
    """
    plain = ["--output", "unused.png", "--", scene]
    defaults = render_command.make_context("render", plain).params
    with progress(as_json) as step:
        loaded, camera, lights, arguments = frame_arguments(scene, defaults | options, step)
        step("looking round")
        if is_scene(scene):
            direct = make_scene(scene).ao_radius
        else:
            direct = default_ao_radius(loaded, camera, arguments["runtime"])
    facts = _facts(scene, loaded, camera, lights, direct)
    if as_json:
        print(json.dumps(facts, indent=1))
        return
    for line in _lines(facts):
        click.echo(printable(line))


def _facts(name: str, scene: Scene, camera: Camera, lights: tuple[Light, ...], direct: float) -> dict[str, Any]:
    """Return what JSON holds; `direct` is the AO radius of frames without bounces."""
    used = np.bincount(scene.material_ids, minlength=len(scene.materials))
    return {
        "scene": name,
        "bounds": scene.bounds.tolist(),
        "triangles": len(scene.triangles),
        "vertices": len(scene.positions),
        "materials": [
            {
                "name": material.name,
                "triangles": int(count),
                "albedo": list(material.albedo),
                "texture": material.texture,
                "alpha_cutoff": material.alpha_cutoff,
                "emission": list(material.emission),
                "specular": list(material.specular),
                "gloss": material.gloss,
                "alpha": material.alpha,
                "blends": material.blends,
                "transmission": list(material.transmission),
            }
            for material, count in zip(scene.materials, used, strict=True)
        ],
        "textures": [[texture.shape[1], texture.shape[0]] for texture in scene.textures],
        "cameras": {name: _scene_camera(each) for name, each in scene.cameras.items()},
        "lights": [_light(light) for light in scene.lights],
        "camera": {**_place(camera.view), "width": camera.width, "height": camera.height, **_field(camera)},
        "used_lights": [_light(light) for light in lights],
        "ao_radius": CONTACT * cell_size(scene),
        "direct_ao_radius": direct,
        "notes": list(scene.notes),
    }


def _place(view: np.ndarray) -> dict[str, Any]:
    return {
        "eye": (-view[:3, :3].T @ view[:3, 3]).tolist(),
        "forward": (-view[2, :3]).tolist(),
        "up": view[1, :3].tolist(),
    }


def _field(camera: Camera) -> dict[str, float]:
    scale = float(camera.projection[1, 1])
    if camera.is_orthographic:
        return {"view_height": 2.0 / scale}
    return {"fov": math.degrees(2.0 * math.atan(1.0 / scale))}


def _scene_camera(camera: SceneCamera) -> dict[str, Any]:
    size = {"fov": math.degrees(camera.height)}
    if camera.kind == "orthographic":
        size = {"view_height": camera.height}
    far = camera.far if math.isfinite(camera.far) else None
    return {
        "kind": camera.kind,
        **_place(camera.view),
        **size,
        "aspect": camera.aspect,
        "near": camera.near,
        "far": far,
    }


def _light(light: Light) -> dict[str, Any]:
    """Return kind and values; an environment's image is given by its size and mean."""
    values: dict[str, Any] = {"kind": type(light).__name__}
    for field in fields(light):
        value = getattr(light, field.name)
        if isinstance(value, np.ndarray) and value.ndim == 3:
            values["image"] = [value.shape[1], value.shape[0]]
            value = _sphere_mean(value)
        values[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
    for name in ("cone_angle", "angle"):
        if name in values:
            values[name] = math.degrees(values[name])
    return values


def _sphere_mean(image: np.ndarray) -> np.ndarray:
    """Return the mean radiance of a latitude-longitude image over the sphere."""
    edges = np.cos(np.linspace(0.0, math.pi, len(image) + 1))
    mean: np.ndarray = 0.5 * np.einsum("r,rd->d", edges[:-1] - edges[1:], image.mean(axis=1))
    return mean


def _lines(facts: dict[str, Any]) -> list[str]:
    """Return the lines of text."""
    low, high = facts["bounds"]
    textures = ", ".join(f"{wide} x {tall}" for wide, tall in facts["textures"])
    lines = [
        f"scene      {facts['scene']}",
        f"bounds     {_numbers(low)} to {_numbers(high)}",
        f"triangles  {facts['triangles']} of {facts['vertices']} vertices",
        f"textures   {len(facts['textures'])}" + (f": {textures}" if textures else ""),
        f"materials  {len(facts['materials'])}",
        *(_material_line(material) for material in facts["materials"]),
    ]
    for name, camera in facts["cameras"].items():
        lines.append(f"camera     {name!r}: {_camera_text(camera)}, {camera['kind']}")
    lines += [f"light      {_light_text(light)}" for light in facts["lights"]]
    lines += [f"note       {note}" for note in facts["notes"]]
    lines += ["drawn with", f"  camera   {_camera_text(facts['camera'])}"]
    lines += [f"  light    {_light_text(light)}" for light in facts["used_lights"]]
    return [*lines, f"  AO radius {facts['ao_radius']:.4g}, with --bounces 0 {facts['direct_ao_radius']:.4g}"]


def _material_line(material: dict[str, Any]) -> str:
    parts = [f"{material['triangles']} triangles", f"albedo {_numbers(material['albedo'])}"]
    if material["texture"] >= 0:
        parts.append(f"texture {material['texture']}")
    if material["alpha_cutoff"]:
        parts.append(f"cut out below {material['alpha_cutoff']:g}")
    if material["blends"]:
        parts.append(f"blended, opacity {material['alpha']:.4g}")
    if any(material["transmission"]):
        parts.append(f"transmission {_numbers(material['transmission'])}")
    if any(material["emission"]):
        parts.append(f"emission {_numbers(material['emission'])}")
    if any(material["specular"]):
        parts.append(f"specular {_numbers(material['specular'])}, gloss {material['gloss']:.4g}")
    return f"  {material['name'] or '(no name)'}: {', '.join(parts)}"


def _camera_text(camera: dict[str, Any]) -> str:
    size = f"fov {camera['fov']:.4g}" if "fov" in camera else f"height {camera['view_height']:.4g}"
    return f"eye {_numbers(camera['eye'])}, forward {_numbers(camera['forward'])}, {size}"


def _light_text(light: dict[str, Any]) -> str:
    values = [
        f"{name} {_numbers(value) if isinstance(value, list) else format(value, '.4g')}"
        for name, value in light.items()
        if name != "kind" and value != 0.0
    ]
    return f"{light['kind']}: {', '.join(values)}"


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value + 0.0:.4g}" for value in values)  # no -0


info_command.params += [option for option in render_command.params if option.name in _SHAPING]
