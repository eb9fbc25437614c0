"""Calls of reflections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.reflections.reflections import reflections

from .inputs import Array, Call, Inputs
from .radiosity import FEW


def mirrored(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield radiance of the room as if all of it were glossy."""
    depth = np.asarray(given.gbuffer.depth)[0]
    yield reflections(
        replace(given.gbuffer, specular=np.full((*depth.shape, 3), 0.5), gloss=np.full(depth.shape, 60.0)),
        given.image,
        given.lights,
        scene=given.scene,
        shadow_maps=(*given.maps, None, None),
        irradiance=given.image,
        radiosity=FEW,
        runtime=runtime,
    )


CALLS: Mapping[str, Call] = {"reflections": mirrored}
