"""Calls of tone mapping."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.filters.tonemap import tonemap

from .inputs import Array, Call, Inputs


def mapped(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield a picture by either curve, with automatic exposure and with a given one."""
    yield tonemap(given.image, runtime=runtime)
    yield tonemap(given.image, curve="clip", exposure=0.5, runtime=runtime)


CALLS: Mapping[str, Call] = {"tone mapping": mapped}
