"""Passes from radiance to the picture: read-back, exposure, tone mapping."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import EXPOSURE, GBUFFER, IMAGE, PIXELS, RADIANCE
from ssgi_cl.frame.stage import Stage
from ssgi_cl.techniques.filters.tonemap import Tonemap, TonemapParams, auto_exposure


def tonemap(build: Build) -> list[Stage]:
    """Return the passes."""
    curve = Tonemap(build.runtime, build.size, TonemapParams(curve=build.params.curve))
    seen = build.varied()
    return [
        Stage(
            name="read-back",
            reads=(RADIANCE, GBUFFER),
            writes=(PIXELS,),
            on_demand=True,
            run=lambda r: pixels(r[RADIANCE], seen(r[GBUFFER])),
        ),
        Stage(
            name="exposure",
            reads=(PIXELS, GBUFFER),
            writes=(EXPOSURE,),
            run=lambda r: auto_exposure(r[PIXELS], seen(r[GBUFFER])),
        ),
        Stage(
            name="picture",
            reads=(RADIANCE, GBUFFER, EXPOSURE),
            writes=(IMAGE,),
            run=lambda r: curve.run(r[RADIANCE], exposure=r[EXPOSURE], region=seen(r[GBUFFER])),
        ),
    ]


def pixels(plane: Plane, region: Region | None = None) -> NDArray[np.float32]:
    """Return [rows, columns, channels] of a plane, whose pixels outside a region are the same."""
    found = np.empty((*plane.size, plane.count), np.float32)
    plane.download(np.moveaxis(found, -1, 0), region)
    return found
