"""Joint-bilateral upsampling by its step, alone and with a 15 x 15 blur in one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ssgi_cl.reference.filters.upsample import upsample_blur_reference, upsample_reference
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer, Upsample, UpsampleBlur, UpsampleParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context, exact

PIXEL_BYTES = 4 * (1 + 3 + 1)
"""Depth and normal read, value written; what is read at reduced size is little."""


BLUR = BilateralParams(radius=7)


class Upsampling(Own):
    """The step from reduced to full size; the setting is 2 or 4."""

    SETTINGS = ("2", "4")

    def __init__(self, *, blurred: bool = False) -> None:
        self._blurred = blurred

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the upsampling ready."""
        if setting not in self.SETTINGS:
            raise ValueError(f"setting is {setting!r}: expected a step, 2 or 4")
        step = int(setting)
        reduced = ReducedGBuffer(context.gbuffer, step)
        with context.runtime.frame():
            reduced.update(context.gbuffer)
        # What is upsampled: a ramp, on which wrong weights show as steps.
        rows, columns = reduced.size
        ramp = np.add.outer(np.arange(rows) / rows, np.arange(columns) / columns) / 2.0
        coarse = context.runtime.plane(1, reduced.size)
        coarse.upload(ramp[None].astype(np.float32))
        upsample = (
            UpsampleBlur(context.runtime, context.size, step, BLUR)
            if self._blurred
            else Upsample(context.runtime, context.size, UpsampleParams(step=step))
        )
        pixels = context.size[0] * context.size[1]

        def numpy_reference() -> Truth:
            given, host = ramp.astype(np.float32), context.host_gbuffer
            if self._blurred:
                return exact(upsample_blur_reference(given, host, BLUR, step=step))
            return exact(upsample_reference(given, host, step=step))

        return Subject(
            run=lambda: upsample.run(context.gbuffer, coarse, reduced=reduced),
            image=lambda: upsample.run(context.gbuffer, coarse, reduced=reduced).download()[0],
            moved=pixels * PIXEL_BYTES,
            truths={"assumption": numpy_reference},
            note="upsampling and a 15 x 15 blur in one, of a ramp"
            if self._blurred
            else "the upsampling alone, of a ramp",
        )


FAMILIES: Mapping[str, Family] = {"upsample": Upsampling(), "upsample-blur": Upsampling(blurred=True)}
