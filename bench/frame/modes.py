"""The ways of `ssgi_cl.render` that are measured: a table to add to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Mode:
    """Keyword arguments of `ssgi_cl.render`.

    Attributes:
        options: of the frame.
        direct: what to change for direct light, of punctual lights, emission and environments.
        one_bounce: what to change for direct light and one bounce; None where the frame has no
            later bounces.
    """

    options: Mapping[str, Any] = field(default_factory=dict)
    direct: Mapping[str, Any] = field(default_factory=lambda: {"indirect": None})
    one_bounce: Mapping[str, Any] | None = None


DEFAULT = "default"

MODES: Mapping[str, Mode] = {
    DEFAULT: Mode(),
    "multires": Mode({"indirect": "multires", "layers": 2, "vpls": 4096}),
}
"""Name -> how a frame is rendered."""
