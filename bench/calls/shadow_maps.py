"""Calls of what draws the maps of lights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.shadow_map import shadow_maps
from ssgi_cl.techniques.direct.light_maps import LightMaps

from .inputs import Array, Call, Inputs


def drawn_maps(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield depth of the maps of a spot light and of the sun."""
    for own in shadow_maps(given.scene, given.lights[::2], size=given.maps[0].cameras[0].width, runtime=runtime):
        depth = np.asarray(None if own is None else own.depth)
        yield np.where(np.isfinite(depth), depth, 0.0)


def light_maps(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield positions, areas and flux of a map that is drawn where it is used."""
    maps = LightMaps(runtime, given.maps[0].cameras[0].width, flux=True)
    with runtime.frame():
        _, found = maps.draw(given.scene, given.lights[:1])
    for plane in (found.position, found.area, found.flux) if found else ():
        yield plane.download()


CALLS: Mapping[str, Call] = {"shadow maps": drawn_maps, "light maps": light_maps}
