"""Read-only arrays of data classes whose contents are cached by identity."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

A = TypeVar("A", bound=np.ndarray[Any, Any])


def frozen(array: A, given: object = None) -> A:
    """Return `array` as a read-only array whose memory nobody else can write to.

    Args:
        array: any array.
        given: what it was converted from. If the conversion made a new array, that array is made
            read-only in place instead of copied.

    Returns:
        The array itself if it and everything that it is a view of are read-only, else a copy.
    """
    holder: Any = array
    while isinstance(holder, np.ndarray) and not holder.flags.writeable:
        holder = holder.base
    if holder is None or isinstance(holder, bytes):
        return array
    converted = isinstance(given, (np.ndarray, list, tuple)) and array is not given
    own = array if converted and array.base is None else array.copy()
    own.flags.writeable = False
    return own


class Immutable:
    """Base of frozen dataclasses whose arrays are read-only.

    numpy's arrays come back writable from `pickle` and `copy.deepcopy`; a copy of the object makes
    its own read-only again.
    """

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, _frozen_within(value))


def _frozen_within(value: Any) -> Any:
    """Return an attribute with its array, or the arrays of a tuple, read-only."""
    if isinstance(value, np.ndarray):
        return frozen(value)
    return tuple(map(_frozen_within, value)) if type(value) is tuple else value
