"""Light of all bounces, carried by surfels, and reflections in a scene as if all of it were glossy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.rasterize import gbuffer
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.radiosity.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.reflections.reflections import reflections
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, polished
from .vpl_splat import MAP_SIZE


def all_bounces(context: Context, setting: str) -> Subject:
    """Make what surfaces send ready; the setting is the number of surfels."""
    params = RadiosityParams(surfels=count_of(setting, "a number of surfels", 16, 1 << 14))
    technique, maps, view = Radiosity(context.runtime, params), DrawnMaps(context, MAP_SIZE), context.view

    def run() -> None:
        with context.runtime.frame():
            technique.run(view.scene, view.lights, rsms=maps.reflective())

    return Subject(run=run, counted=DrawnMaps.counted, note="surfels and what they see are kept")


def mirrored(context: Context, setting: str) -> Subject:
    """Make radiance with what lobes reflect ready; the setting is the number of rays of a pixel."""
    rays, lights = count_of(setting, "a number of rays", 1, 64), context.view.lights
    scene = polished(context.view.scene)
    seen = gbuffer(scene, context.camera, runtime=context.runtime)
    radiance = shade(replace(seen, specular=None, gloss=None), lights, runtime=context.runtime)

    def image() -> NDArray[np.float32]:
        return reflections(seen, radiance, lights, scene=scene, rays=rays, runtime=context.runtime)

    return Subject.of_image(
        image,
        samples=float(rays * context.surface_pixels),
        counted="G-buffer and radiance uploaded",
        note="surfels and their light are kept; lights cast no shadows",
    )


FAMILIES: Mapping[str, Family] = {
    "radiosity": Family(all_bounces, ("512", "2048")),
    "reflections": Family(mirrored, ("1", "4")),
}
