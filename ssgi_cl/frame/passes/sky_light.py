"""Pass: light of environments, which all triangles block."""

from __future__ import annotations

from ssgi_cl.core.lights import Environment, shines
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, LIGHTS, SKY_LIGHT
from ssgi_cl.frame.stage import Declared, Stage, Values
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams
from ssgi_cl.techniques.sky_rays.enclosed import sky_by_rays
from ssgi_cl.techniques.sky_rays.sky_rays import SkyRays, SkyRaysParams

DIRECTIONS = 128
"""Of which a pixel of every second row has one ray."""


def sky_light(build: Build) -> Stage:
    """Return the pass: rays in enclosed scenes, else depth maps of directions."""
    whole, runtime = build.whole, build.runtime
    made: dict[bool, SampledLights | SkyRays] = {}  # once a scene needs it

    def run(r: Declared) -> Plane | None:
        scene = r[CASTING]
        rays = sky_by_rays(scene, runtime)
        if rays not in made:
            made[rays] = (
                SkyRays(runtime, build.size, _rays_params(whole.directions))
                if rays
                else SampledLights(
                    runtime, build.size, SampledLightsParams(directions=whole.directions, map_size=whole.map_size)
                )
            )
        return made[rays].run(r[GBUFFER], r[LIGHTS], scene=scene)

    def condition(facts: Values) -> str | None:
        lit = any(isinstance(light, Environment) and shines(light) for light in facts[LIGHTS])
        return None if lit else "no environment shines"

    return Stage(name="sky light", reads=(GBUFFER, CASTING, LIGHTS), writes=(SKY_LIGHT,), run=run, condition=condition)


def _rays_params(directions: int) -> SkyRaysParams:
    """Return parameters that suit a number of directions: up to 256 parts, and more rays from there on."""
    rays = min(max((directions // DIRECTIONS) ** 2, 1), 16)
    return SkyRaysParams(strata=min(max(directions, 32), 256), rays=rays)
