"""Pass: shadow maps of lights, and the reflective shadow map of all of them."""

from __future__ import annotations

from typing import Any

from ssgi_cl.core.lights import Environment
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, CROPS, GBUFFER, LIGHTS, RSM, SHADOWS
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.techniques.direct.light_data import power
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.techniques.direct.seen_depths import SeenDepths


def shadow_maps(build: Build) -> Stage:
    """Return the pass; it draws the reflective shadow map where a later pass reads it."""
    params = build.params
    reflects = params.kind in ("whole", "one bounce")
    maps = LightMaps(
        build.runtime,
        params.shadow_size,
        flux=reflects,
        glossy=getattr(build.techniques[1], "glossy_vpls", 0) > 0,
        rsm_size=params.rsm_size,
    )
    keep = "maps" in params.skips
    # Maps are fitted to what is seen, but for SSDO, whose auxiliary cameras see more.
    depths = None if params.kind == "ssdo" else SeenDepths(build.runtime, build.size)

    def run(r: Declared) -> Any:
        lit = any(not isinstance(light, Environment) and power(light).any() for light in r[LIGHTS])
        seen = depths.find(r[GBUFFER]) if depths is not None and lit else None
        shadows, rsm = maps.draw(
            r[CASTING], r[LIGHTS], keep=keep, seen=seen, crops_before=r[CROPS] if build.history else None
        )
        return (shadows, rsm) if reflects else shadows

    return Stage(
        name="shadow maps",
        reads=(CASTING, LIGHTS, *((GBUFFER,) if depths is not None else ()), *((CROPS,) if build.history else ())),
        writes=(SHADOWS, RSM) if reflects else (SHADOWS,),
        run=run,
        on_demand=True,
    )
