"""Who should use which: what a page says above its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .document import groups
from .verdict import verdict

GUIDE: Mapping[str, str] = {
    "There is no mesh (passes of a renderer, a depth camera, a game's frame)":
        "image space; nothing else can.",
    "The mesh stands still, and a CPU casts the rays":
        "rays with a blur or a denoiser below the error that each group names; above it image "
        "space is sooner.",
    "The mesh moves":
        "image space, but for errors below the one that each group names with the building of "
        "the tree counted: for some 250,000 triangles that alone takes longer than any technique "
        "here.",
    "Time matters most":
        "gtao, one layer, or a preset: budget_ms picks the best setting that fits.",
    "Error matters most":
        "bitmask_ao with two or four depth layers and a tenth of overscan. The floor is what rays "
        "find in the same layers: half of what is missing lies behind the first surface, the rest "
        "mostly beside the image.",
    "As first published":
        "hbao fades with distance and ssao takes a volume for what is hidden: their error is the "
        "model's, and no number of samples removes it.",
}
"""A need -> what serves it."""


def advises(document: Mapping[str, Any]) -> bool:
    """Return whether a document measures what the guide speaks of: our A beside that of rays."""
    return any(
        key[0] == "occlusion" and verdict(results)
        for key, results in groups(document["results"]).items()
    )
