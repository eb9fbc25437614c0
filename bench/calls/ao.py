"""Calls of all techniques of ambient occlusion, with the parameters of their descriptors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.ao.multi_bounce import multi_bounce
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.technique import Technique

from .inputs import Array, Call, Inputs


def occluded(technique: Technique) -> Call:
    """Return what yields A with layers and a margin, and A at half size from depth alone."""
    params = {name: values[0] for name, values in technique.variants.items()}

    def run(given: Inputs, runtime: Runtime) -> Iterator[Array]:
        yield technique.function(given.gbuffer, runtime=runtime, **params)
        late = {**params, "resolution": "half", "blur_resolution": "full"}
        yield technique.function(given.single, runtime=runtime, **late)

    return run


def bent(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield A and bent normals."""
    yield from gtao(given.gbuffer, taps=4, falloff=0.6, bent_normals=True, runtime=runtime)


def brightened(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield A with the light that surfaces round a pixel reflect; no kernel does it."""
    yield multi_bounce(np.minimum(given.image[..., 0], 1.0), 0.7)


CALLS: Mapping[str, Call] = {
    **{name.replace("_", " "): occluded(each) for name, each in of_kind("ao").items()},
    "gtao, bent normals": bent,
    "multiple bounces": brightened,
}
