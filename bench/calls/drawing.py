"""Calls of the rasterizer, and of what techniques make of its results first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm as drawn_map

from .inputs import Array, Call, Inputs


def drawing(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield depth, normal and albedo of a G-buffer, and flux of two maps."""
    gbuffer = drawn(given.scene, given.gbuffer.camera, layers=2, attributes="all", runtime=runtime)
    depth = np.asarray(gbuffer.depth)
    yield np.where(np.isfinite(depth), depth, 0.0)
    yield np.asarray(gbuffer.normal)
    yield np.asarray(gbuffer.albedo)
    for own in given.maps:
        side = own.cameras[0].width
        yield np.asarray(drawn_map(given.scene, own.light, size=side, runtime=runtime).flux)


def view_normals(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield normals, given ones and those from depth alone."""
    for gbuffer in (given.gbuffer, given.single):
        yield on_device(gbuffer, runtime).normal.download()


CALLS: Mapping[str, Call] = {"drawing": drawing, "view normals": view_normals}
