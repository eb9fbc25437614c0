"""The command `ssgi info`."""

from __future__ import annotations

import json
import math
from typing import Any

import click
import numpy as np

from ssgi_cl.cli.facts import camera_facts, light_facts, placed
from ssgi_cl.cli.frame_arguments import frame_arguments
from ssgi_cl.cli.render import render_command
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.digits import place_text
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
        "lights": [light_facts(light) for light in scene.lights],
        "camera": camera_facts(camera),
        "used_lights": [light_facts(light) for light in lights],
        "ao_radius": CONTACT * cell_size(scene),
        "direct_ao_radius": direct,
        "notes": list(scene.notes),
    }


def _scene_camera(camera: SceneCamera) -> dict[str, Any]:
    size = {"fov": math.degrees(camera.height)}
    if camera.kind == "orthographic":
        size = {"view_height": camera.height}
    far = camera.far if math.isfinite(camera.far) else None
    return {
        "kind": camera.kind,
        **placed(camera.view),
        **size,
        "aspect": camera.aspect,
        "near": camera.near,
        "far": far,
    }


def _lines(facts: dict[str, Any]) -> list[str]:
    """Return the lines of text."""
    low, high = facts["bounds"]
    extent = math.dist(low, high)
    textures = ", ".join(f"{wide} x {tall}" for wide, tall in facts["textures"])
    lines = [
        f"scene      {facts['scene']}",
        f"bounds     {place_text(low, extent)} to {place_text(high, extent)}",
        f"triangles  {facts['triangles']} of {facts['vertices']} vertices",
        f"textures   {len(facts['textures'])}" + (f": {textures}" if textures else ""),
        f"materials  {len(facts['materials'])}",
        *(_material_line(material) for material in facts["materials"]),
    ]
    for name, camera in facts["cameras"].items():
        lines.append(f"camera     {name!r}: {_camera_text(camera, extent)}, {camera['kind']}")
    lines += [f"light      {_light_text(light, extent)}" for light in facts["lights"]]
    lines += [f"note       {note}" for note in facts["notes"]]
    lines += ["drawn with", f"  camera   {_camera_text(facts['camera'], extent)}"]
    lines += [f"  light    {_light_text(light, extent)}" for light in facts["used_lights"]]
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


def _camera_text(camera: dict[str, Any], extent: float) -> str:
    size = f"fov {camera['fov']:.4g}" if "fov" in camera else f"height {camera['view_height']:.4g}"
    return f"eye {place_text(camera['eye'], extent)}, forward {_numbers(camera['forward'])}, {size}"


def _light_text(light: dict[str, Any], extent: float) -> str:
    def text(name: str, value: Any) -> str:
        if not isinstance(value, list):
            return format(value, ".4g")
        return place_text(value, extent) if name == "position" else _numbers(value)

    values = [f"{name} {text(name, value)}" for name, value in light.items() if name != "kind" and value != 0.0]
    return f"{light['kind']}: {', '.join(values)}"


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value + 0.0:.4g}" for value in values)  # no -0


info_command.params += [option for option in render_command.params if option.name in _SHAPING]
