"""HBAO with the setting of the lecture that made it known (Bavoil and Sainz 2008)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context

SETTING = "6x6"
"""Directions and steps."""

BLUR_RADIUS = 7
"""15 x 15 pixels of the full size."""


class Lecture(Own):
    """6 directions of 6 steps at half size, blurred with 15 x 15 pixels at full size.

    The case gives the size; the lecture's was 1600 x 1200.
    """

    SETTINGS = (SETTING,)

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make it ready."""
        if setting != SETTING:
            raise ValueError(f"setting is {setting!r}: expected {SETTING!r}")
        params = HbaoParams(
            radius=context.radius,
            slices=3,
            taps=6,
            resolution="half",
            blur_radius=BLUR_RADIUS,
            blur_resolution="full",
            attenuation=1.0,
        )
        technique = Hbao(context.runtime, context.size, params)
        gbuffer = context.gbuffer
        rows, columns = context.size
        return Subject(
            run=lambda: technique(gbuffer),
            image=lambda: technique(gbuffer),
            quantity="occlusion",
            samples=36.0 / 4.0 * np.count_nonzero(context.seen),
            moved=rows * columns * 4 * (1 + 3 + 1),
            truths={"world": context.occlusion},
            note="AO at half size, 15 x 15 blur at full size; at 1600 x 1200 a GTX 280 took 3.5 + 2.5 ms in 2008",
        )


FAMILIES: Mapping[str, Family] = {"lecture": Lecture()}
