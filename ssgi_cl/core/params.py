"""Parameters of techniques: declared once with range, unit and meaning, checked when made."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Hashable
from functools import cache
from typing import Any, Generic, Literal, Self, TypeVar, get_origin, get_type_hints

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import check_names


def param(
    default: Any,
    doc: str,
    *,
    low: float = -math.inf,
    high: float | None = None,
    unit: str = "",
    choices: tuple[str, ...] = (),
    above: bool = False,
    shape: Callable[[Any], Hashable] | None = None,
) -> Any:
    """Declare a parameter: a number in [low, high] ((low, high] with `above`) or one of `choices`,
    which of a `Literal` are its names (`get_args`).

    The same declaration validates, documents (`describe`) and bounds a search over parameters.

    Args:
        default, doc: its default and its meaning.
        low, high, above, unit, choices: what it may be; infinite only if `high` is.
        shape: returns the part of the value that programs and allocations depend on; `bool` for
            a number of which 0 is a program of its own. By default nothing of a float, which is
            an argument of kernels, and all of anything else.
    """
    metadata = {"doc": doc, "low": low, "unit": unit, "choices": choices, "above": above, "shape": shape}
    most = {"high": math.inf if high is None else high, "infinite": high == math.inf}
    return dataclasses.field(default=default, metadata=metadata | most)


@cache
def _kinds(params: Any) -> dict[str, Any]:
    """Return the type of each parameter; a name out of some is a str."""
    return {name: str if get_origin(kind) is Literal else kind for name, kind in get_type_hints(params).items()}


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
            else:
                limits = {name: rule[name] for name in ("low", "high", "unit")}
                if kinds[field.name] is int:
                    value = checks.integer(field.name, value, **limits)
                else:
                    value = checks.number(field.name, value, **limits, above=rule["above"], infinite=rule["infinite"])
            object.__setattr__(self, field.name, value)

    def shape(self) -> Hashable:
        """Return all of the parameters that programs and allocations depend on.

        Objects prepared for parameters of one shape take all of that shape, see `Prepared`.
        """
        own: Any = type(self)
        return own, *[part(getattr(self, name)) for name, part in _shape_parts(own)]


@cache
def _shape_parts(params: Any) -> tuple[tuple[str, Callable[[Any], Hashable]], ...]:
    """Return of each parameter its name and what of its value is part of the shape."""
    kinds = _kinds(params)

    def default(name: str) -> Callable[[Any], Hashable]:
        return (lambda _: None) if kinds[name] is float else (lambda value: value)

    fields = dataclasses.fields(params)
    return tuple((field.name, field.metadata.get("shape") or default(field.name)) for field in fields)


Q = TypeVar("Q", bound=Params)


class Prepared(Generic[Q]):
    """Base of techniques: prepared for parameters of one shape, whose values may be changed.

    A subclass sets `_params` in its constructor.
    """

    _params: Q

    @property
    def params(self) -> Q:
        """The parameters; others of the same `Params.shape` may be set between two runs.

        Nothing is compiled or allocated then. ValueError: they have another shape.
        """
        return self._params

    @params.setter
    def params(self, params: Q) -> None:
        if params.shape() != self._params.shape():
            raise ValueError(
                f"{type(self).__name__} was prepared for {self._params}: expected parameters that "
                f"differ in values alone, got {params}"
            )
        # Set last: an exception on the way leaves nothing that the next call takes for done.
        self._set(params)
        self._params = params

    def _set(self, params: Q) -> None:
        """Bring what is made of values up to date, before `params` take the place of the others."""


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
        lines.append(
            (field.name, str(field.default), f"{rule['doc']} ({note})" if note else str(rule["doc"] if rule else ""))
        )
    return lines


F = TypeVar("F", bound=Callable[..., Any])


def with_fields_described(*kinds: type[Params]) -> Callable[[F], F]:
    """Make `help` of a function list what its `**params` may be: the fields of dataclasses that it does not name.

    The entry `**params` of its docstring ends the section Args; the list comes after it, with meaning, range, unit and
    default of each.
    """

    def described(function: F) -> F:
        entry = re.search(r"^( *)\*\*params:.*?(?=\n\n)", function.__doc__ or "", re.DOTALL | re.MULTILINE)
        if entry is None:  # docstrings were stripped
            return function
        named = inspect.signature(function).parameters
        lines = []
        for kind in kinds:
            indent = entry[1] + " " * 4
            if len(kinds) > 1:
                lines.append(f"{indent}`{kind.__name__}`:")
                indent += " " * 4
            for name, default, meaning in describe(kind):
                if name not in named:
                    text = f"{name}: {meaning}; by default {default}"
                    lines += textwrap.wrap(text, 100, initial_indent=indent, subsequent_indent=indent + " " * 4)
        listed = "\n".join([entry[0], *lines])
        function.__doc__ = (function.__doc__ or "").replace(entry[0], listed, 1)
        return function

    return described


def _limits(low: float, high: float) -> str:
    if math.isfinite(low) and math.isfinite(high):
        return f"{checks.limit(low)} to {checks.limit(high)}"
    if math.isfinite(low):
        return f"{checks.limit(low)} or more"
    return f"{checks.limit(high)} or less" if math.isfinite(high) else ""
