"""Filters: the edge-aware blur by its radius, and joint-bilateral upsampling by its step."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.reference.filters.bilateral import bilateral_reference
from ssgi_cl.reference.filters.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleBlur, UpsampleParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

BLUR_BYTES = 2 * 4 * (1 + 1 + 3 + 1)
"""Per pixel, of both passes: value, depth and normal read, value written."""
UPSAMPLE_BYTES = 4 * (1 + 3 + 1)
"""Per pixel: depth and normal read, value written; what is read at reduced size is little."""
STEPS = ("2", "4")
BLUR = BilateralParams(radius=7)


def blur(context: Context, setting: str) -> Subject:
    """Make one blur of the noise of SSAO ready; the setting is its radius in pixels."""
    params = BilateralParams(radius=count_of(setting, "a radius in pixels", 1, 16))
    noisy = Ssao(context.runtime, context.size, SsaoParams(radius=context.radius, blur_radius=0))
    technique = Bilateral(context.runtime, context.size, params)
    with context.runtime.frame():
        value = noisy.run(context.gbuffer)

    def numpy_reference() -> Truth:
        return exact(bilateral_reference(value.download()[0], context.host_gbuffer, params))

    return Subject(
        run=lambda: technique.run(context.gbuffer, value),
        image=lambda: technique.run(context.gbuffer, value).download()[0],
        moved=context.pixels * BLUR_BYTES,
        truths={"assumption": numpy_reference},
        note="the blur alone",
    )


def upsampling(context: Context, setting: str, *, blurred: bool = False) -> Subject:
    """Make the step from reduced to full size ready, which is the setting; `blurred`: with `BLUR` in one."""
    step = int(checks.choice("setting", setting, STEPS))
    reduced = ReducedGBuffer(context.gbuffer, step)
    with context.runtime.frame():
        reduced.update(context.gbuffer)
    # What is upsampled: a ramp, on which wrong weights show as steps.
    rows, columns = reduced.size
    ramp = (np.add.outer(np.arange(rows) / rows, np.arange(columns) / columns) / 2.0).astype(np.float32)
    coarse = context.runtime.plane(1, reduced.size)
    coarse.upload(ramp[None])
    technique = (
        UpsampleBlur(context.runtime, context.size, step, BLUR)
        if blurred
        else Upsample(context.runtime, context.size, UpsampleParams(step=step))
    )

    def numpy_reference() -> Truth:
        if blurred:
            return exact(upsample_blur_reference(ramp, context.host_gbuffer, BLUR, step=step))
        return exact(upsample_reference(ramp, context.host_gbuffer, step=step))

    return Subject(
        run=lambda: technique.run(context.gbuffer, coarse, reduced=reduced),
        image=lambda: technique.run(context.gbuffer, coarse, reduced=reduced).download()[0],
        moved=context.pixels * UPSAMPLE_BYTES,
        truths={"assumption": numpy_reference},
        note="upsampling and a 15 x 15 blur in one, of a ramp" if blurred else "the upsampling alone, of a ramp",
    )


FAMILIES: Mapping[str, Family] = {
    "blur": Family(blur, ("2", "4", "7", "16")),
    "upsample": Family(upsampling, STEPS),
    "upsample-blur": Family(partial(upsampling, blurred=True), STEPS),
}
