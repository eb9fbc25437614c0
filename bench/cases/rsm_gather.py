"""Gathering from reflective shadow maps by the number of samples: how drawn, and at what size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.rsm_gather import RsmGather, RsmGatherParams

from ..case import Family, Own, Subject, count_of
from ..context import Context
from ..drawn import DrawnMaps

MAP_SIZE = 512
"""Texels along a side of each map."""


@dataclass(frozen=True)
class RsmGatherFamily(Own):
    """Irradiance by one bounce of all lamps; the setting is the number of samples of each.

    Attributes:
        pattern, resolution: see `RsmGatherParams`.
    """

    pattern: str = "flux"
    resolution: str = "full"
    SETTINGS: tuple[str, ...] = ("100", "400", "1600", "6400")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw the maps and make gathering ready."""
        samples = count_of(setting, "a number of samples", 1, 65536)
        if not context.lamps:
            raise ValueError(f"{context.view.name} has no lamp: expected at least one")
        runtime, gbuffer = context.runtime, context.gbuffer
        params = RsmGatherParams(
            samples=samples, pattern=self.pattern, resolution=self.resolution
        )
        pairs = [
            (RsmGather(runtime, context.size, params), DrawnMaps(context, MAP_SIZE, lamps=[lamp]))
            for lamp in context.lamps
        ]

        def image() -> NDArray[np.float32]:
            total = np.zeros((*context.size, 3), np.float32)
            for technique, maps in pairs:
                for rsm in maps.reflective():
                    total += technique(gbuffer, rsm)
            return total

        # Samples that are the same for all pixels need no scattered reads, others ten each.
        pixels = int(np.count_nonzero(context.seen))
        note = ""
        if self.resolution != "full":
            image()
            share = 100.0 * sum(technique.computed for technique, _ in pairs) / len(pairs)
            pixels = int(0.01 * share * pixels)
            note = f"{share:.1f} % of the pixels computed"
        reads = 0.0 if self.pattern == "flux" else 10.0 * pixels * samples * len(pairs)
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            samples=reads,
            truths={
                "world": context.bounce,
                "assumption": lambda: context.bounce(visibility=False),
            },
            counted=f"{DrawnMaps.counted}, samples drawn",
            note=note,
        )


FAMILIES: Mapping[str, Family] = {
    "rsm-gather": RsmGatherFamily(),
    "rsm-gather-adaptive": RsmGatherFamily(resolution="adaptive"),
    "rsm-gather-disk": RsmGatherFamily(pattern="fixed", SETTINGS=("100", "400", "1600")),
    "rsm-gather-disk-adaptive": RsmGatherFamily(
        pattern="fixed", resolution="adaptive", SETTINGS=("100", "400", "1600")
    ),
}
