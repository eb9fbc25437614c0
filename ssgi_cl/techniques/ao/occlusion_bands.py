"""How far ambient occlusion reads round a row: what bands of an image need."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.checks import LEAST_DEPTH
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import NORMAL_ROWS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS, OcclusionParams, OcclusionTechnique
from ssgi_cl.techniques.bands import Plan, Planner
from ssgi_cl.techniques.presets.choose import params_for

Reach = Callable[[Any, Camera, int, float], float]
"""Of parameters, the camera, the number of layers and the least depth: how many rows a receiver reads at most."""


def occlusion_plan(technique: type[OcclusionTechnique], reach: Reach) -> Planner:
    """Return the plan of a technique of ambient occlusion.

    Args:
        technique: its class.
        reach: how many rows beyond its own a receiver reads at most.
    """

    def plan(gbuffer: GBuffer, runtime: Runtime, arguments: Mapping[str, Any]) -> Plan:
        params = params_for(technique, gbuffer, runtime, **arguments)
        beyond = RESOLUTIONS[params.resolution] + NORMAL_ROWS

        def read(nearest: float) -> float:
            return reach(params, gbuffer.camera, gbuffer.layers, max(nearest, LEAST_DEPTH)) + beyond

        fields = {each.name: getattr(params, each.name) for each in dataclasses.fields(params)}
        return Plan(fields, filtered_rows(params), read)

    return plan


def filtered_rows(params: OcclusionParams) -> int:
    """Return how many rows away a result counts in what blur and upsampling make of it."""
    step = RESOLUTIONS[params.resolution]
    per_row = step if params.blur_resolution == "own" else 1
    blurred = per_row * params.blur.radius * params.blur.passes
    return blurred + (2 * step if step > 1 else 0)


def widest_ray(camera: Camera) -> float:
    """Return the greatest length of a pixel's view ray per unit of depth; 1 of an orthographic camera."""
    if camera.is_orthographic:
        return 1.0
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    across = max(abs(at_x), abs(at_x + to_x * camera.width))
    down = max(abs(at_y), abs(at_y + to_y * camera.height))
    return math.sqrt(1.0 + across**2 + down**2)


def pixels_per_depth(camera: Camera, nearest: float) -> float:
    """Return the most pixels of a scene unit across the view at a depth of at least `nearest`."""
    to_x, to_y = camera.pixel_to_view[:2]
    unit = 1.0 / min(abs(to_x), abs(to_y))
    return unit if camera.is_orthographic else unit / nearest
