"""The front of error over time that the recorded settings of all techniques of ambient occlusion make together."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from ssgi_cl.techniques import presets

CHOSEN = ("gtao", "bitmask_ao")
"""Techniques that are chosen from. GTAO errs less than SSAO in the same time, but for settings that take a seventh less
than its fastest. What attenuates with distance, as HBAO, errs little where other errors happen to be opposite, as in
the scenes for tuning, and up to 3.9 times as much as others elsewhere."""
SHARE = {"low": 1.0, "medium": 2.3, "high": 4.5, "ultra": 32.0}
"""Time of each preset over that of GTAO's defaults with as many layers, at most; of a scene over that of drawing one
layer with overscan, and GTAO's defaults. From high to ultra is far: only the bitmask with many slices errs less than
what high is."""
OVERSCAN = 0.1
"""Of G-buffers that are drawn, where there is any: that of the records."""
SCANS = "ssgi-ao-front 2"
"""Format of the record of further settings."""


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
        thickness: whether the G-buffers tell where solids end.
    """

    technique: str
    parameters: Mapping[str, Any]
    layers: int
    overscan: float
    error: float
    ms: float
    thickness: bool = False

    def __str__(self) -> str:
        named = ", ".join(f"{key}={value!r}" for key, value in self.parameters.items())
        return f"{self.technique}({named})"

    @property
    def drawn_ms(self) -> float:
        """Recorded device time of drawing the G-buffer: what errors are weighed with, so that the same error gets the
        same setting everywhere."""
        return drawing(self.layers, self.overscan, thickness=self.thickness) * _usual_ms(1)


@cache
def scans() -> dict[str, Any]:
    """Return the record of settings beyond those of `presets`, such as scans of every other pixel and known ends of
    solids; not to be changed. `python -m ssgi_cl.bench.ao_front` records it anew."""
    document: dict[str, Any] = json.loads((resources.files(presets) / presets.FRONT).read_text("utf-8"))
    return document


def drawing(layers: int, overscan: float, *, thickness: bool) -> float:
    """Return the recorded time of drawing a G-buffer over that of GTAO's defaults with one layer."""
    recorded = [each for each in scans()["drawn"] if each["layers"] <= layers and each["overscan"] == overscan]
    times: float = max(recorded, key=lambda each: each["layers"])[
        "with thickness" if thickness else "without thickness"
    ]
    return times


def _usual_ms(layers: int) -> float:
    """Return the recorded time of GTAO's defaults."""
    ms: float = presets.recorded_for("gtao", layers)["default"]["ms"]
    return ms


def options(layers: int, overscan: float, *, thickness: bool = False) -> list[Option]:
    """Return all recorded settings for G-buffers of some layers; with the errors of no overscan unless there is any.

    With `thickness` those that read it are the settings that were recorded with it.
    """
    found = []

    def add(technique: str, of: Mapping[str, Any], ms: float, *, reads: bool = False) -> None:
        error = of["error"] if overscan else of["error_cut"]
        error *= max(1.0, of["validation"] / of["error"])
        found.append(Option(technique, of["parameters"], layers, overscan, error, ms, reads))

    for technique in CHOSEN:
        if thickness and technique == "bitmask_ao":
            continue
        for setting in presets.curve(technique, layers):
            add(technique, vars(setting), setting.ms)
    recorded = [each for each in scans()["settings"] if each["layers"] <= layers]
    nearest = max(each["layers"] for each in recorded)
    usual = _usual_ms(layers)
    for each in recorded:
        reads = thickness and each["technique"] == "bitmask_ao"
        if each["layers"] == nearest and each["thickness"] == reads:
            add(each["technique"], each, each["times"] * usual, reads=reads)
    return found


def every_option(layers: int, overscan: float, *, thickness: bool) -> list[Option]:
    """Return all recorded settings for G-buffers of some layers, with `thickness` also those that read it."""
    known = [option for option in options(layers, overscan, thickness=True) if option.thickness] if thickness else []
    return [*options(layers, overscan), *known]


def drawn_options(*, thickness: bool) -> list[Option]:
    """Return all recorded settings with each number of layers and overscan that a scene may be drawn with, with
    `thickness` also those with known ends of solids."""
    kinds = [(each["layers"], each["overscan"]) for each in scans()["drawn"]]
    return [option for kind in kinds for option in every_option(*kind, thickness=thickness)]


def front(found: Iterable[Option], cost: Callable[[Option], float]) -> list[Option]:
    """Return those of which none other has both less cost and less error: of rising cost and falling error."""
    result: list[Option] = []
    for option in sorted(found, key=lambda option: (cost(option), option.error)):
        if not result or option.error < result[-1].error:
            result.append(option)
    return result


def named(preset: str, found: Sequence[Option], *, drawn: bool = False) -> Option:
    """Return the option of a preset, of those for one kind of G-buffers, or with `drawn` of those for all kinds: the
    least error within its share of time."""

    def ms(option: Option) -> float:
        return option.ms + (option.drawn_ms if drawn else 0.0)

    usual = _usual_ms(1) * (1.0 + drawing(1, OVERSCAN, thickness=False)) if drawn else _usual_ms(found[0].layers)
    most = SHARE[preset] * usual
    return min((each for each in found if ms(each) <= most), key=lambda each: (each.error, ms(each)))
