"""Kinds of arrays that callers bring: taken without a copy where that is possible, and given back.

Any object with `__dlpack__`, `__array__` or the buffer protocol is an array here. A result is of
the kind of the array that it was made from: a numpy array, a memoryview, or an array of the
library, and on the device, of an object with `__dlpack__`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LAYOUTS = ("HWC", "CHW")
"""Places of the channels: last, or before rows and columns."""

_REFUSED = (TypeError, BufferError, RuntimeError, AttributeError, ValueError)
"""Errors by which libraries say that the host cannot read an array, or that they cannot take one."""


def host_array(value: Any) -> NDArray[Any]:
    """Return `value` as a numpy array that shares its memory where the host can read it, else as a copy.

    Raises:
        TypeError: it is on a device and its library cannot copy it to the host, or of a dtype that
            numpy has not, such as bfloat16.
    """
    if isinstance(value, np.ndarray) or not hasattr(value, "__dlpack__"):
        return np.asarray(value)
    plain = value.detach() if hasattr(value, "detach") else value  # torch gives away no array that needs gradients
    for take in (np.from_dlpack, np.asarray):
        try:
            found = take(plain)
        except _REFUSED:
            continue
        if found.dtype != object:  # numpy's answer to what it does not know
            return found
    for method in ("cpu", "get"):  # of torch and of cupy
        if hasattr(plain, method):
            try:
                return np.asarray(getattr(plain, method)())
            except _REFUSED:
                continue
    kind = f"{type(value).__module__}.{type(value).__qualname__} of {getattr(value, 'dtype', 'no dtype')}"
    raise TypeError(f"a {kind} cannot be read by the host: expected numbers that numpy has, in host memory")


class ArrayKind(NamedTuple):
    """Kind of an array that is not numpy's.

    Attributes:
        library: name of the module that makes such arrays; "" for a memoryview.
        device: where it is, as its library writes it; "" where the library does not say.
    """

    library: str
    device: str = ""

    def __call__(self, result: NDArray[Any]) -> Any:
        """Return an array of the kind: it shares the memory of `result` where its device reads the
        host's, else it is a copy."""
        result = np.ascontiguousarray(result)
        if not self.library:
            return memoryview(result)  # type: ignore[arg-type]
        library = sys.modules[self.library]
        if hasattr(library, "from_numpy"):  # torch
            return library.from_numpy(result).to(self.device)
        for name in ("from_dlpack", "asarray"):
            if hasattr(library, name):
                try:
                    return getattr(library, name)(result)
                except _REFUSED:
                    continue  # of a device that does not share memory with the host
        raise TypeError(f"{self.library} takes no array of the host: expected from_numpy, from_dlpack or asarray in it")


def array_kind(value: Any) -> ArrayKind | None:
    """Return the kind of an array; None if it is numpy's, or no array."""
    if isinstance(value, memoryview):
        return ArrayKind("")
    if isinstance(value, np.ndarray) or not hasattr(value, "__dlpack__"):
        return None
    # The array API standard (2024.12) names the module; torch, which has none, is its own.
    standard = hasattr(value, "__array_namespace__")
    library = value.__array_namespace__().__name__ if standard else type(value).__module__.partition(".")[0]
    return ArrayKind(library, str(getattr(value, "device", "")))


def kind_among(values: Iterable[Any]) -> ArrayKind | None:
    """Return the kind of the first array, or of a G-buffer's, among arguments; None if all are numpy's."""
    for value in values:
        kind = getattr(value, "array_kind", None)
        kind = kind if isinstance(kind, ArrayKind) else array_kind(value)
        if kind is not None:
            return kind
    return None


def of_kind(result: Any, kind: ArrayKind | None) -> Any:
    """Return a result, or the arrays of a tuple, as arrays of a kind; what is no array stays as it is."""
    if kind is None:
        return result
    if isinstance(result, np.ndarray):
        return kind(result)
    if isinstance(result, tuple):
        parts = [of_kind(each, kind) for each in result]
        return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
    return result


def channels_last(name: str, array: NDArray[Any], layout: str, channels: int) -> NDArray[Any]:
    """Return a view [..., rows, columns, channels] of an array in a layout; of one channel [..., rows, columns]."""
    if layout == "HWC":
        return array
    if array.ndim < 3 or array.shape[-3] != channels:
        raise ValueError(f"{name} has shape {array.shape}: expected (..., {channels}, rows, columns) with layout='CHW'")
    return array[..., 0, :, :] if channels == 1 else np.moveaxis(array, -3, -1)
