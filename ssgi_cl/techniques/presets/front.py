"""The front of error over time that the recorded settings of all techniques of ambient occlusion make together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from ssgi_cl.core.names import AoTechnique
from ssgi_cl.techniques import presets

SHARE = {"low": 1.0, "medium": 2.0, "high": 4.0, "ultra": 32.0}
"""Time of each preset over that of GTAO's defaults with as many layers, at most. From high to ultra is far: only the
bitmask with many slices errs less than what high is."""
SCENE_LAYERS = {"low": 1, "medium": 2, "high": 4, "ultra": 4}
"""Depth layers that each preset draws of a scene."""
OVERSCAN = 0.1
"""Of G-buffers that are drawn, where there is any: that of the records."""
DRAWN_MS = {(1, 0.0): 2.5, (1, OVERSCAN): 3.3, (2, 0.0): 3.7, (2, OVERSCAN): 5.2, (4, 0.0): 5.9, (4, OVERSCAN): 7.8}
"""(layers, overscan) -> device time of drawing, median over the scenes for tuning, where the records are from and at
their size: what errors are weighed with, so that the same error gets the same setting everywhere."""


@dataclass(frozen=True)
class Option:
    """A recorded setting of a technique, on G-buffers of a kind.

    Attributes:
        technique: its name.
        parameters: of it.
        layers, overscan: of the G-buffers.
        error: expected RMSE against cast rays: the geometric mean over the scenes for tuning or over those for
            validation, whichever is greater.
        ms: recorded device time.
    """

    technique: str
    parameters: Mapping[str, Any]
    layers: int
    overscan: float
    error: float
    ms: float

    def __str__(self) -> str:
        named = ", ".join(f"{key}={value!r}" for key, value in self.parameters.items())
        return f"{self.technique}({named})"


def options(layers: int, overscan: float) -> list[Option]:
    """Return all recorded settings for G-buffers of some layers; with the errors of no overscan unless there is any."""
    found = []
    for technique in get_args(AoTechnique):
        for setting in presets.curve(technique, layers):
            error = setting.error if overscan else setting.error_cut
            error *= max(1.0, setting.validation / setting.error)
            found.append(Option(technique, setting.parameters, layers, overscan, error, setting.ms))
    return found


def drawn_options() -> list[Option]:
    """Return all recorded settings with each number of layers and overscan that a scene may be drawn with."""
    return [option for layers, overscan in DRAWN_MS for option in options(layers, overscan)]


def front(found: Iterable[Option], cost: Callable[[Option], float]) -> list[Option]:
    """Return those of which none other has both less cost and less error: of rising cost and falling error."""
    result: list[Option] = []
    for option in sorted(found, key=lambda option: (cost(option), option.error)):
        if not result or option.error < result[-1].error:
            result.append(option)
    return result


def named(preset: str, layers: int, overscan: float) -> Option:
    """Return the option of a preset: the least error within its share of the time of GTAO's defaults."""
    usual = presets.recorded_for("gtao", layers)["default"]["ms"]
    fast = [option for option in options(layers, overscan) if option.ms <= SHARE[preset] * usual]
    return min(fast, key=lambda option: (option.error, option.ms))
