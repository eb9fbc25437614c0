"""Check and upload of shadow maps that a caller gives as reflective shadow maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ssgi_cl.core.lights import Environment, Light, light_tuple
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.light_data import ShadowMap, face_count
from ssgi_cl.techniques.direct.shadow_fit import whole

Maps = Sequence[ReflectiveShadowMap | None] | None
"""A map or None for each light; None for no map at all. Entries of environments are ignored."""


def checked_lights(lights: Sequence[Light], shadow_maps: Maps) -> tuple[Light, ...]:
    """Return the lights; raise TypeError or ValueError if one is no light, or a map is not its own."""
    lights = light_tuple(lights)
    if shadow_maps is not None and len(shadow_maps) != len(lights):
        raise ValueError(f"shadow_maps has {len(shadow_maps)} entries: expected {len(lights)}, one for each light")
    for index, rsm in enumerate(shadow_maps or ()):
        if rsm is not None and not isinstance(lights[index], Environment):
            _checked(rsm, lights[index], index)
    return lights


def uploaded_maps(lights: Sequence[Light], shadow_maps: Maps, runtime: Runtime) -> list[ShadowMap | None]:
    """Return the shadow map of each light; memory is kept by the runtime and used again."""
    shadows: list[ShadowMap | None] = [None] * len(lights)
    for index, rsm in enumerate(shadow_maps or ()):
        if rsm is not None and not isinstance(lights[index], Environment):
            shadows[index] = _uploaded(rsm, runtime, index)
    return shadows


def _checked(rsm: object, light: Light, index: int) -> None:
    if not isinstance(rsm, ReflectiveShadowMap):
        raise TypeError(f"shadow_maps[{index}] is {type(rsm).__name__}: expected a ReflectiveShadowMap or None")
    if type(rsm.light) is not type(light):
        raise ValueError(
            f"shadow_maps[{index}] is that of a {type(rsm.light).__name__}: expected one of "
            f"lights[{index}], a {type(light).__name__}"
        )
    sizes = {camera.size for camera in rsm.cameras}
    count = face_count(light)
    if len(rsm.cameras) != count or len(sizes) != 1 or len(set(*sizes)) != 1:
        raise ValueError(
            f"shadow_maps[{index}] has {len(rsm.cameras)} cameras of {sorted(sizes)} texels: expected "
            f"{count}, square and of one size"
        )


def _uploaded(rsm: ReflectiveShadowMap, runtime: Runtime, index: int) -> ShadowMap:
    size = rsm.cameras[0].size
    count = len(rsm.cameras)
    kept: ShadowMap = runtime.prepared(
        (ShadowMap, index, count, size),
        lambda: ShadowMap.of(
            runtime.plane(count, size, np.inf),
            rsm.cameras,
            whole(count),
            tuple(range(count)),
            ShadowMap.new_table(runtime, count),
        ),
    )
    kept.depth.upload(np.asarray(rsm.depth).reshape(count, *size))
    return replace(kept, cameras=rsm.cameras)
