"""Presets: settings that tuning found, with the scenes, the truth and the device it used.

`TECHNIQUE.json` beside this file holds those of a technique and everything that they depend on: for
each number of depth layers four presets, and the curve of error over time that they lie on, which
falls on the scenes for tuning and on those for validation; "medium" is the technique's defaults.
`python -m ssgi_cl.bench.presets TECHNIQUE` records them anew. `ssgi_cl.choose` picks one.
`front.json` holds what `ssgi_cl.ao` chooses from beside them, see `front`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, get_args

from ssgi_cl.core import checks
from ssgi_cl.core.names import Preset

NAMES = get_args(Preset)
"""From the fastest to the best."""
FRONT = "front.json"
"""File of the settings that `ssgi_cl.ao` chooses from beside those of techniques."""


@dataclass(frozen=True)
class Setting:
    """Parameters and the measurements with them.

    Attributes:
        parameters: those worth tuning; a radius is none of them.
        ms: device time of a picture of the recorded size.
        error: RMSE against cast rays, of G-buffers with the recorded overscan; geometric mean over
            the scenes for tuning.
        error_cut: the same of G-buffers that end at the image's border.
        validation: as `error`, over the scenes for validation.
        reporting: the same, over the scenes that errors are reported on.
    """

    parameters: Mapping[str, Any]
    ms: float
    error: float
    error_cut: float
    validation: float
    reporting: float


@cache
def record(technique: str) -> dict[str, Any]:
    """Return the record of a technique, as its file holds it; not to be changed.

    Raises:
        ValueError: it has no presets.
    """
    folder = resources.files(__package__)
    known = sorted(
        file.name.removesuffix(".json")
        for file in folder.iterdir()
        if file.name.endswith(".json") and file.name != FRONT
    )
    if technique not in known:
        raise ValueError(f"{technique!r} has no presets: expected one of {', '.join(known)}")
    document: dict[str, Any] = json.loads((folder / f"{technique}.json").read_text("utf-8"))
    return document


def recorded_for(technique: str, layers: int) -> dict[str, Any]:
    """Return the record of the most depth layers that are no more than `layers`.

    Raises:
        ValueError: the technique has no presets.
    """
    entries: list[dict[str, Any]] = record(technique)["layers"]
    return max((entry for entry in entries if entry["layers"] <= layers), key=lambda entry: int(entry["layers"]))


def parameters(technique: str, name: str, layers: int = 1) -> dict[str, Any]:
    """Return the parameters of a preset for G-buffers of some depth layers.

    Raises:
        ValueError: the technique has no presets, or none of this name.
    """
    presets = recorded_for(technique, layers)["presets"]
    return dict(presets[checks.choice("preset", name, NAMES)]["parameters"])


def curve(technique: str, layers: int = 1) -> list[Setting]:
    """Return the recorded settings on the front of error over time, the fastest first.

    Raises:
        ValueError: the technique has no presets.
    """
    return [Setting(**point) for point in recorded_for(technique, layers)["curve"]]
