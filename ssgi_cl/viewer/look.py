"""What one tab asks to see: all of it in one record that is replaced and never changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ssgi_cl.core.lights import Light
from ssgi_cl.viewer.light_settings import LightState, shining
from ssgi_cl.viewer.outputs import ERROR, OUTPUTS
from ssgi_cl.viewer.pose import Pose
from ssgi_cl.viewer.settings import Settings

Against = Literal["nothing", "B", "reference"]
AGAINST: tuple[Against, ...] = ("nothing", "B", "reference")


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """What is to be seen.

    Attributes:
        pose: of the camera.
        size: (width, height) of the still picture, pixels.
        output: out of `OUTPUTS`, or `ERROR`.
        settings: parameters of the frame.
        lights: all, those that are off too.
        against: what is right of the wipe.
        wipe: place of the wipe, share of the width.
        other: the look that is B; only its output, settings and lights count.
    """

    pose: Pose
    size: tuple[int, int]
    output: str = next(iter(OUTPUTS))
    settings: Settings
    lights: tuple[LightState, ...]
    against: Against = "nothing"
    wipe: float = 0.5
    other: Look | None = None

    @property
    def shining(self) -> tuple[Light, ...]:
        """The lights that are on."""
        return shining(self.lights)

    @property
    def drawn(self) -> str:
        """Name of the output that is drawn: the picture, for its error."""
        return next(iter(OUTPUTS)) if self.output == ERROR else self.output
