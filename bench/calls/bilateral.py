"""Calls of the edge-aware blur."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.filters.bilateral import bilateral_blur

from .inputs import Array, Call, Inputs


def blurred(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield an image after the separable blur and after the other."""
    yield bilateral_blur(given.image, given.gbuffer, runtime=runtime)
    yield bilateral_blur(given.image, given.gbuffer, separable=False, runtime=runtime)


CALLS: Mapping[str, Call] = {"bilateral blur": blurred}
