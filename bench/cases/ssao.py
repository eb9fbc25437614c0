"""SSAO by the number of samples: alone, blurred, at half size, and by preset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.truth import assumption
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.choose import choose
from ssgi_cl.tuning.context import Context

PIXEL_BYTES = 4 * (1 + 3 + 1)
"""Depth and normal read, A written."""


@dataclass(frozen=True)
class SsaoFamily(Own):
    """SSAO with the parameters' defaults but for these.

    Attributes:
        blur_radius: pixels; 0 for no blur.
        resolution: "full", "half" or "quarter".
    """

    blur_radius: int = 0
    resolution: str = "full"
    SETTINGS: tuple[str, ...] = ("4", "8", "16", "32", "64", "128")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make SSAO with as many samples as the setting says ready."""
        samples = count_of(setting, "a number of samples per pixel", 1, 256)
        return ssao_subject(
            context,
            SsaoParams(
                radius=context.radius, samples=samples, blur_radius=self.blur_radius, resolution=self.resolution
            ),
        )


class SsaoPresets(Own):
    """SSAO by the name of its preset."""

    SETTINGS = ("low", "medium", "high", "ultra")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make SSAO with a preset ready."""
        chosen = choose("ssao", context.size, preset=setting, radius=context.radius)
        return ssao_subject(context, chosen.params)


def ssao_subject(context: Context, params: SsaoParams) -> Subject:
    """Return SSAO with any parameters as a subject."""
    technique = Ssao(context.runtime, context.size, params)
    gbuffer = context.gbuffer
    pixels, seen = context.size[0] * context.size[1], float(np.count_nonzero(context.seen))
    model = replace(params, blur_radius=0, resolution="full", samples=16, max_samples=0)
    return Subject(
        run=lambda: technique(gbuffer),
        image=lambda: technique(gbuffer),
        quantity="occlusion",
        samples=seen / RESOLUTIONS[params.resolution] ** 2 * params.samples,
        moved=pixels * PIXEL_BYTES,
        truths={
            "world": context.occlusion,
            "assumption": lambda: context.truth(
                f"points of SSAO's model on {context.view.name}: {model}",
                lambda progress: assumption.ssao(
                    context.host_gbuffer,
                    model,
                    context.truths.points,
                    rebuild=context.truths.rebuild,
                    progress=progress,
                ),
            ),
        },
    )


FAMILIES: Mapping[str, Family] = {
    "ssao": SsaoFamily(),
    "ssao-blur": SsaoFamily(blur_radius=2),
    "ssao-half": SsaoFamily(blur_radius=2, resolution="half"),
    "ssao-preset": SsaoPresets(),
}
