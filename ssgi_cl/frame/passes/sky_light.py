"""Pass: light of environments, which all triangles block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, shines
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, LIGHTS, SKY_LIGHT, SURFEL_HISTORY
from ssgi_cl.frame.stage import Declared, Stage, Values
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams
from ssgi_cl.techniques.sky_rays.enclosed import openness, sky_by_rays
from ssgi_cl.techniques.sky_rays.sky_rays import SkyRays, SkyRaysParams

DIRECTIONS = 256
"""Of environments, in place of which a pixel of every second row has two rays. With one, which takes 8 % off a kept
frame of `window-300` at 800 x 600, walls show blotches 20 to 60 pixels wide: mottling is .0206 with one, .0188 with two
and .0182 with four (400 x 300, 256 paths)."""


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
        technique = made[rays]
        if isinstance(technique, SkyRays):
            return technique.run(r[GBUFFER], r[LIGHTS], scene=scene)
        return technique.run(r[GBUFFER], r[LIGHTS], scene=scene, seen=seen(r, scene))

    def seen(r: Declared, scene: Scene) -> NDArray[np.float64] | None:
        history: SurfelHistory | None = r[SURFEL_HISTORY] if build.history else None
        if history is not None and history.sky is not None:
            return history.sky
        found = openness(scene, runtime).seen if rays_meet_triangles(scene) else None
        if history is not None:
            history.sky = found
        return found

    def condition(facts: Values) -> str | None:
        lit = any(isinstance(light, Environment) and shines(light) for light in facts[LIGHTS])
        return None if lit else "no environment shines"

    reads = (GBUFFER, CASTING, LIGHTS, *((SURFEL_HISTORY,) if build.history else ()))
    return Stage(name="sky light", reads=reads, writes=(SKY_LIGHT,), run=run, condition=condition)


def _rays_params(directions: int) -> SkyRaysParams:
    """Return parameters that suit a number of directions: a ray and up to 128 parts, two rays from `DIRECTIONS` on, and
    more of both with more of them."""
    finer = directions // DIRECTIONS
    return SkyRaysParams(
        strata=min(min(max(directions, 32), 128) * max(finer, 1), 256), rays=min(max(2 * finer**2, 1), 16)
    )
