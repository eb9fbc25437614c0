"""Multiresolution splatting as published, by the number of lights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.multires_published import MultiresPublished, MultiresPublishedParams
from ssgi_cl.truth import Truth

from ..case import Family, Own, Subject, count_of
from ..context import Context
from ..drawn import DrawnMaps, DrawnView
from .multires_splat import all_lights, relative_rmse
from .vpl_splat import MAP_SIZE, PIXEL_BYTES, counted, lit


@dataclass(frozen=True)
class MultiresPublishedByNumber(Own):
    """Subsplats by geometry alone, without visibility; the setting is the number of lights."""

    SETTINGS: tuple[str, ...] = ("256", "1024")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make lights and multiresolution splatting ready."""
        params = MultiresPublishedParams(
            vpls=count_of(setting, "a number of lights", 1, 1 << 20)
        )
        maps, view = DrawnMaps(context, MAP_SIZE), DrawnView(context, 1, 0.0)
        technique = MultiresPublished(context.runtime, context.size, params)
        pixels = context.size[0] * context.size[1]

        def image() -> NDArray[np.float32]:
            return lit(context, maps, lambda rsms: technique.run(view.draw(), None, rsms))

        off = image() - all_lights(context, maps, params.vpls, refine=0.0)
        share = sum(technique.counts()) / pixels
        truths: dict[str, Callable[[], Truth]] = {
            "world": context.bounce,
            "assumption": context.unblocked_bounce,
        }
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            moved=pixels * PIXEL_BYTES,
            truths=truths,
            counted=counted(view),
            note=f"{params.vpls} lights; subsplats for {100 * share:.1f} % of the "
            f"pixels; off all lights at all pixels by {relative_rmse(off, image()):.2f} % of the "
            "mean (RMSE)",
        )


FAMILIES: Mapping[str, Family] = {"multires-published": MultiresPublishedByNumber()}
