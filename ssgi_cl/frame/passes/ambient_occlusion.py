"""Pass: ambient occlusion by a technique of the catalogue."""

from __future__ import annotations

from typing import Any

from ssgi_cl.core.lights import Environment, shines
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import AO, AO_PARAMS, CASTING, GBUFFER, LIGHTS
from ssgi_cl.frame.stage import Declared, Stage, Values
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.techniques.sky_rays.enclosed import sky_by_rays


def ambient_occlusion(build: Build) -> list[Stage]:
    """Return the pass, or none where the frame has no ambient occlusion. With SSDO it is idle, and says why."""
    params = build.techniques[0]
    if build.ssdo is not None:
        reason = "ssdo hides ambient light by itself"
        return [Stage(name="ambient occlusion", writes=(AO,), run=lambda r: None, condition=lambda facts: reason)]
    if params is None:
        return []
    name = build.params.ao_name or ""
    technique: Any = TECHNIQUES[name].technique(build.runtime, build.size, params, build.margin, build.params.layers)
    dark = "dark" in build.params.skips and not build.params.dims_indirect

    def condition(facts: Values) -> str | None:
        if AO in facts["outputs"] or not dark:
            return None
        if build.params.kind == "whole" and not rays_meet_triangles(facts[CASTING]):
            return None  # it stands in for blockers that rays through the grid miss near their ends
        if not any(isinstance(light, Environment) and shines(light) for light in facts[LIGHTS]):
            return "no ambient light for it to dim"
        if build.params.kind == "whole" and sky_by_rays(facts[CASTING], build.runtime):
            return "rays find what blocks the light of environments"
        return None

    def run(r: Declared) -> Plane:
        technique.params = r[AO_PARAMS]
        found: Plane = technique.run(r[GBUFFER])
        return found

    return [
        Stage(
            name=name,
            reads=(GBUFFER, AO_PARAMS),
            writes=(AO,),
            condition=condition,
            run=run,
            culled="no output that it changes",
        )
    ]
