"""What is drawn while something moves: fewer pixels and lights, as many as the frame rate allows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ssgi_cl.frame.params import FrameParams, WholeFrameParams
from ssgi_cl.viewer.settings import direct_params

TARGET_MS = 60.0
"""Of a frame while something moves: 15 frames a second leave 66 ms; waiting for the next request takes some."""

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25)
"""Sides of a moving picture, as shares of those of the still one."""
START = 2
"""In `SCALES`."""

LEAST_SIDE = 48
"""Pixels of the shorter side of a moving picture, unless the still one is smaller."""

COARSE = {"vpls": 256, "surfels": 128, "directions": 32, "map_size": 64, "error": 1.0}
"""Accuracy of the whole picture while something moves. Chosen in `hall`: the gather takes 10 ms in place of 160."""
SHADOW_SIZE, RSM_SIZE = 512, 128
"""Texels along a side of shadow maps while something moves, at most."""

_STEADY, _MOST_STEADY = 6, 96
"""Frames in a row that have to be fast before the next have more pixels: at first, and after several that were slow."""
_FIXED = 0.75
"""Share of a moving frame's time that does not depend on its size: in `hall` 43 ms at 160 x 100, 57 at 320 x 200."""


def moving_params(params: FrameParams) -> FrameParams:
    """Return the parameters of a frame while something moves: as given or less exact."""
    changes: dict[str, Any] = {
        "shadow_size": min(params.shadow_size, SHADOW_SIZE),
        "rsm_size": min(params.rsm_size, RSM_SIZE),
        "layers": 1,
    }
    if params.whole is None:
        return replace(params, **changes)
    whole = params.whole
    own = {name: getattr(whole, name) for name in COARSE}
    coarse = {
        name: max(value, own[name]) if name == "error" else min(value, own[name]) for name, value in COARSE.items()
    }
    preset: WholeFrameParams = replace(whole, **coarse)
    return replace(params, preset=preset, **changes)


def quick_params(params: FrameParams) -> FrameParams:
    """Return the parameters of the very first picture: direct light and ambient occlusion, of which kernels are few."""
    return moving_params(direct_params(params))


class Pace:
    """Chooses the size of moving pictures from the time that the latest took."""

    def __init__(self) -> None:
        self._level = START
        self._fast = 0
        self._slow = 0
        self._steady = _STEADY

    @property
    def scale(self) -> float:
        """Side of the next moving picture, share of the still one's."""
        return SCALES[self._level]

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return (width, height) of the next moving picture for a still one of that size."""
        scale = max(self.scale, min(1.0, LEAST_SIDE / min(width, height)))
        return max(round(width * scale), 1), max(round(height * scale), 1)

    def note(self, ms: float) -> None:
        """Take into account what a moving picture took, milliseconds."""
        self._slow = self._slow + 1 if ms > TARGET_MS else 0
        if self._slow >= 2 and self._level + 1 < len(SCALES):
            self._level, self._slow, self._fast = self._level + 1, 0, 0
            self._steady = min(2 * self._steady, _MOST_STEADY)  # sizes do not go to and fro
            return
        finer = (SCALES[self._level - 1] / SCALES[self._level]) ** 2 if self._level else 0.0
        expected = ms * (_FIXED + (1.0 - _FIXED) * finer)
        self._fast = self._fast + 1 if self._level and expected < TARGET_MS else 0
        if self._fast >= self._steady:
            self._level, self._fast = self._level - 1, 0
