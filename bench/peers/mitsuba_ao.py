"""Ambient occlusion by Mitsuba 3's rays, by their number a pixel, denoised or not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.ray_ao import MOST_RAYS
from ssgi_cl.truth.mitsuba_scene import within
from ssgi_cl.truth.path_tracer import PathTracer, Surface

from ..case import Subject, count_of
from ..context import Context
from . import mitsuba_rays
from .mitsuba_rays import VARIANT, Estimator

Floats = NDArray[np.float32]


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
        denoised: whether Intel's denoiser follows.
    """

    SETTINGS: tuple[str, ...] = ("1", "4", "16", "64")
    denoised: bool = False

    def missing(self) -> str:
        """Return what to install where Mitsuba, LLVM or the denoiser is missing."""
        return mitsuba_rays.missing(denoised=self.denoised)

    def prepare(self, context: Context, setting: str) -> Subject:
        """Build the search tree and find the visible points."""
        rays = count_of(setting, "rays per pixel", 1, MOST_RAYS)
        with within(VARIANT):
            estimator = Estimator(context, Occlusion(context))

        def cast() -> Floats:
            return np.float32(1.0) - estimator.mean(rays)[..., 0]

        return mitsuba_rays.subject(
            context, cast, rays, "occlusion", context.occlusion, denoised=self.denoised
        )


def _curve(dr: Any, attenuation: str) -> Callable[[Any], Any] | None:
    """Return W as a function of the distance in radii, or None where it is 1."""
    curves: dict[str, Callable[[Any], Any] | None] = {
        "none": None,
        "linear": lambda share: 1.0 - share,
        "quadratic": lambda share: 1.0 - share * share,
        "exponential": lambda share: dr.exp(-share),
    }
    return curves[attenuation]


FAMILIES = {
    "mitsuba-ao": MitsubaAo(),
    "mitsuba-ao-oidn": MitsubaAo(("1", "4", "16"), denoised=True),
}
