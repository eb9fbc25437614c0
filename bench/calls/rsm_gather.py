"""Calls of gathering from reflective shadow maps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather

from .inputs import Array, Call, Inputs


def gathered(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance with each pattern and each kind of map."""
    spot, punctual_light = given.maps
    yield rsm_gather(given.gbuffer, spot, 200, runtime=runtime)
    yield rsm_gather(given.gbuffer, spot, pattern="all", resolution="adaptive", runtime=runtime)
    for own in given.maps:
        yield rsm_gather(given.gbuffer, own, 50, pattern="rotated", runtime=runtime)
    yield rsm_gather(given.single, punctual_light, 50, pattern="fixed", resolution="adaptive", runtime=runtime)
    yield rsm_gather(given.single, given.maps, 50, method="published", runtime=runtime)


CALLS: Mapping[str, Call] = {"rsm gathering": gathered}
