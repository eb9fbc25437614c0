"""Pass: what glossy surfaces reflect, added to the radiance of matt ones."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import (
    CASTING,
    GBUFFER,
    GLOSSY,
    LIGHT_VOLUME,
    LIGHTS,
    LOBE_LIGHT,
    MATT,
    OCCUPANCY,
    SHADOWS,
)
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.techniques.reflections.reflections import Reflections


def reflections(build: Build) -> Stage:
    """Return the pass."""
    runtime = build.runtime
    made: list[Reflections] = []  # once a surface is glossy

    def run(r: Declared) -> Plane:
        radiance: Plane = r[MATT]
        if r[LOBE_LIGHT] is None:
            runtime.skip("reflections", "no surface of the scene is glossy")
            return radiance
        if not made:
            made.append(Reflections(runtime, build.size))
        made[0].run(
            r[GBUFFER],
            radiance,
            light=r[LOBE_LIGHT],
            lights=r[LIGHTS],
            shadows=r[SHADOWS],
            volume=r[LIGHT_VOLUME](),
            occupancy=r[OCCUPANCY],
            scene=r[CASTING],
        )
        return radiance

    return Stage(
        name="reflections",
        reads=(GBUFFER, CASTING, MATT, LOBE_LIGHT, LIGHTS, SHADOWS, OCCUPANCY, LIGHT_VOLUME),
        writes=(GLOSSY,),
        run=run,
        on_demand=True,
    )
