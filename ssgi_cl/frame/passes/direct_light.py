"""Pass: direct light of punctual lights with their shadow maps."""

from __future__ import annotations

from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import DIRECT, GBUFFER, LIGHTS, SHADOWS
from ssgi_cl.frame.stage import Stage


def direct_light(build: Build, writes: str = DIRECT) -> Stage:
    """Return the pass."""
    return Stage(
        name="direct light",
        reads=(GBUFFER, LIGHTS, SHADOWS),
        writes=(writes,),
        run=lambda r: build.shade.light(r[GBUFFER], r[LIGHTS], shadows=r[SHADOWS]),
        on_demand=not build.keeps_direct_light,
    )
