"""Each kind of frame as one list of passes, in the order in which it reads."""

from __future__ import annotations

from collections.abc import Callable

from ssgi_cl.frame.passes.ambient_occlusion import ambient_occlusion
from ssgi_cl.frame.passes.blended_layers import blended_layers
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.combine import combine
from ssgi_cl.frame.passes.direct_light import direct_light
from ssgi_cl.frame.passes.gather import gather
from ssgi_cl.frame.passes.gbuffer import gbuffer
from ssgi_cl.frame.passes.one_bounce import one_bounce_pass
from ssgi_cl.frame.passes.reflections import reflections
from ssgi_cl.frame.passes.resources import (
    AO,
    CASTING,
    DIRECT,
    GLOSSY,
    INDIRECT,
    LIGHT_VOLUME,
    LIGHTS,
    MATT,
    MULTI_BOUNCE,
    RSM,
    SHADOWS,
    SKY,
    SKY_LIGHT,
    SURFELS,
)
from ssgi_cl.frame.passes.shadow_maps import shadow_maps
from ssgi_cl.frame.passes.sky_light import sky_light
from ssgi_cl.frame.passes.ssdo import ssdo
from ssgi_cl.frame.passes.surfels import surfels
from ssgi_cl.frame.passes.tonemap import tonemap
from ssgi_cl.frame.stage import Stage
from ssgi_cl.techniques.direct.shade import Shade

IN_COMMON = (LIGHTS, SHADOWS, SKY, MULTI_BOUNCE)
"""Resources that a layer that is seen through shares with what is behind it."""


def whole(build: Build) -> list[Stage]:
    """Return the passes of the whole picture: sky with visibility, all bounces, emission, gloss."""
    shade = Shade(build.runtime, build.size)
    occlusion = ambient_occlusion(build)
    light = (DIRECT, INDIRECT, SKY_LIGHT, *_written(occlusion))

    def layer() -> list[Stage]:
        shade = Shade(build.runtime, build.size)
        return [
            direct_light(shade),
            sky_light(build),
            gather(build),
            combine(build, shade, light[:3], ambient=False),
            reflections(build),
        ]

    return [
        gbuffer(build),
        *occlusion,
        shadow_maps(build),
        direct_light(shade),
        surfels(build),
        sky_light(build),
        gather(build),
        combine(build, shade, light, ambient=False),
        reflections(build),
        blended_layers(build, GLOSSY, (*IN_COMMON, CASTING, RSM, SURFELS, LIGHT_VOLUME), layer),
        *tonemap(build, shade),
    ]


def direct(build: Build) -> list[Stage]:
    """Return the passes of direct light, ambient light and, where asked for, one bounce."""
    shade = Shade(build.runtime, build.size)
    occlusion, bounce = ambient_occlusion(build), one_bounce_pass(build)
    light = (DIRECT, *_written([*occlusion, *bounce]))

    def layer() -> list[Stage]:
        shade = Shade(build.runtime, build.size)
        return [direct_light(shade), combine(build, shade, (DIRECT,), ambient=True)]

    return [
        gbuffer(build),
        *occlusion,
        shadow_maps(build),
        direct_light(shade),
        *bounce,
        combine(build, shade, light, ambient=True),
        blended_layers(build, MATT, IN_COMMON, layer),
        *tonemap(build, shade),
    ]


def directional_occlusion(build: Build) -> list[Stage]:
    """Return the passes of a frame that SSDO lights, ambient light included."""
    shade = Shade(build.runtime, build.size, punctual_lights=False)
    light, look = ssdo(build)

    def layer() -> list[Stage]:
        shade = Shade(build.runtime, build.size)
        return [direct_light(shade), combine(build, shade, (DIRECT,), ambient=True)]

    return [
        gbuffer(build, look),
        shadow_maps(build),
        *light,
        combine(build, shade, (DIRECT, INDIRECT), ambient=False),
        blended_layers(build, MATT, IN_COMMON, layer),
        *tonemap(build, shade),
    ]


PIPELINES: dict[str, Callable[[Build], list[Stage]]] = {
    "whole": whole,
    "direct": direct,
    "one bounce": direct,
    "ssdo": directional_occlusion,
}
"""`FrameParams.kind` -> what returns the passes."""


def _written(passes: list[Stage]) -> tuple[str, ...]:
    return tuple(name for each in passes for name in each.writes if name in (AO, INDIRECT))
