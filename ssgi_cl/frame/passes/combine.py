"""Pass: the sum of all light that matt surfaces send to the camera."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import (
    AO,
    CASTING,
    DIRECT,
    GBUFFER,
    INDIRECT,
    LOBE_LIGHT,
    MATT,
    MULTI_BOUNCE,
    SKY,
    SKY_LIGHT,
)
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles
from ssgi_cl.techniques.sky_rays.enclosed import sky_by_rays


def combine(build: Build, *light: str, ambient: bool = False) -> Stage:
    """Return the pass. What reads its radiance changes it in place, so that it runs with its readers.

    Args:
        build: what it is prepared for.
        light: the resources of irradiance that it adds up.
        ambient: whether it adds the light of environments, not blocked but by ambient occlusion.
    """
    params = build.params
    whole = params.kind == "whole"
    dimmed = (AO,) if build.techniques[0] is not None and not build.layer else ()

    def run(r: Declared) -> tuple[Plane, Plane | None]:
        seen = r[GBUFFER]
        given = {name: r[build.steady(name)] for name in (*light, *dimmed)}
        dims = given.get(AO) is not None and whole and not params.dims_indirect
        if dims and sky_by_rays(r[CASTING], build.runtime):
            del given[AO]  # rays have found all that blocks the sky
        lobes = build.runtime.transient.plane(3, build.size) if whole and seen.mirrors else None
        radiance = build.shade.combine(
            seen,
            r[SKY],
            given[DIRECT],
            ambient=ambient,
            visibility=given.get(AO),
            indirect=given.get(INDIRECT),
            multi_bounce=r[MULTI_BOUNCE],
            indirect_ao=params.dims_indirect,
            gaps=whole and not rays_meet_triangles(r[CASTING]),
            sky_light=given.get(SKY_LIGHT),
            light=lobes,
        )
        return radiance, lobes

    return Stage(
        name="combine",
        reads=(GBUFFER, SKY, MULTI_BOUNCE, *((CASTING,) if whole else ()), *map(build.steady, (*light, *dimmed))),
        writes=(MATT, LOBE_LIGHT),
        run=run,
        on_demand=True,
    )
