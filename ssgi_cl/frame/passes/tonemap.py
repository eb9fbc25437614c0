"""Passes: from radiance to the picture: read-back, exposure, tone mapping."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import EXPOSURE, GBUFFER, IMAGE, PIXELS, RADIANCE
from ssgi_cl.frame.stage import Stage
from ssgi_cl.techniques.direct.shade import Shade
from ssgi_cl.techniques.filters.tonemap import Tonemap, TonemapParams, auto_exposure


def tonemap(build: Build, shade: Shade) -> list[Stage]:
    """Return the passes; `shade` knows which pixels hold anything."""
    curve = Tonemap(build.runtime, build.size, TonemapParams(curve=build.params.curve))
    return [
        Stage(
            name="read-back",
            reads=(RADIANCE, GBUFFER),
            writes=(PIXELS,),
            reuse="on demand",
            run=lambda r: pixels(r[RADIANCE], shade.seen(r[GBUFFER])),
        ),
        Stage(
            name="exposure",
            reads=(PIXELS, GBUFFER),
            writes=(EXPOSURE,),
            run=lambda r: auto_exposure(r[PIXELS], shade.seen(r[GBUFFER])),
        ),
        Stage(
            name="picture",
            reads=(RADIANCE, GBUFFER, EXPOSURE),
            writes=(IMAGE,),
            run=lambda r: curve.run(r[RADIANCE], exposure=r[EXPOSURE], region=shade.seen(r[GBUFFER])),
        ),
    ]


def pixels(plane: Plane, region: Region | None = None) -> NDArray[np.float32]:
    """Return [rows, columns, channels] of a plane, whose pixels outside a region are the same."""
    found = np.empty((*plane.size, plane.count), np.float32)
    plane.download(np.moveaxis(found, -1, 0), region)
    return found
