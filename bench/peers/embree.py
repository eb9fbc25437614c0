"""Ambient occlusion by Embree's rays against the mesh, by the number of rays a pixel."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.memory import Plane
from ssgi_cl.raycast import RayCaster
from ssgi_cl.techniques.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.ray_ao import MOST_RAYS, RayAo, Settings, threads

from ..case import Subject, count_of
from ..context import Context
from . import oidn
from .extras import missing_package

Floats = NDArray[np.float32]

SEED = 1 << 32
"""Of random numbers: none that a pass of the truth has, whose rays these would otherwise be."""

BLURS = {
    1: BilateralParams(radius=8, normal_sigma=0.7),
    4: BilateralParams(radius=5),
    16: BilateralParams(radius=2),
}
"""The blur for as many rays a pixel and more: of radii 2 to 8 px and sigmas .3 to 1 those of the
least mean error on `REPORTED`, though our own techniques are tuned on other scenes."""

_BLOCKS = 16  # parts of the image, the unit of work of a thread


class Triangles(RayCaster):
    """Triangles whose search tree can be built again."""

    def build(self) -> None:
        """Copy the triangles and build their tree, as is needed once they have moved."""
        from embreex import mesh_construction, rtcore_scene

        rays = rtcore_scene.EmbreeScene(robust=True)
        mesh_construction.TriangleMesh(rays, self._positions, self._triangles)
        rays.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))  # builds the tree
        self._rays = rays


class Rays(RayAo):
    """Rays from points that are looked for once: what `RayAo` does after primary visibility."""

    def __init__(self, context: Context, rays: int) -> None:
        self._caster: Triangles = Triangles(context.view.scene)
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

    def cast(self) -> Floats:
        """Return A [rows, columns] float32."""
        image = np.ones(self._size, np.float32)
        with ThreadPoolExecutor(threads()) as pool:
            cast = pool.map(lambda spots: self.occlusion(spots, self._settings)[0], self._blocks)
            for spots, occluded in zip(self._blocks, cast, strict=True):
                image.ravel()[spots.pixel] = 1.0 - occluded
        return np.clip(image, 0.0, 1.0)

    def build_and_cast(self) -> Floats:
        """Build the search tree anew; return A [rows, columns] float32."""
        self._caster.build()
        return self.cast()


@dataclass(frozen=True)
class EmbreeFamily:
    """Rays as the truth casts them, but fewer; the setting is their number a pixel.

    Attributes:
        moving: whether the search tree is built in every run, as for geometry that moves.
        then: what follows: "" nothing, "blur" the edge-aware blur, on the device, or "oidn"
            Intel's denoiser.
    """

    SETTINGS: tuple[str, ...] = ("1", "4", "16", "64")
    moving: bool = False
    then: str = ""

    def missing(self) -> str:
        """Return what to install where embreex or the denoiser is missing."""
        why = missing_package("embreex", "truth")
        return why or (oidn.missing() if self.then == "oidn" else "")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Build the search tree and look for the points that rays start from."""
        rays = count_of(setting, "rays per pixel", 1, MOST_RAYS)
        caster = Rays(context, rays)
        cast = caster.build_and_cast if self.moving else caster.cast
        run: Callable[[], object] = cast
        image, also = cast, ""
        if self.then == "blur":
            blur = BLURS[max(least for least in BLURS if least <= rays)]
            run, image = _blurred(context, cast, blur)
            also = f", with a blur of radius {blur.radius} px"
        elif self.then == "oidn":
            run = image = oidn.denoised(context, cast)
            also = ", with the denoiser"
        return Subject(
            run=run,
            image=image,
            on_device=False,
            quantity="occlusion",
            samples=float(rays) * np.count_nonzero(context.seen),
            truths={"world": context.occlusion},
            note="with the search tree, without primary visibility" + also
            if self.moving else "without search tree and primary visibility" + also,
        )


def _blurred(
    context: Context, cast: Callable[[], Floats], params: BilateralParams
) -> tuple[Callable[[], Plane], Callable[[], Floats]]:
    """Return what casts rays and queues the blur, and what gives the result as an image."""
    noisy = context.runtime.plane(1, context.size)
    blur = Bilateral(context.runtime, context.size, params)

    def run() -> Plane:
        noisy.upload(cast()[None])
        return blur.run(noisy, context.gbuffer)

    return run, lambda: run().download()[0]


_FEW = ("1", "4", "16")

STATIC = {
    "embree": EmbreeFamily(),
    "embree-blur": EmbreeFamily(_FEW, then="blur"),
    "embree-oidn": EmbreeFamily(_FEW, then="oidn"),
}
"""Of geometry that stands still."""
MOVING = {
    "embree-moving": EmbreeFamily(moving=True),
    "embree-moving-blur": EmbreeFamily(_FEW, moving=True, then="blur"),
    "embree-moving-oidn": EmbreeFamily(_FEW, moving=True, then="oidn"),
}
"""Of geometry that moves."""
FAMILIES = {**STATIC, **MOVING}
