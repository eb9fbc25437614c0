"""Reflections of a scene as if all of it were glossy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.rasterize import gbuffer
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.reflections.reflections import reflections
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from .vpl_lobes import polished


class RaysOfLobes(Own):
    """Radiance with what lobes reflect; the setting is the number of rays of a pixel."""

    SETTINGS = ("1", "4")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw and shade the glossy scene."""
        rays, lights = count_of(setting, "a number of rays", 1, 64), context.view.lights
        scene = polished(context.view.scene)
        seen = gbuffer(scene, context.camera, runtime=context.runtime)
        radiance = shade(replace(seen, specular=None, gloss=None), lights, runtime=context.runtime)

        def image() -> NDArray[np.float32]:
            return reflections(seen, radiance, lights, scene=scene, rays=rays, runtime=context.runtime)

        return Subject(
            run=image,
            image=image,
            samples=float(rays * np.count_nonzero(context.seen)),
            counted="G-buffer and radiance uploaded",
            note="surfels and their light are kept; lights cast no shadows",
        )


FAMILIES: Mapping[str, Family] = {"reflections": RaysOfLobes()}
