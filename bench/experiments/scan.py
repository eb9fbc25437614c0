"""Measurement of a scan of constants on one scene, and replacement of constants without a parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from ssgi_cl.tuning.context import Context

LEAST_ERROR = 1e-6
"""Of an error, so that a scene without any does not make the geometric mean 0."""


@dataclass(frozen=True)
class Measured:
    """Measurement of a setting on a scene.

    Attributes:
        error: what decides, >= 0.
        beside: counted work or a second error; see `Scan.beside`.
    """

    error: float
    beside: float


@dataclass(frozen=True)
class Scan:
    """A way to measure constants on a scene.

    Attributes:
        measure: called with a scene and the constants that differ from the defaults.
        error, beside: what the two numbers of `Measured` are, with their units.
    """

    measure: Callable[[Context, Mapping[str, Any]], Measured]
    error: str
    beside: str


@contextmanager
def replaced(module: ModuleType, values: Mapping[str, Any]) -> Iterator[None]:
    """Give a module's constants other values inside.

    Args:
        module: whose constants are replaced.
        values: name in lower case -> value.

    Raises:
        ValueError: the module has no such constant.
    """
    before = {name: getattr(module, name.upper(), None) for name in values}
    unknown = [name for name, value in before.items() if value is None]
    if unknown:
        raise ValueError(f"constant is {unknown[0]!r}: {module.__name__} has none of this name")
    try:
        for name, value in values.items():
            setattr(module, name.upper(), value)
        yield
    finally:
        for name, value in before.items():
            setattr(module, name.upper(), value)


def parted(values: Mapping[str, Any], constants: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return those of `values` whose names are in `constants`, and the others."""
    return (
        {name: value for name, value in values.items() if name in constants},
        {name: value for name, value in values.items() if name not in constants},
    )
