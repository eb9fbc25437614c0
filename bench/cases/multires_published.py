"""Multiresolution splatting as published, by the number of lights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ssgi_cl.techniques.multires.multires_published import MultiresPublished, MultiresPublishedParams
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from .multires_splat import few_pixels_subject, share_of


@dataclass(frozen=True)
class MultiresPublishedByNumber(Own):
    """Subsplats by geometry alone, without visibility; the setting is the number of lights."""

    SETTINGS: tuple[str, ...] = ("256", "1024")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make lights and multiresolution splatting ready."""
        params = MultiresPublishedParams(vpls=count_of(setting, "a number of lights", 1, 1 << 20))
        technique = MultiresPublished(context.runtime, context.size, params)
        return few_pixels_subject(
            context,
            technique,
            params.vpls,
            0.0,
            lambda: f"subsplats for {share_of(context, technique.counts())} of the pixels",
        )


FAMILIES: Mapping[str, Family] = {"multires-published": MultiresPublishedByNumber()}
