"""Pass: radiosity: light from surface to surface, seen or not, carried by surfels."""

from __future__ import annotations

from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, EVEN_LIGHT, LIGHT_VOLUME, LIGHTS, RSM, SURFEL_HISTORY, SURFELS
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityLight, RadiosityParams


def surfels(build: Build) -> Stage:
    """Return the pass. It depends on scene and lights alone: a moving camera does not run it again."""
    whole = build.whole
    radiosity = Radiosity(build.runtime, RadiosityParams(surfels=whole.surfels, bounces=whole.bounces, emission=False))

    def run(r: Declared) -> RadiosityLight:
        maps = r[RSM]
        history = r[SURFEL_HISTORY] if build.history else None
        return radiosity.run(r[CASTING], r[LIGHTS], rsms=[] if maps is None else [maps], history=history)

    return Stage(
        name="radiosity",
        reads=(CASTING, LIGHTS, *((SURFEL_HISTORY,) if build.history else ())),
        hints=(RSM,),
        writes=(SURFELS, LIGHT_VOLUME, EVEN_LIGHT),
        run=run,
    )
