"""What can be measured, by family: this library's techniques, and its peers.

Each module declares `FAMILIES`, name -> family; a new one is found by itself.
"""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.tuning.case import Family

from ..discover import declared
from ..peers import PEERS

ORDER = (
    "ssao",
    "slices",
    "converged",
    "bent_normals",
    "lecture",
    "floor",
    "bilateral",
    "upsample",
    "shade",
    "whole_frame",
    "rsm_gather",
    "rsm_published",
    "ssdo",
    "rasterize",
    "shadow_maps",
    "skips",
    "vpl_splat",
    "vpl_lobes",
    "multires_splat",
    "multires_published",
)
"""Of the modules in lists of cases; others come after these."""

OWN: Mapping[str, Family] = declared(__name__, "FAMILIES", ORDER)
"""This library's."""

FAMILIES: Mapping[str, Family] = {**OWN, **PEERS}
"""All of them."""
