"""The present look as Python that makes the same picture."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from ssgi_cl.core.lights import Environment, Light
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.viewer.look import Look
from ssgi_cl.viewer.source import Source

_GBUFFER_CALLS = {"normals": "normal", "depth": "depth", "albedo": "albedo"}


def code(source: Source, look: Look) -> str:
    """Return lines of Python that give the picture of a look; the whole frame, whichever output is shown."""
    params = look.settings.params
    lights = _lights(source, look)
    if source.scene is None:
        return "\n".join(["import ssgi_cl as gi", "", *source.code, *lights, *_gbuffer_call(look)])
    width, height = look.size
    pose = look.pose
    camera = [
        "camera = gi.Camera.look_at(",
        f"    {_tuple(pose.eye)},",
        f"    {_tuple(pose.target)},",
        f"    {_tuple(pose.up)},",
        f"    yfov={pose.yfov:.6g},",
        f"    width={width},",
        f"    height={height},",
        ")",
    ]
    given = "".join(f", {name}={value}" for name, value in _changed(params))
    lines = [*camera, *source.code] if "camera" in "".join(source.code) else [*source.code, *camera]
    return "\n".join(
        [
            "import ssgi_cl as gi",
            "",
            *lines,
            *lights,
            f"frame = gi.render(scene, camera, lights{given})",
            'frame.save("picture.png")',
        ]
    )


def _gbuffer_call(look: Look) -> list[str]:
    occlusion = look.settings.params.techniques(look.settings.radius)[0]
    if look.output in _GBUFFER_CALLS:
        return [f"plane = gbuffer.first({_GBUFFER_CALLS[look.output]!r})"]
    if occlusion is None:
        return ["radiance = gi.shade(gbuffer, lights)"]
    name = look.settings.params.ao_name
    given = "".join(f", {name}={value}" for name, value in _changed(occlusion, always=("radius",)))
    lines = [f"ao = gi.{name}(gbuffer{given})"]
    return lines if look.output == "ao" else [*lines, "radiance = gi.shade(gbuffer, lights, ao=ao)"]


def _changed(params: Params, always: tuple[str, ...] = ()) -> list[tuple[str, str]]:
    """Return name and code of the parameters that have not their defaults."""
    found = []
    for name, declared in parameter_fields(type(params)).items():
        value = getattr(params, name)
        if name in always or (value != declared.default and not (isinstance(params, FrameParams) and name == "skips")):
            found.append((name, _value(value)))
    return found


def _value(value: Any) -> str:
    if isinstance(value, Params):
        inside = ", ".join(f"{name}={each}" for name, each in _changed(value, _radius(value)))
        return f"gi.{type(value).__name__}({inside})"
    return f"{value:.6g}" if isinstance(value, float) and np.isfinite(value) else repr(value)


def _radius(params: Params) -> tuple[str, ...]:
    return ("radius",) if "radius" in parameter_fields(type(params)) else ()


def _lights(source: Source, look: Look) -> list[str]:
    if len(source.lights) == len(look.shining) and all(
        a is b for a, b in zip(source.lights, look.shining, strict=True)
    ):
        return []
    lines = ["lights = ["]
    for light in look.shining:
        same = next((index for index, each in enumerate(source.lights) if each is light), None)
        lines.append(f"    {_light(light) if same is None else f'lights[{same}]'},")
    return [*lines, "]"]


def _light(light: Light) -> str:
    if isinstance(light, Environment) and np.asarray(light.radiance).ndim == 3:
        return "...  # an environment's image, of other power or colour"
    given = ", ".join(f"{each.name}={_tuple(getattr(light, each.name))}" for each in fields(light))
    return f"gi.{type(light).__name__}({given})"


def _tuple(value: Any) -> str:
    values = np.asarray(value, np.float64)
    return f"{values:.6g}" if values.ndim == 0 else f"({', '.join(f'{each:.6g}' for each in values)})"
