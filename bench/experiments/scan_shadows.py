"""The filter of shadow maps against rays: in float64, by the numpy reference of the kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import DirectionalLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.rasterize import rsm
from ssgi_cl.reference.direct import shade as reference
from ssgi_cl.techniques.direct.light_data import PunctualLight
from ssgi_cl.truth.raycast import RayCaster
from ssgi_cl.tuning.context import Context

from .scan import Measured, Scan, replaced

MAP_SIZE = 1024
"""Texels along a side of a map: the default of `render`."""
WRONG = 0.5
"""A pixel is wrong whose share of light is further than this from what its ray tells."""
_SHORT = 1.0 - 1e-4
"""Share of the way to a light that a ray goes: what the light sits in casts no shadow."""

Doubles = NDArray[np.float64]
Lit = tuple[ReflectiveShadowMap, Doubles, Doubles, NDArray[np.bool_]]
"""A map; position and normal [n, 3] of the pixels that face the light; whether it reaches them."""


def shadow_errors(context: Context, values: Mapping[str, Any]) -> Measured:
    """Return RMSE of the share of light, and percent of the pixels where it is wrong.

    Only pixels that face the light and lie in its cone count, those of all lights alike.

    Args:
        context: the scene; its punctual lights count.
        values: `reach` in texels, `slope`, `least`, `step`, `rounding` of
            kernels/direct/shadow.clh.
    """
    off = []
    for made, position, normal, seen in context.shared("shadow truth", lambda: _truth(context)):
        with replaced(reference, values):
            share = reference.shadow_reference(made, position[:, None], normal[:, None])[:, 0]
        off.append(share - seen)
    every = np.abs(np.concatenate(off))
    return Measured(float(np.sqrt(np.mean(every**2))), 100.0 * float(np.mean(every > WRONG)))


def _truth(context: Context) -> list[Lit]:
    """Return, for each light that reaches any pixel, what the rays to it tell."""
    scene, camera = context.view.scene, context.camera
    caster = RayCaster(scene)
    spots = caster.spots(camera, slice(0, camera.height), context.host_gbuffer)
    position, normal, _ = reference.world_surface(context.host_gbuffer)
    position = position.reshape(-1, 3)[spots.pixel]
    normal = normal.reshape(-1, 3)[spots.pixel]
    start = spots.start.astype(np.float64) / caster.scale + scene.origin
    found: list[Lit] = []
    for light in context.punctual_lights:
        lit = np.any(reference.direct_reference(light, position, normal) > 0.0, axis=-1)
        if not lit.any():
            continue
        way, length = towards(light, start[lit], scene.bounds)
        blocked = caster.blocked(spots.start[lit], way.astype(np.float32), (length * caster.scale).astype(np.float32))
        made = rsm(scene, light, size=MAP_SIZE, runtime=context.runtime)
        found.append((made, position[lit], normal[lit], ~blocked))
    if not found:
        raise ValueError(f"{context.view.name}: no punctual light reaches what is seen")
    return found


def towards(light: PunctualLight, start: Doubles, bounds: Doubles) -> tuple[Doubles, Doubles]:
    """Return directions [n, 3] to a light, and how far to go [n]."""
    if isinstance(light, DirectionalLight):
        far = 2.0 * float(np.linalg.norm(bounds[1] - bounds[0]))
        way = np.broadcast_to(-np.asarray(light.direction, np.float64), start.shape)
        return way, np.full(len(start), far)
    to_light = np.asarray(light.position) - start
    length = np.linalg.norm(to_light, axis=-1)
    return to_light / length[:, None], length * _SHORT


SCANS: Mapping[str, Scan] = {"shadow_map": Scan(shadow_errors, "RMSE of the share of light", "wrong pixels (%)")}
