"""Calls of directional occlusion by each method."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.ssdo.ssdo import ssdo
from ssgi_cl.techniques.ssdo.ssdo_params import METHODS

from .inputs import Array, Call, Inputs


def directional(method: str) -> Call:
    """Return what yields direct and bounced light, by maps and by what is seen."""

    def run(given: Inputs, runtime: Runtime) -> Iterator[Array]:
        params: dict[str, Any] = {"method": method, "slices": 1, "taps": 4, "samples": 4}
        yield from ssdo(given.gbuffer, given.lights, runtime=runtime, **params)
        yield from ssdo(
            given.single,
            given.lights,
            shadow_maps=(*given.maps, None, None),
            auxiliary_views=[given.view],
            runtime=runtime,
            **params,
        )

    return run


CALLS: Mapping[str, Call] = {f"ssdo, {method}": directional(method) for method in METHODS}
