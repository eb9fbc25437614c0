"""Crops of shadow maps, kept from frame to frame of a sequence while they serve what is seen."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.techniques.direct.seen_depths import Seen
from ssgi_cl.techniques.direct.shadow_fit import Crop, excess, fitted

COARSER = 1.5
"""Excess width of texels over that of crops fitted anew, up to which crops stay."""
SPARE = 0.05
"""Excess width of a pixel's texels, in pixels, that is none."""


class KeptCrops:
    """The crops of each light in the frame before.

    Others would have their texels elsewhere, so that the edges of shadows jump.
    """

    def __init__(self) -> None:
        self._latest: dict[int, tuple[tuple[Camera, ...], tuple[Crop, ...]]] = {}

    def fitted(self, light: int, cameras: tuple[Camera, ...], seen: Seen, most: int) -> tuple[Crop, ...]:
        """Return crops of a light by its number: those of the frame before where they do, else others, see `fitted`."""
        found = fitted(cameras, seen, most)
        before = self._latest.get(light)
        if before is not None and len(before[1]) <= most and _same_faces(before[0], cameras):
            limit = COARSER * excess(found, cameras, seen) + SPARE * float(seen.pixels.sum())
            if excess(before[1], cameras, seen) <= limit:
                found = before[1]
        self._latest[light] = cameras, found
        return found


def _same_faces(before: tuple[Camera, ...], now: tuple[Camera, ...]) -> bool:
    """Return whether faces have the same pixels; their depths may differ."""
    rows = [0, 1, 3]
    return len(before) == len(now) and all(
        a.size == b.size and np.array_equal(a.view, b.view) and np.array_equal(a.projection[rows], b.projection[rows])
        for a, b in zip(before, now, strict=True)
    )
