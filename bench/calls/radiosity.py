"""Calls of radiosity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity.radiosity import RadiosityParams, radiosity

from .inputs import Array, Call, Inputs

FEW = RadiosityParams(surfels=16, bounces=2, vpls=16, directions=16, grid=32)
"""As small as may be."""


def carried(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield what surfaces send of the light of maps and of the sky."""
    yield radiosity(given.scene, given.lights, rsms=given.maps, runtime=runtime, **vars(FEW)).flux


CALLS: Mapping[str, Call] = {"radiosity": carried}
