"""Pipelines: each kind of frame as one list of passes, in the order in which they run."""

from __future__ import annotations

from collections.abc import Callable

from ssgi_cl.frame.passes.ambient_occlusion import ambient_occlusion
from ssgi_cl.frame.passes.area_lights import area_lights
from ssgi_cl.frame.passes.blended_layers import blended_layers
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.combine import combine
from ssgi_cl.frame.passes.direct_light import direct_light
from ssgi_cl.frame.passes.gather import gather
from ssgi_cl.frame.passes.gbuffer import gbuffer
from ssgi_cl.frame.passes.history import history
from ssgi_cl.frame.passes.one_bounce import one_bounce
from ssgi_cl.frame.passes.reflections import reflections
from ssgi_cl.frame.passes.resources import DIRECT, INDIRECT, PUNCTUAL, SKY_LIGHT
from ssgi_cl.frame.passes.shadow_maps import shadow_maps
from ssgi_cl.frame.passes.sky_light import sky_light
from ssgi_cl.frame.passes.sky_maps import sky_maps
from ssgi_cl.frame.passes.smooth_edges import smooth_edges
from ssgi_cl.frame.passes.ssdo import ssdo
from ssgi_cl.frame.passes.surfels import surfels
from ssgi_cl.frame.passes.tonemap import tonemap
from ssgi_cl.frame.stage import Stage


def whole_frame(build: Build) -> list[Stage]:
    """Return the passes of the default frame, the whole picture."""
    return [
        gbuffer(build),
        *ambient_occlusion(build),
        shadow_maps(build),
        sky_maps(build),
        surfels(build),
        *fully_lit(build),
        *smooth_edges(build),
        blended_layers(build, fully_lit),
        *tonemap(build),
    ]


def fully_lit(build: Build) -> list[Stage]:
    """Return the passes of all light at the surfaces of a G-buffer."""
    return [
        direct_light(build, PUNCTUAL),
        area_lights(build),
        sky_light(build),
        gather(build),
        *history(build),
        combine(build, DIRECT, SKY_LIGHT, INDIRECT),
        reflections(build),
    ]


def direct_frame(build: Build) -> list[Stage]:
    """Return the passes of direct and ambient light."""
    return [
        gbuffer(build),
        *ambient_occlusion(build),
        shadow_maps(build),
        *directly_lit(build),
        *smooth_edges(build),
        blended_layers(build, directly_lit),
        *tonemap(build),
    ]


def directly_lit(build: Build) -> list[Stage]:
    """Return the passes of direct and ambient light at the surfaces of a G-buffer."""
    return [direct_light(build), *history(build), combine(build, DIRECT, ambient=True)]


def one_bounce_frame(build: Build) -> list[Stage]:
    """Return the passes of direct and ambient light and one bounce; layers have no bounce."""
    return [
        gbuffer(build),
        *ambient_occlusion(build),
        shadow_maps(build),
        direct_light(build),
        one_bounce(build),
        *history(build),
        combine(build, DIRECT, INDIRECT, ambient=True),
        *smooth_edges(build),
        blended_layers(build, directly_lit),
        *tonemap(build),
    ]


def ssdo_frame(build: Build) -> list[Stage]:
    """Return the passes of a frame that SSDO lights, ambient light included."""
    return [
        gbuffer(build),
        *ambient_occlusion(build),
        shadow_maps(build),
        ssdo(build),
        *history(build),
        combine(build, DIRECT, INDIRECT),
        *smooth_edges(build),
        blended_layers(build, directly_lit),
        *tonemap(build),
    ]


PIPELINES: dict[str, Callable[[Build], list[Stage]]] = {
    "whole": whole_frame,
    "direct": direct_frame,
    "one bounce": one_bounce_frame,
    "ssdo": ssdo_frame,
}
"""Function that returns the passes of each `FrameParams.kind`."""
