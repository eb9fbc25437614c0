"""Scenes made by code, so that everything can be tried without data.

What is tuned is tuned on some of them and reported on others, so that a table of errors never
shows how well parameters fit the very pictures they were fitted to.
"""

from __future__ import annotations

from collections.abc import Callable

from .builtin import BuiltinScene
from .cornell_box import cornell_box
from .hall import hall
from .parlour import parlour
from .terrace import terrace
from .workshop import workshop

BUILTIN_SCENES: dict[str, Callable[[], BuiltinScene]] = {
    "cornell_box": cornell_box,
    "hall": hall,
    "parlour": parlour,
    "terrace": terrace,
    "workshop": workshop,
}
"""What makes each scene, by name."""

REPORTED = ("cornell_box", "hall")
"""Scenes on which errors are reported; nothing is tuned on them."""

TUNED_ON = ("parlour", "terrace", "workshop")
"""Scenes on which parameters are tuned."""

__all__ = [
    "BUILTIN_SCENES",
    "REPORTED",
    "TUNED_ON",
    "BuiltinScene",
    "cornell_box",
    "hall",
    "parlour",
    "terrace",
    "workshop",
]
