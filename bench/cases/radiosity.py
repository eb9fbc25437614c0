"""All bounces of light, carried by surfels."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps

MAP_SIZE = 512
"""Texels along a side of the lights' maps."""


class AllBounces(Own):
    """What surfaces send; the setting is the number of surfels."""

    SETTINGS = ("512", "2048")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make surfels, what they see and light maps ready."""
        params = RadiosityParams(surfels=count_of(setting, "a number of surfels", 16, 1 << 14))
        technique, maps, view = Radiosity(context.runtime, params), DrawnMaps(context, MAP_SIZE), context.view

        def run() -> None:
            with context.runtime.frame():
                technique.run(view.scene, view.lights, rsms=maps.reflective())

        return Subject(run=run, counted=DrawnMaps.counted, note="surfels and what they see are kept")


FAMILIES: Mapping[str, Family] = {"radiosity": AllBounces()}
