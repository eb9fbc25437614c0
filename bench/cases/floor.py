"""The floor: how wrong ambient occlusion is that knows what depth layers hold, and does not guess."""

from __future__ import annotations

import re
from collections.abc import Mapping

from ssgi_cl import truth
from ssgi_cl.rasterize.raster.view import MOST_LAYERS, downloaded
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Subject
from ssgi_cl.tuning.context import Context

from ..peers.extras import missing_package

_SETTING = re.compile(r"([1-9]\d?)(?:-([1-9]\d?))?")


class Floor:
    """Rays against the layers; the setting is LAYERS, or LAYERS-OVERSCAN in per cent.

    A bound, not a technique: rays are as many as the world truth's, in the same directions, so
    that the noise of both cancels. Guesses may get below it: techniques that take what is behind
    a surface for solid do so in places, with one layer.
    """

    SETTINGS = ("1", "2", "4", "1-10", "2-10", "4-10")

    def missing(self) -> str:
        """Return what to install where embreex is missing."""
        return missing_package("embreex", "truth")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Draw the layers."""
        match = _SETTING.fullmatch(setting)
        layers, overscan = (int(match[1]), int(match[2] or 0)) if match else (0, 0)
        if not 1 <= layers <= MOST_LAYERS:
            raise ValueError(
                f"setting is {setting!r}: expected LAYERS or LAYERS-OVERSCAN, 1 to {MOST_LAYERS} "
                "layers and 1 to 99 % of overscan, such as 2-10"
            )
        gbuffer = downloaded(context.layered(layers, 0.01 * overscan))

        def floor() -> Truth:
            return context.truth(
                f"rays against {setting} of {context.view.name}",
                lambda progress: truth.layered_occlusion(
                    gbuffer,
                    context.radius,
                    context.truths.rays,
                    attenuation=context.truths.attenuation,
                    rebuild=context.truths.rebuild,
                    progress=progress,
                ),
            )

        return Subject(
            run=floor,
            image=lambda: floor().mean,
            on_device=False,
            quantity="occlusion",
            truths={"world": context.occlusion},
            note="rays against what the depth layers hold: a bound, so no time",
            timed=False,
        )


FAMILIES: Mapping[str, Family] = {"floor": Floor()}
