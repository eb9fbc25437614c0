"""Names of parameters: those that a function takes, and the nearest one to a misspelt name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar, get_args, get_type_hints

P = ParamSpec("P")
T = TypeVar("T")


def unknown_name(what: str, name: str, names: Iterable[str]) -> str:
    """Return the message that `what` has no parameter `name`: the nearest of `names`, then all."""
    listed = sorted(names)
    near = get_close_matches(name, listed, 1)
    guess = f"did you mean {near[0]!r}? It has" if near else "it has"
    return f"{what} has no parameter {name!r}: {guess} {', '.join(listed)}"


def check_names(what: str, given: Iterable[str], names: Iterable[str]) -> None:
    """Raise TypeError if one of the names `given` to `what` is none of `names`."""
    known = set(names)
    for name in given:
        if name not in known:
            raise TypeError(unknown_name(what, name, known))


@cache
def parameter_names(function: Callable[..., Any]) -> frozenset[str] | None:
    """Return the names of the parameters that a function takes by keyword.

    Those of `**params: Unpack[SomeKeywords]` (PEP 692) are the keys of that `TypedDict`. None if
    the function takes any name.
    """
    names: set[str] = set()
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is parameter.VAR_KEYWORD:
            typed = get_args(get_type_hints(function)[parameter.name])
            if not typed:
                return None
            names |= get_type_hints(typed[0]).keys()
        elif parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY):
            names.add(parameter.name)
    return frozenset(names)


def check_keywords(function: Callable[..., Any], given: Iterable[str]) -> None:
    """Raise TypeError if a function takes no parameter of one of the names `given`."""
    names = parameter_names(function)
    if names is not None:
        check_names(f"{function.__name__}()", given, names)


def checked_keywords(function: Callable[P, T]) -> Callable[P, T]:
    """Make a function name the nearest parameter when it is called with a misspelt one."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        check_keywords(function, kwargs)
        return function(*args, **kwargs)

    return call
