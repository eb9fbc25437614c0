"""Parameters of techniques: declared once with range, unit and meaning, checked when made."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import Any, Self, get_type_hints

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import check_names


def param(
    default: Any,
    doc: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    choices: tuple[str, ...] = (),
    above: bool = False,
) -> Any:
    """Declare a parameter: a number in [low, high] ((low, high] with `above`) or one of `choices`.

    The same declaration validates, documents (`describe`) and bounds a search over parameters.
    """
    metadata = {"doc": doc, "low": low, "high": high, "unit": unit, "choices": choices,
                "above": above}
    return dataclasses.field(default=default, metadata=metadata)


_kinds = cache(get_type_hints)


class Params:
    """Base of the frozen dataclasses of parameters; checks every field that has a declaration."""

    def __new__(cls, *_: object, **given: object) -> Self:
        """Raise TypeError with the nearest name if a parameter is misspelt."""
        check_names(f"{cls.__name__}()", given, parameter_fields(cls))
        return super().__new__(cls)

    def __post_init__(self) -> None:
        own: Any = type(self)
        kinds = _kinds(own)
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            rule, value = field.metadata, getattr(self, field.name)
            if not rule or kinds[field.name] not in (int, float, str, bool):
                continue
            if kinds[field.name] is bool:
                checks.switch(field.name, value)
            elif rule["choices"]:
                checks.choice(field.name, value, rule["choices"])
            elif kinds[field.name] is int:
                value = checks.integer(
                    field.name, value, low=rule["low"], high=rule["high"], unit=rule["unit"]
                )
            else:
                value = checks.number(
                    field.name, value, low=rule["low"], high=rule["high"], unit=rule["unit"],
                    above=rule["above"], infinite=math.isinf(rule["high"]) and rule["high"] > 0
                    and field.default == math.inf,
                )
            object.__setattr__(self, field.name, value)


def parameter_fields(params: type[Params]) -> dict[str, dataclasses.Field[Any]]:
    """Return the declarations of parameters by name."""
    return {field.name: field for field in dataclasses.fields(params)}  # type: ignore[arg-type]


def describe(params: type[Params]) -> list[tuple[str, str, str]]:
    """Return (name, default, meaning with range and unit) of each parameter, for help texts."""
    lines = []
    for field in dataclasses.fields(params):  # type: ignore[arg-type]
        rule = field.metadata
        limits = _limits(rule["low"], rule["high"]) if rule else ""
        allowed = ", ".join(rule["choices"]) if rule and rule["choices"] else limits
        note = "; ".join(part for part in (allowed, rule["unit"] if rule else "") if part)
        lines.append((field.name, str(field.default), f"{rule['doc']} ({note})" if note
                      else str(rule["doc"] if rule else "")))
    return lines


def _limits(low: float, high: float) -> str:
    if math.isfinite(low) and math.isfinite(high):
        return f"{checks.limit(low)} to {checks.limit(high)}"
    if math.isfinite(low):
        return f"{checks.limit(low)} or more"
    return f"{checks.limit(high)} or less" if math.isfinite(high) else ""
