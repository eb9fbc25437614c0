"""Methods that took arguments by position in another order: calls like those work and warn."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def former_order(*names: str, first: Callable[[Any], bool] | None = None) -> Callable[[F], F]:
    """Let a method be called with the arguments that it took by position, for one release.

    A call is a former one if it has more positional arguments than the method takes now, or if the
    first is what another argument is now. It warns and is answered by the method.

    Args:
        names: of the arguments in their former order, without `self`.
        first: tells whether the first positional argument is one that was first before; not needed
            where the same argument is first.
    """

    def decorate(method: F) -> F:
        parameters = list(inspect.signature(method).parameters.values())[1:]
        positional = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]

        @wraps(method)
        def called(self: Any, *args: Any, **named: Any) -> Any:
            former = len(args) > len(positional) or bool(args and first and first(args[0]))
            if former and len(args) <= len(names):
                given = dict(zip(names, args, strict=False))
                twice = sorted(given.keys() & named.keys())
                if twice:
                    raise TypeError(f"{method.__name__}() got {twice[0]} by position and by name")
                keywords = [name for name in names if name not in positional and name in given]
                now = ", ".join((*positional, *(f"{name}={name}" for name in keywords)))
                warnings.warn(
                    f"{type(self).__name__}.{method.__name__}({', '.join(given)}) is now {method.__name__}({now})",
                    DeprecationWarning,
                    stacklevel=2,
                )
                return method(self, **given, **named)
            return method(self, *args, **named)

        return cast(F, called)

    return decorate
