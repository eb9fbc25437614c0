"""Filters: the edge-aware blur by its radius, joint-bilateral upsampling by its step, accumulation over frames."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.reference.filters.bilateral import bilateral_reference
from ssgi_cl.reference.filters.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.reference.temporal.accumulate import accumulate_reference
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleBlur, UpsampleParams
from ssgi_cl.techniques.temporal.accumulate import Accumulate, AccumulateParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

BLUR_BYTES = 2 * 4 * (1 + 1 + 3 + 1)
"""Per pixel, of both passes: value, depth and normal read, value written."""
UPSAMPLE_BYTES = 4 * (1 + 3 + 1)
"""Per pixel: depth and normal read, value written; what is read at reduced size is little."""
STEPS = ("2", "4")
CHANNELS = ("1", "3")
ACCUMULATE_BYTES = 4 * (1 + 4 + 4 + 3 + 4 + 3 + 4)
"""Per pixel and channel: value, both G-buffers, three means read and written, counts, and what is clamped."""
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


def accumulation(context: Context, setting: str) -> Subject:
    """Make one frame's accumulation ready, with the one before; the setting is the number of channels."""
    channels = int(checks.choice("setting", setting, CHANNELS))
    params = AccumulateParams(fast=1)  # so that the second frame is clamped, as all are later on
    technique = Accumulate(context.runtime, context.size, params, channels)
    rows, columns = context.size
    images = np.random.default_rng(3).random((2, channels, rows, columns)).astype(np.float32)
    before, now = (context.runtime.plane(channels, context.size) for _ in range(2))
    before.upload(images[0])
    now.upload(images[1])
    with context.runtime.frame():
        history = technique.run(context.gbuffer, before)
        technique.run(context.gbuffer, now, previous=context.gbuffer, history=history)

    def run() -> None:
        technique.run(context.gbuffer, now, previous=context.gbuffer, history=history)

    def image() -> NDArray[np.float32]:
        result = technique.run(context.gbuffer, now, previous=context.gbuffer, history=history)
        first: NDArray[np.float32] = result.mean.download()[0]
        return first

    def numpy_reference() -> Truth:
        first, second = (each[0] for each in images)
        start = accumulate_reference(first, context.host_gbuffer, params=params)
        return exact(accumulate_reference(second, context.host_gbuffer, context.host_gbuffer, start, params).mean)

    return Subject(
        run=run,
        image=image,
        moved=context.pixels * ACCUMULATE_BYTES * channels,
        truths={"assumption": numpy_reference},
        note="one frame of noise, with the history of another",
    )


FAMILIES: Mapping[str, Family] = {
    "blur": Family(blur, ("2", "4", "7", "16")),
    "upsample": Family(upsampling, STEPS),
    "accumulate": Family(accumulation, CHANNELS),
    "upsample-blur": Family(partial(upsampling, blurred=True), STEPS),
}
