"""Arguments of kernels: values given by name, checked against the kernel's own signature."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ssgi_cl.core.errors import KernelSourceError
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.signature import PLANE, Parameter, Signature
from ssgi_cl.device.structs import Struct


class _OtherType(Exception):
    """An argument is not of the parameter's type."""


Convert = Callable[[Any], Any]
"""From an argument to what OpenCL takes; raises `_OtherType` if it is of another type."""

_ELEMENTS: dict[str, type[np.generic]] = {"float": np.float32, "int": np.int32, "uint": np.uint32, "uchar": np.uint8}
_INT2 = struct.Struct("=ii").pack


class Arguments:
    """Conversion of values by name to a kernel's arguments.

    Args:
        signature: what it takes.
        structs: those that it was built with.

    Attributes:
        types: what PyOpenCL is told of each argument, so that it need not try (11 us each): None
            for memory, numpy's type for numbers, bytes for the rest.

    Raises:
        KernelSourceError: a parameter of a type that the host can't pass.
    """

    def __init__(self, signature: Signature, structs: Sequence[Struct]) -> None:
        self._kernel = signature.kernel
        self._absent = signature.absent
        self._parameters = {parameter.name: parameter for parameter in signature.parameters}
        self._structs = {struct.name: struct for struct in structs}
        self.takes_size = "size" in self._parameters
        made = {name: self._made(parameter) for name, parameter in self._parameters.items()}
        self._converts = [(name, convert) for name, (convert, _, _) in made.items()]
        self._expected = {name: f"{text} ({self._parameters[name].declaration})" for name, (_, _, text) in made.items()}
        self.types = [kind for _, kind, _ in made.values()]

    def converted(self, given: Mapping[str, Any]) -> list[Any]:
        """Return the arguments in the kernel's order.

        None stands for a parameter that the kernel has with other macros alone.

        Raises:
            TypeError: one is missing, unknown or of another type; the message names the kernel,
                the parameter, what was given and what is expected.
        """
        if len(given) != len(self._converts):
            given = {name: value for name, value in given.items() if value is not None or name not in self._absent}
            self._check_names(given)
        try:
            return [convert(given[name]) for name, convert in self._converts]
        except KeyError:
            self._check_names(given)
            raise
        except _OtherType:
            self._check_types(given)
            raise

    def _check_names(self, given: Mapping[str, Any]) -> None:
        for name in given:
            if name not in self._parameters:
                why = "a parameter with other macros alone" if name in self._absent else "not a parameter"
                raise TypeError(
                    f"kernel {self._kernel}: {name} ({_shown(given[name])}) is {why}: expected "
                    f"{', '.join(self._parameters)}"
                )
        for name, expected in self._expected.items():
            if name not in given:
                raise TypeError(f"kernel {self._kernel}: {name} is missing: expected {expected}")

    def _check_types(self, given: Mapping[str, Any]) -> None:
        for name, convert in self._converts:
            try:
                convert(given[name])
            except _OtherType:
                expected = self._expected[name]
                raise TypeError(
                    f"kernel {self._kernel}: {name} is {_shown(given[name])}: expected {expected}"
                ) from None

    def _made(self, parameter: Parameter) -> tuple[Convert, np.dtype[Any] | None, str]:
        """Return the conversion of a parameter, the type of `types`, and what it expects, for messages."""
        kind = parameter.type
        if kind == PLANE:
            return _read_plane, None, "a Plane"
        if parameter.memory:
            dtype = _element(kind)
            if dtype is not None:
                plane = "a Plane or " if dtype == np.float32 else ""
                text = f"{plane}a DeviceArray of {dtype}" + (" or None" if parameter.optional else "")
                return _memory(dtype, parameter.written, parameter.optional), None, text
        elif kind in _VALUES:
            return _VALUES[kind]
        elif kind in self._structs:
            struct = self._structs[kind]
            size = struct.dtype.itemsize
            return _struct(struct), np.dtype(f"V{size}"), f"the struct {struct.name} of {size} bytes"
        raise KernelSourceError(
            f"kernel {self._kernel}: {parameter.declaration} is of a type that the host can't "
            f"pass: expected {PLANE}, __global memory, int, float, int2 or a struct of "
            f"{sorted(self._structs)}"
        )


def _element(kind: str) -> np.dtype[Any] | None:
    """Return the numpy type of the numbers that memory of an OpenCL type holds."""
    found = _ELEMENTS.get(kind.rstrip("0123456789"))
    return None if found is None else np.dtype(found)


def _shown(value: Any) -> str:
    """Return a description of a value, for messages."""
    if isinstance(value, Plane):
        return f"a Plane of {value.count} x {value.size}"
    if isinstance(value, DeviceArray):
        return f"a DeviceArray of {value.dtype}"
    if isinstance(value, np.ndarray):
        name = (value.dtype.metadata or {}).get("struct")
        if name:
            return f"the struct {name} of {value.dtype.itemsize} bytes"
        return f"an array of {value.dtype} {value.shape}"
    return f"{value!r} ({type(value).__name__})"


def _read_plane(value: Any) -> Any:
    if isinstance(value, Plane):
        return value.argument()
    raise _OtherType


def _memory(dtype: np.dtype[Any], written: bool, optional: bool) -> Convert:
    is_float = dtype == np.float32

    def convert(value: Any) -> Any:
        if is_float and isinstance(value, Plane):
            if written:
                value.written()
            return value.buffer
        if isinstance(value, DeviceArray) and value.dtype == dtype:
            return value.buffer
        if value is None and optional:
            return None
        raise _OtherType

    return convert


def _int2(value: Any) -> Any:
    try:
        rows, columns = value
        return _INT2(columns, rows)
    except (TypeError, ValueError, struct.error):
        raise _OtherType from None


def _int(value: Any) -> Any:
    if (type(value) is int or isinstance(value, np.integer)) and -(2**31) <= value < 2**31:
        return value
    raise _OtherType


def _float(value: Any) -> Any:
    if type(value) in (float, int) or isinstance(value, np.floating | np.integer):
        return value
    raise _OtherType


_VALUES: dict[str, tuple[Convert, np.dtype[Any], str]] = {
    "int2": (_int2, np.dtype("V8"), "(rows, columns) as a tuple of int"),
    "int": (_int, np.dtype(np.int32), "an int in int32"),
    "float": (_float, np.dtype(np.float32), "a number"),
}


def _struct(struct: Struct) -> Convert:
    dtype = struct.dtype

    def convert(value: Any) -> Any:
        if (
            isinstance(value, np.ndarray)
            and value.ndim == 0
            and (value.dtype is dtype or (value.dtype == dtype and value.dtype.metadata == dtype.metadata))
        ):
            return value
        raise _OtherType

    return convert
