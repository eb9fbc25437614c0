"""Signature of a kernel: the names, types and order of its parameters, asked of its driver.

Drivers keep this (clGetKernelArgInfo of OpenCL 1.2) in programs built with `ARGUMENT_INFO`. Its
text adds what macros hide from the compiler: `PLANE`, `OPTIONAL` and the parameters that the kernel
has with other macros alone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from ssgi_cl.core.errors import DeviceError, KernelSourceError
from ssgi_cl.device.opencl import opencl

ARGUMENT_INFO = "-cl-kernel-arg-info"
"""The build option that makes drivers keep what `Signature.of` asks for."""

PLANE = "ssgi_plane"
"""The type of a plane that a kernel reads: an image or a buffer, see kernels/common/gbuffer.clh."""

OPTIONAL = "ssgi_optional"
"""Marks memory that may be absent, see kernels/common/gbuffer.clh."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kernel.

    Attributes:
        name: as in the kernel.
        type: "ssgi_plane", the type that a pointer points to, or that of a value: "float", "int",
            "int2" or the name of a struct.
        memory: whether it is a plane or a pointer to `__global` memory.
        written: whether the kernel writes there: a pointer without `const`.
        optional: whether the memory may be absent.
    """

    name: str
    type: str
    memory: bool = False
    written: bool = False
    optional: bool = False

    @property
    def declaration(self) -> str:
        """The parameter in OpenCL C, without `restrict`."""
        if self.type == PLANE:
            return f"{PLANE} {self.name}"
        if not self.memory:
            return f"const {self.type} {self.name}"
        kind = f"__global {self.type} *" if self.written else f"__global const {self.type} *"
        return f"{OPTIONAL} {kind}{self.name}" if self.optional else f"{kind}{self.name}"


@dataclass(frozen=True)
class Signature:
    """The parameters of a kernel as it was built.

    Attributes:
        kernel: its name.
        parameters: in order.
        absent: names of those that it has with other macros alone.
    """

    kernel: str
    parameters: tuple[Parameter, ...]
    absent: frozenset[str] = frozenset()

    @classmethod
    def of(cls, kernel: Any, text: str) -> Signature:
        """Return the signature of a kernel.

        Args:
            kernel: PyOpenCL's, of a program built with `ARGUMENT_INFO`.
            text: its flattened source, see `sources.flatten`.

        Raises:
            KernelSourceError: a parameter that is neither a plane, `__global` memory nor a value.
            DeviceError: the driver does not keep the information.
        """
        name = kernel.function_name
        written = _written(name, text)
        try:
            parameters = tuple(_parameter(kernel, number, written) for number in range(kernel.num_args))
        except opencl().Error as error:
            raise DeviceError(
                f"kernel {name}: the driver does not tell what it takes ({error}): expected a driver of "
                f"OpenCL 1.2 or later that keeps it with {ARGUMENT_INFO}"
            ) from error
        return cls(name, parameters, frozenset(written) - {p.name for p in parameters})


_COMMENT_OR_DIRECTIVE = re.compile(r"//[^\n]*|/\*.*?\*/|^[ \t]*#(?:\\\n|[^\n])*", re.DOTALL | re.MULTILINE)


def _written(kernel: str, text: str) -> dict[str, str]:
    """Return name -> declaration of the parameters that a kernel has with any macros."""
    begin = re.search(rf"\b__kernel\s+void\s+{kernel}\s*\(", text)
    if begin is None:
        raise KernelSourceError(f"the text has no kernel {kernel}")
    listed = _COMMENT_OR_DIRECTIVE.sub("", text[begin.end() : text.find("{", begin.end())])
    declarations = [part.strip() for part in listed[: listed.rindex(")")].split(",")]
    return {re.split(r"[\s*]", part)[-1]: part for part in declarations if part not in ("", "void")}


def _parameter(kernel: Any, number: int, written: dict[str, str]) -> Parameter:
    cl = opencl()
    info, spaces = cl.kernel_arg_info, cl.kernel_arg_address_qualifier
    # PoCL's own header makes names of built-in functions, such as `step`, macros.
    name = kernel.get_arg_info(number, info.NAME).removeprefix("_cl_")
    declaration = written.get(name, name)
    plane = declaration.startswith(f"{PLANE} ")
    space = kernel.get_arg_info(number, info.ADDRESS_QUALIFIER)
    kind = kernel.get_arg_info(number, info.TYPE_NAME)
    optional = declaration.startswith(f"{OPTIONAL} ")
    if plane:
        return Parameter(name, PLANE, memory=True)
    if space not in (spaces.GLOBAL, spaces.PRIVATE) or kind.startswith("image"):
        raise KernelSourceError(
            f"kernel {kernel.function_name} has the parameter {declaration!r}: expected {PLANE} NAME, "
            "__global [const] TYPE *[restrict] NAME or [const] TYPE NAME"
        )
    memory = space == spaces.GLOBAL
    if (optional and not memory) or PLANE in declaration:
        raise KernelSourceError(
            f"kernel {kernel.function_name} has the parameter {declaration!r}: only a pointer to __global "
            f"memory can be {OPTIONAL} (put a plane into #if)"
        )
    constant = kernel.get_arg_info(number, info.TYPE_QUALIFIER) & cl.kernel_arg_type_qualifier.CONST
    return Parameter(name, kind.rstrip("* "), memory, memory and not constant, optional)
