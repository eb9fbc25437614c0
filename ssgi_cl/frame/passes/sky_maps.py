"""Pass: depth maps of what the sky sees, drawn while later passes wait for the host."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, shines
from ssgi_cl.core.scene import Scene
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, LIGHTS, RSM, SKY_MAPS, SURFEL_HISTORY
from ssgi_cl.frame.stage import Declared, Stage, Values
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.techniques.radiosity.surfel_history import SurfelHistory
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLightsParams
from ssgi_cl.techniques.sampled_lights.sampled_maps import SampledMaps
from ssgi_cl.techniques.sky_rays.enclosed import openness, sky_by_rays


def sky_maps(build: Build) -> Stage:
    """Return the pass; in enclosed scenes, whose sky is found by rays, there are none."""
    whole, runtime = build.whole, build.runtime
    made: list[SampledMaps] = []  # once a scene needs them

    def run(r: Declared) -> SampledMaps | None:
        scene = r[CASTING]
        if sky_by_rays(scene, runtime):
            return None
        if not made:
            count = SampledLightsParams(directions=whole.directions).count
            made.append(SampledMaps(runtime, count, whole.map_size))
        return made[0].draw(scene, r[LIGHTS], seen(r, scene))

    def seen(r: Declared, scene: Scene) -> NDArray[np.float64] | None:
        history: SurfelHistory | None = r[SURFEL_HISTORY] if build.history else None
        if history is not None and history.sky is not None:
            return history.sky
        found = openness(scene, runtime).seen if rays_meet_triangles(scene) else None
        if history is not None:
            history.sky = found
        return found

    reads = (CASTING, LIGHTS, *((SURFEL_HISTORY,) if build.history else ()))
    # After the shadow maps, in whose short passes it would come to its end: radiosity leaves it more time.
    return Stage(name="sky maps", reads=reads, hints=(RSM,), writes=(SKY_MAPS,), run=run, condition=no_sky)


def no_sky(facts: Values) -> str | None:
    """Return why passes of environments are idle, or None."""
    lit = any(isinstance(light, Environment) and shines(light) for light in facts[LIGHTS])
    return None if lit else "no environment shines"
