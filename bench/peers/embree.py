"""Ambient occlusion by Embree's rays against the mesh, by the number of rays a pixel."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.memory import Plane
from ssgi_cl.techniques.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.ray_ao import MOST_RAYS, RayAo, Settings, threads

from ..case import Subject, count_of
from ..context import Context
from .extras import missing_package

SEED = 1 << 32
"""Of random numbers: none that a pass of the truth has, whose rays these would otherwise be."""

BLUR_RADIUS = 4
"""Pixels on either side."""

_BLOCKS = 16  # parts of the image, the unit of work of a thread


class Rays(RayAo):
    """Rays from points that are looked for once: what `RayAo` does after primary visibility."""

    def __init__(self, context: Context, rays: int) -> None:
        super().__init__(context.view.scene)
        self._settings = Settings.of(
            context.radius, rays, "cosine", context.truths.attenuation, None, SEED, False
        )
        self._size = context.size
        edges = np.linspace(0, context.size[0], _BLOCKS + 1).astype(int)
        blocks = (
            self._caster.spots(context.camera, slice(first, last), context.host_gbuffer)
            for first, last in pairwise(edges)
        )
        self._blocks = [spots for spots in blocks if len(spots.pixel)]

    def cast(self) -> NDArray[np.float32]:
        """Return A [rows, columns] float32."""
        image = np.ones(self._size, np.float32)
        with ThreadPoolExecutor(threads()) as pool:
            cast = pool.map(lambda spots: self.occlusion(spots, self._settings)[0], self._blocks)
            for spots, occluded in zip(self._blocks, cast, strict=True):
                image.ravel()[spots.pixel] = 1.0 - occluded
        return np.clip(image, 0.0, 1.0)


@dataclass(frozen=True)
class EmbreeFamily:
    """Rays as the truth casts them, but fewer; the setting is their number a pixel.

    Attributes:
        blurred: whether the edge-aware blur follows, on the device.
    """

    SETTINGS: tuple[str, ...] = ("1", "4", "16", "64")
    blurred: bool = False

    def missing(self) -> str:
        """Return what to install where embreex is missing."""
        return missing_package("embreex", "truth")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Build the search tree and look for the points that rays start from."""
        rays = count_of(setting, "rays per pixel", 1, MOST_RAYS)
        caster = Rays(context, rays)
        run: Callable[[], object] = caster.cast
        image, also = caster.cast, ""
        if self.blurred:
            run, image = _blurred(context, caster)
            also = f", with a blur of radius {BLUR_RADIUS} px"
        return Subject(
            run=run,
            image=image,
            on_device=False,
            quantity="occlusion",
            samples=float(rays) * np.count_nonzero(context.seen),
            truths={"world": context.occlusion},
            note=f"without search tree and primary visibility{also}",
        )


def _blurred(
    context: Context, caster: Rays
) -> tuple[Callable[[], Plane], Callable[[], NDArray[np.float32]]]:
    """Return what casts rays and queues the blur, and what gives the result as an image."""
    noisy = context.runtime.plane(1, context.size)
    blur = Bilateral(context.runtime, context.size, BilateralParams(radius=BLUR_RADIUS))

    def run() -> Plane:
        noisy.upload(caster.cast()[None])
        return blur.run(noisy, context.gbuffer)

    return run, lambda: run().download()[0]


FAMILIES = {"embree": EmbreeFamily(), "embree-blur": EmbreeFamily(("1", "4", "16"), blurred=True)}
