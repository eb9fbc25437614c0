"""Ambient occlusion by Mitsuba 3's rays, by their number a pixel: bare, blurred or denoised."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.truth.mitsuba_scene import within
from ssgi_cl.truth.path_tracer import PathTracer, Surface
from ssgi_cl.truth.ray_ao import MOST_RAYS
from ssgi_cl.tuning.case import Subject, count_of
from ssgi_cl.tuning.context import Context

from . import mitsuba_rays, oidn
from .embree import Tree
from .mitsuba_rays import VARIANT, Estimator

Floats = NDArray[np.float32]

BLURS = {1: BilateralParams(radius=8, normal_sigma=0.7), 4: BilateralParams(radius=5), 16: BilateralParams(radius=2)}
"""The blur for as many rays a pixel and more: of radii 2 to 8 px and sigmas .3 to 1 those of the
least mean error on `REPORTED`, though our own techniques are tuned on other scenes."""


class Occlusion(PathTracer):
    """1 - A, cosine-weighted, of a scene without lights."""

    numbers = 2

    def __init__(self, context: Context) -> None:
        super().__init__(context.view.scene, (), VARIANT)
        self._radius = context.radius
        self._curve = _curve(self.dr, context.truths.attenuation)

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        """Return V * W of a ray; those that start into the surface meet it at distance 0."""
        mi, dr, scene = self.mi, self.dr, self._world.scene
        way = self._cosine_distributed(seen, numbers)
        above = dr.dot(seen.normal, way) > 0.0
        ray, active = mi.Ray3f(seen.front, way, self._radius, 0.0, []), seen.there & above
        if self._curve is None:
            met = dr.select(scene.ray_test(ray, active), 1.0, 0.0)
        else:
            hit = scene.ray_intersect_preliminary(ray, active=active)
            met = dr.select(hit.is_valid(), self._curve(hit.t / self._radius), 0.0)
        return dr.select(above, met, 1.0)


@dataclass(frozen=True)
class MitsubaAo:
    """The setting is the number of rays a pixel.

    Attributes:
        then: what follows: "" nothing, "blur" this library's edge-aware blur, on the device, or
            "oidn" Intel's denoiser.
        moving: whether Embree builds the search tree in every run, as for a mesh that moves.
            Mitsuba does not build one in place, so embreex builds that of the same triangles.
    """

    SETTINGS: tuple[str, ...] = ("1", "4", "16")
    then: str = ""
    moving: bool = False

    def missing(self) -> str:
        """Return what to install where Mitsuba, LLVM or the denoiser is missing."""
        return mitsuba_rays.missing(denoised=self.then == "oidn")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Build the search tree and find the visible points."""
        rays = count_of(setting, "rays per pixel", 1, MOST_RAYS)
        with within(VARIANT):
            tracer = context.shared("Mitsuba's occlusion", lambda: Occlusion(context))
            estimator = Estimator(context, tracer, rays, scalar=True)
        tree = context.shared("embreex's tree", lambda: Tree(context.view.scene))

        def cast() -> Floats:
            if self.moving:
                tree.build()
            image: Floats = np.clip(np.float32(1.0) - estimator.mean()[..., 0], 0.0, 1.0)
            return image

        run: Callable[[], Floats] = cast
        counted = "tree built, rays made and cast" if self.moving else "rays made and cast"
        if self.then == "blur":
            blur = BLURS[max(least for least in BLURS if least <= rays)]
            run = blurred(context, cast, blur)
            counted += f", copied to the device, blurred ({blur.radius} px), copied back"
        elif self.then == "oidn":
            run = oidn.denoised(context, cast)
            counted += ", denoised"
        return Subject(
            run=run,
            image=run,
            setup=tree.bring if self.moving else None,
            on_device=False,
            quantity="occlusion",
            samples=float(rays) * np.count_nonzero(context.seen),
            truths={"world": context.occlusion},
            counted=counted,
        )


def blurred(context: Context, cast: Callable[[], Floats], params: BilateralParams) -> Callable[[], Floats]:
    """Return what casts rays, blurs the result on the device and gives it as an image."""
    noisy = context.runtime.plane(1, context.size)
    blur = Bilateral(context.runtime, context.size, params)

    def run() -> Floats:
        noisy.upload(cast()[None])
        image: Floats = blur.run(context.gbuffer, noisy).download()[0]
        return image

    return run


def _curve(dr: Any, attenuation: str) -> Callable[[Any], Any] | None:
    """Return W as a function of the distance in radii, or None where it is 1."""
    curves: dict[str, Callable[[Any], Any] | None] = {
        "none": None,
        "linear": lambda share: 1.0 - share,
        "quadratic": lambda share: 1.0 - share * share,
        "exponential": lambda share: dr.exp(-share),
    }
    return curves[attenuation]


STATIC: Mapping[str, MitsubaAo] = {
    "mitsuba-ao": MitsubaAo(("1", "4", "16", "64")),
    "mitsuba-ao-blur": MitsubaAo(then="blur"),
    "mitsuba-ao-oidn": MitsubaAo(then="oidn"),
}
"""Of a mesh that does not move."""
MOVING: Mapping[str, MitsubaAo] = {
    "mitsuba-ao-moving": MitsubaAo(moving=True),
    "mitsuba-ao-moving-blur": MitsubaAo(then="blur", moving=True),
    "mitsuba-ao-moving-oidn": MitsubaAo(then="oidn", moving=True),
}
"""Of a mesh that moves."""
FAMILIES = {**STATIC, **MOVING}
