"""Calls of every technique with small inputs: a module for each, which declares `CALLS`."""

from __future__ import annotations

from collections.abc import Mapping

from ..discover import declared
from .inputs import Call

ORDER = (
    "drawing",
    "shadow_maps",
    "blended_layers",
    "bilateral",
    "upsample",
    "ao",
    "ssdo",
    "rsm_gather",
    "vpl_splat",
    "multires_splat",
    "shade",
    "tonemap",
)
"""Of the modules; others come after these."""

CALLS: Mapping[str, Call] = declared(__name__, "CALLS", ORDER)
"""Name of a technique, with its method where there are several -> what calls it."""
