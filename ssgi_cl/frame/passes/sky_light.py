"""Pass: light of environments, which all triangles block."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, LIGHTS, SKY_LIGHT, SKY_MAPS
from ssgi_cl.frame.passes.sky_maps import no_sky
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams
from ssgi_cl.techniques.sky_rays.sky_rays import SkyRays, SkyRaysParams

DIRECTIONS = 256
"""Of environments, in place of which a pixel of every second row has two rays. With one, which takes 8 % off a kept
frame of `window-300` at 800 x 600, walls show blotches 20 to 60 pixels wide: mottling is .0206 with one, .0188 with two
and .0182 with four (400 x 300, 256 paths)."""


def sky_light(build: Build) -> Stage:
    """Return the pass: depth maps of directions, or rays where there are none."""
    whole, runtime = build.whole, build.runtime
    made: dict[bool, SampledLights | SkyRays] = {}  # once a scene needs it

    def run(r: Declared) -> Plane | None:
        scene, maps = r[CASTING], r[SKY_MAPS]
        rays = maps is None
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
        return technique.run(r[GBUFFER], r[LIGHTS], scene=scene, maps=maps)

    reads = (GBUFFER, CASTING, LIGHTS, SKY_MAPS)
    return Stage(name="sky light", reads=reads, writes=(SKY_LIGHT,), run=run, condition=no_sky)


def _rays_params(directions: int) -> SkyRaysParams:
    """Return parameters that suit a number of directions: a ray and up to 128 parts, two rays from `DIRECTIONS` on, and
    more of both with more of them."""
    finer = directions // DIRECTIONS
    return SkyRaysParams(
        strata=min(min(max(directions, 32), 128) * max(finer, 1), 256), rays=min(max(2 * finer**2, 1), 16)
    )
