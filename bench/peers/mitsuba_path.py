"""One diffuse bounce by Mitsuba 3's paths, by their number a pixel, denoised or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssgi_cl.truth.light import MOST_PATHS
from ssgi_cl.truth.mitsuba_scene import within
from ssgi_cl.truth.path_tracer import OneBounce
from ssgi_cl.tuning.case import Subject, count_of
from ssgi_cl.tuning.context import Context

from . import mitsuba_rays, oidn
from .mitsuba_rays import VARIANT, Estimator


@dataclass(frozen=True)
class MitsubaPath:
    """The reference's own estimator with fewer paths; the setting is their number a pixel.

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
        paths = count_of(setting, "paths per pixel", 1, MOST_PATHS)
        view = context.view
        if not context.punctual_lights:
            raise ValueError(f"{view.name} has no light: expected at least one")
        with within(VARIANT):
            tracer = context.shared("Mitsuba's paths", lambda: OneBounce(view.scene, context.punctual_lights, VARIANT))
            estimator = Estimator(context, tracer, paths)
        run = estimator.mean
        if self.denoised:
            run = oidn.denoised(context, run)
        return Subject(
            run=run,
            image=run,
            on_device=False,
            quantity="bounce",
            samples=float(paths) * np.count_nonzero(context.seen),
            truths={"world": context.bounce},
            counted="paths made and traced" + (", denoised" if self.denoised else ""),
        )


FAMILIES = {"mitsuba-path": MitsubaPath(), "mitsuba-path-oidn": MitsubaPath(denoised=True)}
