"""The ways of `ssgi_cl.render` that are measured: a table to add to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ssgi_cl.frame.params import DEFAULT_PRESET, PRESETS


@dataclass(frozen=True)
class Mode:
    """Keyword arguments of `ssgi_cl.render`.

    Attributes:
        options: of the frame.
        direct: what to change for direct light, of punctual lights, emission and environments; None
            where no change gives it: reflected light is subtracted from the frame.
        one_bounce: what to change for direct light and one bounce; None where the frame has no
            later bounces.
    """

    options: Mapping[str, Any] = field(default_factory=dict)
    direct: Mapping[str, Any] | None = None
    one_bounce: Mapping[str, Any] | None = None


DEFAULT = "default"

MODES: Mapping[str, Mode] = {
    DEFAULT: Mode(one_bounce={"bounces": 1}),
    **{name: Mode({"preset": name}, one_bounce={"bounces": 1}) for name in PRESETS if name != DEFAULT_PRESET},
    "direct": Mode({"bounces": 0}, {}),
    "multires": Mode({"indirect": "multires", "layers": 2, "vpls": 4096}, {"indirect": False}),
}
"""Name -> how a frame is rendered."""
