"""Gathering from reflective shadow maps by the number of samples: how drawn, and at what size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.rasterize import rsm
from ssgi_cl.techniques.rsm_gather import RsmGather, RsmGatherParams

from ..case import Family, Own, Subject, count_of
from ..context import Context

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
        roads = []
        for lamp in context.lamps:
            seen = rsm(context.view.scene, lamp, size=MAP_SIZE, runtime=runtime)
            device = DeviceRsm(runtime, seen.cameras[0].size, len(seen.cameras))
            device.upload(seen)
            roads.append((RsmGather(runtime, context.size, params), device))

        def run() -> None:
            for technique, device in roads:
                technique.run(gbuffer, device)

        def image() -> NDArray[np.float32]:
            total = np.zeros((*context.size, 3), np.float32)
            for technique, device in roads:
                total += technique(gbuffer, device)
            return total

        # Samples that are the same for all pixels need no scattered reads, others ten each.
        pixels = int(np.count_nonzero(context.seen))
        note = "without drawing the maps and, as long as they stay, without drawing samples"
        if self.resolution != "full":
            run()
            share = 100.0 * sum(technique.computed for technique, _ in roads) / len(roads)
            pixels = int(0.01 * share * pixels)
            note += f"; {share:.1f} % of the pixels computed"
        reads = 0.0 if self.pattern == "flux" else 10.0 * pixels * samples * len(roads)
        return Subject(
            run=run,
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
