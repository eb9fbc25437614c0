"""Whole frames with and without what a scene does not need; `bench/skips.py` makes a table."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.frame.render import render
from ssgi_cl.frame.skips import SKIPS
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context

MOVING = tuple(name for name in SKIPS if name != "unchanged")
"""What may be left out of a frame that differs from the one before."""

CHOICES = {"none": (), "all": MOVING, "still": tuple(SKIPS)}


class Skips(Own):
    """Scene to picture with GTAO; the setting says what may be left out.

    `none`, `all` that the scene and its lights allow, or `still` for what a camera that stays
    allows besides.
    """

    SETTINGS = tuple(CHOICES)

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the pipeline ready."""
        if setting not in CHOICES:
            raise ValueError(f"setting is {setting!r}: expected one of {', '.join(CHOICES)}")
        view = context.view
        return Subject(
            run=lambda: render(
                view.scene,
                context.camera,
                view.lights,
                bounces=0,
                ao_radius=context.radius,
                skips=CHOICES[setting],
                runtime=context.runtime,
            ),
            note="with shadow maps drawn in each frame" if setting == "none" else "",
        )


FAMILIES: Mapping[str, Family] = {"skips": Skips()}
