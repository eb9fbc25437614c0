"""Scenes made by code, so that everything can be tried without data."""

from __future__ import annotations

from collections.abc import Callable

from .builtin import BuiltinScene
from .cornell_box import cornell_box
from .hall import hall

BUILTIN_SCENES: dict[str, Callable[[], BuiltinScene]] = {"cornell_box": cornell_box, "hall": hall}
"""What makes each scene, by name."""

__all__ = ["BUILTIN_SCENES", "BuiltinScene", "cornell_box", "hall"]
