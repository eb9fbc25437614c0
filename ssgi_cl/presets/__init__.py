"""Presets: parameters that tuning found, with the scenes, the truth and the device it used.

`TECHNIQUE.json` beside this file holds those of a technique and everything that they depend on.
`python -m ssgi_cl.bench.presets TECHNIQUE` records them anew.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

from ssgi_cl import check

NAMES = ("low", "medium", "high", "ultra")
"""From the fastest to the best."""


@cache
def record(technique: str) -> dict[str, Any]:
    """Return all that is recorded for a technique, as its file holds it; not to be changed.

    Raises:
        ValueError: it has no presets.
    """
    folder = resources.files(__package__)
    known = sorted(
        file.name.removesuffix(".json") for file in folder.iterdir() if file.name.endswith(".json")
    )
    if technique not in known:
        raise ValueError(f"{technique!r} has no presets: expected one of {', '.join(known)}")
    document: dict[str, Any] = json.loads((folder / f"{technique}.json").read_text("utf-8"))
    return document


def parameters(technique: str, name: str) -> dict[str, Any]:
    """Return the parameters of a preset.

    Raises:
        ValueError: the technique has no presets, or none of this name.
    """
    presets = record(technique)["presets"]
    return dict(presets[check.choice("preset", name, tuple(presets))]["parameters"])
