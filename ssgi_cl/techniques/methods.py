"""Methods of a technique: the library's own and the published one, each with its parameters."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params


@dataclass(frozen=True)
class Method:
    """One method of a technique.

    Attributes:
        technique: the class, to prepare once and run often.
        params: the dataclass that declares its parameters.
    """

    technique: type
    params: type[Params]


def chosen_params(methods: Mapping[str, Method], method: object, given: Mapping[str, Any]) -> Params:
    """Return the parameters of a method.

    Args:
        methods: all methods of the technique by name.
        method: the name of the one that is wanted.
        given: values of its parameters; those left out have their defaults.

    Raises:
        TypeError, ValueError: there is no such method, a parameter of another method alone, or a
            value of the wrong type or out of range.
    """
    name = checks.choice("method", method, tuple(methods))
    own = _names(methods[name])
    for parameter, value in given.items():
        others = [repr(other) for other, kind in methods.items() if parameter in _names(kind)]
        if parameter not in own and others:
            raise ValueError(
                f"{parameter}={value!r} applies only to method={' or '.join(others)} (got method={name!r})"
            )
    return methods[name].params(**given)


def _names(method: Method) -> set[str]:
    return {field.name for field in dataclasses.fields(method.params)}  # type: ignore[arg-type]
