"""Pass: direct light of punctual lights with their shadow maps."""

from __future__ import annotations

from ssgi_cl.frame.passes.resources import DIRECT, GBUFFER, LIGHTS, SHADOWS
from ssgi_cl.frame.stage import Stage
from ssgi_cl.techniques.direct.shade import Shade


def direct_light(shade: Shade) -> Stage:
    """Return the pass; `shade` computes it."""
    return Stage(
        name="direct light",
        reads=(GBUFFER, LIGHTS, SHADOWS),
        writes=(DIRECT,),
        run=lambda r: shade.light(r[GBUFFER], r[LIGHTS], shadows=r[SHADOWS]),
    )
