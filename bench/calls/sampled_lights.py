"""Calls of sampled lights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.sampled_lights.sampled_lights import sampled_lights

from .inputs import Array, Call, Inputs


def sky_lit(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by an environment."""
    yield sampled_lights(given.gbuffer, given.lights, scene=given.scene, directions=16, map_size=16, runtime=runtime)


CALLS: Mapping[str, Call] = {"sampled lights": sky_lit}
