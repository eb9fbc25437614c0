"""Pass: light of emissive surfaces, as polygons with shadow rays, added to that of punctual lights."""

from __future__ import annotations

from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, DIRECT, GBUFFER, PUNCTUAL
from ssgi_cl.frame.stage import Stage
from ssgi_cl.techniques.area_lights.area_lights import AreaLights


def area_lights(build: Build) -> Stage:
    """Return the pass. Where no surface emits it hands on the light of punctual lights."""
    area = AreaLights(build.runtime, build.size)
    return Stage(
        name="area lights",
        reads=(GBUFFER, CASTING, PUNCTUAL),
        writes=(DIRECT,),
        run=lambda r: area.run(r[GBUFFER], scene=r[CASTING], direct=r[PUNCTUAL]),
    )
