"""Pass: directional occlusion, which lights and occludes in one."""

from __future__ import annotations

from collections.abc import Callable

from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import (
    AO,
    CAMERA,
    CASTING,
    DIRECT,
    GBUFFER,
    INDIRECT,
    INDIRECT_PARAMS,
    LIGHTS,
    SHADOWS,
)
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.techniques.ssdo.ssdo import Ssdo


def ssdo(build: Build) -> tuple[list[Stage], Callable[[DeviceGBuffer], None]]:
    """Return the pass with that of the occlusion which it replaces, and what looks at G-buffers."""
    params, views = build.params, None
    technique = Ssdo(build.runtime, build.size, build.techniques[1], build.margin, params.layers, params.layers)
    if params.auxiliary_cameras:
        views = AuxiliaryViews(build.runtime, params.auxiliary_cameras)

    def run(r: Values) -> tuple[Plane | None, Plane | None]:
        technique.params = r[INDIRECT_PARAMS]
        seen, lights = r[GBUFFER], r[LIGHTS]
        extra = views.drawn(r[CASTING], r[CAMERA], seen, lights) if views is not None else ()
        found = technique.run(seen, lights, shadows=r[SHADOWS], auxiliary_views=extra)
        return found.direct, found.bounce

    replaced = Stage(
        name="ambient occlusion",
        reads=(GBUFFER,),
        writes=(AO,),
        run=lambda r: None,
        condition=lambda facts: "ssdo hides ambient light by itself",
    )
    light = Stage(
        name="ssdo",
        reads=(GBUFFER, CASTING, CAMERA, LIGHTS, SHADOWS, INDIRECT_PARAMS),
        hints=(AO,),
        writes=(DIRECT, INDIRECT),
        run=run,
    )
    return [replaced, light], technique.look
