"""Ambient occlusion of slices against what the same model converges to: many samples, and few."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ssgi_cl.techniques.ao.bitmask_ao import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams
from ssgi_cl.techniques.ao.slices import SliceParams
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context

from .slices import converged

_SETTING = re.compile(r"([1-9]\d?)x([1-9]\d?)(-blur)?")


@dataclass(frozen=True)
class Converged(Own):
    """A technique at full size; the setting is SLICESxTAPS, without blur, or SLICESxTAPS-blur.

    The model counts every pixel that a slice crosses, up to the radius. The last tap lies half a
    step before that, so that the mean error (the bias) halves with the taps' distance: twice that
    of 16x64 less that of 16x32 is the limit's. At 100 x 75, where the built-in scenes' radii are 6
    to 20 px, that is below .0004 for all three.

    Attributes:
        make, params: the technique.
        options: of its parameters.
    """

    make: Any
    params: type[SliceParams]
    options: Mapping[str, Any]
    SETTINGS: tuple[str, ...] = ("2x9", "2x9-blur", "16x32", "16x64")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the technique ready."""
        match = _SETTING.fullmatch(setting)
        if match is None:
            raise ValueError(f"setting is {setting!r}: expected SLICESxTAPS or SLICESxTAPS-blur, such as 2x9")
        blur: dict[str, Any] = {} if match[3] else {"blur_radius": 0}
        params = self.params(radius=context.radius, slices=int(match[1]), taps=int(match[2]), **self.options, **blur)
        technique = self.make(context.runtime, context.size, params)
        gbuffer = context.gbuffer
        return Subject(
            run=lambda: technique(gbuffer),
            image=lambda: technique(gbuffer),
            quantity="model",
            samples=2.0 * params.slices * params.taps * np.count_nonzero(context.seen),
            truths={"assumption": lambda: converged(context, technique, gbuffer)},
            note="surfaces each with a thickness" if self.options else "",
        )


FAMILIES: Mapping[str, Family] = {
    "hbao-model": Converged(Hbao, HbaoParams, {}),
    "gtao-model": Converged(Gtao, GtaoParams, {}),
    # Joined surfaces have no limit of their own: ever more taps leave nothing between them.
    "bitmask-model": Converged(BitmaskAo, BitmaskParams, {"joined": False}),
}
