"""Pass: light of environments, which all triangles block."""

from __future__ import annotations

from ssgi_cl.core.lights import Environment, shines
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, LIGHTS, SKY_LIGHT
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams


def sky_light(build: Build) -> Stage:
    """Return the pass."""
    whole = build.whole
    sky = SampledLights(
        build.runtime, build.size, SampledLightsParams(directions=whole.directions, map_size=whole.map_size)
    )

    def condition(facts: Values) -> str | None:
        lit = any(isinstance(light, Environment) and shines(light) for light in facts[LIGHTS])
        return None if lit else "no environment shines"

    return Stage(
        name="sky light",
        reads=(GBUFFER, CASTING, LIGHTS),
        writes=(SKY_LIGHT,),
        run=lambda r: sky.run(r[GBUFFER], r[LIGHTS], scene=r[CASTING]),
        condition=condition,
    )
