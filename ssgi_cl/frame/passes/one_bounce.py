"""Pass: one bounce of the light of punctual lights."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CASTING, GBUFFER, INDIRECT, INDIRECT_PARAMS, LEVELS, RSM
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.multires import multires_splat
from ssgi_cl.techniques.rsm import rsm_gather
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams

SPLATS: dict[type, Any] = {VplSplatParams: VplSplat} | {
    method.params: method.technique for method in multires_splat.METHODS.values()
}
"""Techniques that choose lights from maps, by their parameters."""
GATHERS: dict[type, Any] = {method.params: method.technique for method in rsm_gather.METHODS.values()}
"""Techniques that read the map for each pixel, by their parameters."""


def one_bounce(build: Build) -> Stage:
    """Return the pass."""
    runtime, params = build.runtime, build.techniques[1]
    gathers = type(params) in GATHERS
    if gathers:
        technique = GATHERS[type(params)](runtime, build.size, params, build.margin)
    else:
        technique = SPLATS[type(params)](runtime, build.size, params)
    blocked = isinstance(technique, (multires_splat.MultiresSplat, VplSplat))  # by all triangles of the scene

    def run(r: Declared) -> tuple[Plane | None, Callable[[], NDArray[np.int32]] | None]:
        if r[RSM] is None:
            runtime.skip(technique.name, "no light that a map could be made of")
            return None, None
        technique.params = r[INDIRECT_PARAMS]
        if gathers:
            return technique.run(r[GBUFFER], r[RSM]), None
        scene = {"scene": device_scene(r[CASTING], runtime)} if blocked else {}
        irradiance = technique.run(r[GBUFFER], rsms=[r[RSM]], **scene)
        levels = technique.grid.computed if isinstance(technique, multires_splat.MultiresSplat) else None
        return irradiance, levels

    return Stage(
        name="bounce",
        reads=(GBUFFER, RSM, INDIRECT_PARAMS, *((CASTING,) if blocked else ())),
        writes=(INDIRECT, LEVELS),
        run=run,
    )
