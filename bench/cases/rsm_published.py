"""Gathering from reflective shadow maps as published, by the number of samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.rsm.rsm_published import RsmPublished, RsmPublishedParams
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps
from .rsm_gather import punctual_maps


@dataclass(frozen=True)
class RsmPublishedFamily(Own):
    """Irradiance by one bounce of all lights; the setting is the number of samples of each."""

    SETTINGS: tuple[str, ...] = ("100", "400", "1600")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw the maps and make gathering ready."""
        samples = count_of(setting, "a number of samples", 1, 65536)
        gbuffer, drawn = context.gbuffer, punctual_maps(context)
        params = RsmPublishedParams(samples=samples)
        technique = RsmPublished(context.runtime, context.size, params)

        def image() -> NDArray[np.float32]:
            return technique(gbuffer, [rsm for maps in drawn for rsm in maps.reflective()])

        image()
        share = technique.computed
        pixels = int(share * context.size[0] * context.size[1])
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            samples=10.0 * pixels * samples * len(drawn),
            truths={"world": context.bounce, "assumption": context.unblocked_bounce},
            counted=DrawnMaps.counted,
            note=f"{100 * share:.1f} % of the pixels gathered for",
        )


FAMILIES: Mapping[str, Family] = {"rsm-gather-published": RsmPublishedFamily()}
