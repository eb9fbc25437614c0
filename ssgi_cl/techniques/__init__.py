"""Techniques, one module each: ambient occlusion, indirect light, shading, filters."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

from ssgi_cl import former_names


def __getattr__(name: str) -> Any:
    if name in ("TECHNIQUES", "Entry"):
        where = f"{__name__}.catalogue"
        warnings.warn(f"{__name__}.{name} is now in {where}", DeprecationWarning, stacklevel=2)
        return getattr(import_module(where), name)
    if f"{__name__}.{name}" in former_names.MODULES:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
