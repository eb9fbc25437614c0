"""Kernels made of one expression: the functions of kernels/common, tested one by one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct

_SCALARS = {"f": "float", "i": "int"}


def run_expressions(
    runtime: Runtime,
    include: str,
    expressions: Mapping[str, str],
    *,
    returns: str = "vfloat",
    macros: Mapping[str, int] | None = None,
    values: Mapping[str, tuple[Struct, Any]] | None = None,
    tables: Mapping[str, NDArray[Any]] | None = None,
    planes: Mapping[str, Plane] | None = None,
    **lanes: ArrayLike,
) -> dict[str, NDArray[Any]]:
    """Return what each expression in OpenCL C gives, element by element, from one kernel.

    Args:
        include: the file of kernels/ that has the functions.
        expressions: name -> expression of type `returns`, "vfloat" or "vint". Beside the arguments
            below it may use `first`, the index of its first element.
        macros: name -> what the host defines.
        values: name -> structs passed by value.
        tables: name -> memory of float32 or int32 numbers.
        planes: name -> planes of one size, which the expression knows as `size`.
        **lanes: name -> float32 or int32 numbers, all lists of one length; each expression sees as
            many at once as the build has lanes.
    """
    inputs = {name: np.asarray(numbers) for name, numbers in lanes.items()}
    count = max(numbers.size for numbers in inputs.values())
    whole = -(-count // 16) * 16
    tables, planes, values = tables or {}, planes or {}, values or {}
    kind = {"vfloat": "float", "vint": "int"}[returns]

    memory = {**tables, **{f"all_{name}": np.pad(own, (0, whole - count), "edge") for name, own in inputs.items()}}
    arguments = [f"ssgi_plane {name}" for name in planes]
    arguments += [f"__global const {_SCALARS[own.dtype.kind]} *restrict {name}" for name, own in memory.items()]
    # Not in the text, so that a program is built once for lists of any length.
    arguments += [f"__global {kind} *restrict result", "const int2 size", "const int whole"]
    arguments += [f"const {struct.name} {name}" for name, (struct, _) in values.items()]
    body = ["const int first = (int)get_global_id(0) * SSGI_LANES;"]
    for name, numbers in inputs.items():
        vector, load = {"f": ("vfloat", "v_load"), "i": ("vint", "v_iload")}[numbers.dtype.kind]
        body.append(f"const {vector} {name} = {load}(all_{name} + first);")
    store = {"vfloat": "v_store", "vint": "v_istore"}[returns]
    body += [
        f"{store}({expression}, result + {index} * whole + first);"
        for index, expression in enumerate(expressions.values())
    ]
    text = "\n    ".join([f'#include "{include}"\n__kernel void expression({", ".join(arguments)})\n{{', *body])
    kernel = runtime.kernel_from_text(
        "expression", text + "\n}\n", macros, structs=[struct for struct, _ in values.values()]
    )
    result = runtime.empty(whole * len(expressions), np.float32 if kind == "float" else np.int32)
    size = next(iter(planes.values())).size if planes else (1, whole)
    kernel.run(
        size,
        grid=(1, whole // runtime.variant.lanes),
        local=(1, 1),
        result=result,
        whole=whole,
        **planes,
        **{name: runtime.array(own) for name, own in memory.items()},
        **{name: value for name, (_, value) in values.items()},
    )
    rows = result.download().reshape(len(expressions), whole)[:, :count]
    return dict(zip(expressions, rows, strict=True))
