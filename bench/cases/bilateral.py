"""The edge-aware blur by its radius, on the noise of SSAO with 16 samples."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.reference.filters.bilateral import bilateral_reference
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

PIXEL_BYTES = 2 * 4 * (1 + 1 + 3 + 1)
"""Of both passes: value, depth and normal read, value written."""


class Blur(Own):
    """One application of the blur; the setting is its radius in pixels."""

    SETTINGS = ("2", "4", "7", "16")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the blur ready."""
        params = BilateralParams(radius=count_of(setting, "a radius in pixels", 1, 16))
        noisy = Ssao(context.runtime, context.size, SsaoParams(radius=context.radius, blur_radius=0))
        blur = Bilateral(context.runtime, context.size, params)
        with context.runtime.frame():
            value = noisy.run(context.gbuffer)
        pixels = context.size[0] * context.size[1]

        def numpy_reference() -> Truth:
            return exact(bilateral_reference(value.download()[0], context.host_gbuffer, params))

        return Subject(
            run=lambda: blur.run(context.gbuffer, value),
            image=lambda: blur.run(context.gbuffer, value).download()[0],
            moved=pixels * PIXEL_BYTES,
            truths={"assumption": numpy_reference},
            note="the blur alone",
        )


FAMILIES: Mapping[str, Family] = {"blur": Blur()}
