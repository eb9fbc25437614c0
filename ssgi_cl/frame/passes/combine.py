"""Pass: the sum of all light that matt surfaces send to the camera."""

from __future__ import annotations

from collections.abc import Iterable

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import AO, DIRECT, GBUFFER, INDIRECT, LOBE_LIGHT, MATT, MULTI_BOUNCE, SKY, SKY_LIGHT
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.techniques.direct.shade import Shade


def combine(build: Build, shade: Shade, light: Iterable[str], *, ambient: bool) -> Stage:
    """Return the pass. What reads its radiance changes it in place, so that it runs with its readers.

    Args:
        build: what it is prepared for.
        shade: what computes it.
        light: the kinds of light and occlusion that there are, by name.
        ambient: whether the light of environments is not in direct light yet.
    """
    params, light = build.params, tuple(light)
    whole = params.kind == "whole"

    def run(r: Values) -> tuple[Plane, Plane | None]:
        seen = r[GBUFFER]
        given = {name: r[name] for name in light}
        lobes = build.runtime.transient.plane(3, build.size) if whole and seen.mirrors else None
        radiance = shade.combine(
            seen,
            r[SKY],
            given[DIRECT],
            ambient=ambient,
            visibility=given.get(AO),
            indirect=given.get(INDIRECT),
            multi_bounce=r[MULTI_BOUNCE],
            indirect_ao=params.dims_indirect,
            gaps=whole,
            sky_light=given.get(SKY_LIGHT),
            light=lobes,
        )
        return radiance, lobes

    return Stage(
        name="combine",
        reads=(GBUFFER, SKY, MULTI_BOUNCE, *light),
        writes=(MATT, LOBE_LIGHT),
        run=run,
        reuse="on demand",
    )
