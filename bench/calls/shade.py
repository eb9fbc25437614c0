"""Calls of deferred shading."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.shade import shade

from .inputs import Array, Call, Inputs


def shaded(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield radiance, with and without shadows, occlusion and indirect light."""
    ao = np.linspace(0.0, 1.0, given.image[..., 0].size).reshape(given.gbuffer.size)
    lights = given.lights
    yield shade(given.gbuffer, lights, runtime=runtime)
    yield shade(
        given.gbuffer,
        lights,
        shadow_maps=(*given.maps, None, None),
        ao=ao,
        indirect=given.image,
        multi_bounce=True,
        runtime=runtime,
    )


CALLS: Mapping[str, Call] = {"shading": shaded}
