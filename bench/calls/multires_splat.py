"""Calls of multiresolution splatting."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.multires.multires_splat import multires_splat

from .inputs import Array, Call, Inputs


def splatted(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance with the defaults, with a cutoff and clamped light, and as published."""
    yield multires_splat(given.gbuffer, given.maps, 256, runtime=runtime)
    yield multires_splat(given.gbuffer, given.maps, 256, cutoff=0.01, near="clamped", runtime=runtime)
    yield multires_splat(given.gbuffer, given.maps, 256, method="published", runtime=runtime)


CALLS: Mapping[str, Call] = {"multiresolution splatting": splatted}
