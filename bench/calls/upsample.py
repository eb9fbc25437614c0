"""Calls of joint-bilateral upsampling."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.filters.upsample import coarse_size, upsample

from .inputs import Array, Call, Inputs


def upsampled(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield images of half and quarter size at full size."""
    for step in (2, 4):
        rows, columns = coarse_size(given.gbuffer.size, step)
        yield upsample(given.image[:rows, :columns], given.gbuffer, step=step, runtime=runtime)


CALLS: Mapping[str, Call] = {"upsampling": upsampled}
