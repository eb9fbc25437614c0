"""Calls of splatting virtual point lights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.vpl.vpl_splat import vpl_splat

from .inputs import Array, Call, Inputs


def splatted(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by all of some lights, by some for each pixel, and with walls."""
    yield vpl_splat(given.gbuffer, given.maps, 256, runtime=runtime)
    yield vpl_splat(given.gbuffer, given.maps, 256, cutoff=0.0, cull=False, runtime=runtime)
    yield vpl_splat(given.gbuffer, given.maps, 256, interleave=True, visibility=True, runtime=runtime)


CALLS: Mapping[str, Call] = {"vpl splatting": splatted}
