"""Gathering from reflective shadow maps by the number of samples: how drawn, and at what size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.rsm_gather import RsmGather, RsmGatherParams

from ..case import Family, Own, Subject, count_of
from ..context import Context
from .vpl_splat import drawn_maps


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
        maps, gbuffer = drawn_maps(context), context.gbuffer
        params = RsmGatherParams(
            samples=samples, pattern=self.pattern, resolution=self.resolution
        )
        technique = RsmGather(context.runtime, context.size, params)

        def image() -> NDArray[np.float32]:
            return technique(gbuffer, maps)

        # Samples that are the same for all pixels need no scattered reads, others ten each.
        pixels = int(np.count_nonzero(context.seen))
        note = "without drawing the maps and, as long as they stay, without drawing samples"
        if self.resolution != "full":
            image()
            share = technique.computed
            pixels = int(share * pixels)
            note += f"; {100.0 * share:.1f} % of the pixels computed"
        reads = 0.0 if self.pattern == "flux" else 10.0 * pixels * samples * len(maps)
        return Subject(
            run=lambda: technique.run(gbuffer, maps),
            image=image,
            quantity="bounce",
            samples=reads,
            truths={
                "world": context.bounce,
                "assumption": lambda: context.bounce(visibility=False),
            },
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
