"""Gathering from reflective shadow maps by the number of samples: how drawn, and at what size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.rsm.rsm_gather import RsmGather, RsmGatherParams
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps

MAP_SIZE = 512
"""Texels along a side of each map."""


@dataclass(frozen=True)
class RsmGatherFamily(Own):
    """Irradiance by one bounce of all lights; the setting is the number of samples of each.

    Attributes:
        pattern, resolution: see `RsmGatherParams`.
    """

    pattern: str = "flux"
    resolution: str = "full"
    SETTINGS: tuple[str, ...] = ("100", "400", "1600", "6400")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw the maps and make gathering ready."""
        samples = count_of(setting, "a number of samples", 1, 65536)
        gbuffer, drawn = context.gbuffer, punctual_maps(context)
        params = RsmGatherParams(samples=samples, pattern=self.pattern, resolution=self.resolution)
        technique = RsmGather(context.runtime, context.size, params)

        def image() -> NDArray[np.float32]:
            return technique(gbuffer, [rsm for maps in drawn for rsm in maps.reflective()])

        # Samples that are the same for all pixels need no scattered reads, others ten each.
        pixels = int(np.count_nonzero(context.seen))
        note = ""
        if self.resolution != "full":
            image()
            pixels = int(technique.computed * pixels)
            note = f"{100.0 * technique.computed:.1f} % of the pixels computed"
        reads = 0.0 if self.pattern == "flux" else 10.0 * pixels * samples * len(drawn)
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            samples=reads,
            truths={"world": context.bounce, "assumption": context.unblocked_bounce},
            counted=f"{DrawnMaps.counted}, samples drawn",
            note=note,
        )


def punctual_maps(context: Context) -> list[DrawnMaps]:
    """Return the maps of each light; the published pattern projects a pixel into one at a time.

    Raises:
        ValueError: the view has no light.
    """
    if not context.punctual_lights:
        raise ValueError(f"{context.view.name} has no light: expected at least one")
    return [
        DrawnMaps(context, MAP_SIZE, punctual_lights=[punctual_light]) for punctual_light in context.punctual_lights
    ]


FAMILIES: Mapping[str, Family] = {
    "rsm-gather": RsmGatherFamily(),
    "rsm-gather-adaptive": RsmGatherFamily(resolution="adaptive"),
    "rsm-gather-disk": RsmGatherFamily(pattern="fixed", SETTINGS=("100", "400", "1600")),
    "rsm-gather-disk-adaptive": RsmGatherFamily(
        pattern="fixed", resolution="adaptive", SETTINGS=("100", "400", "1600")
    ),
}
