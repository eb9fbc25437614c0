"""Every technique, as `ssgi_cl.bench.every` has them; what the host writes to buffers, kernels write here.

oclgrind 21.10 forgets what it knows of a buffer where the host writes to it: it then knows as many bytes from
the buffer's start on as that write has, and after a fill those of one element. So it complains of memory that
was filled whole, and of kernels' results beside what the host wrote. Kernels' writes it follows exactly.
`test_memory.py` shows both. Of a buffer that is made when another is gone it believes what it knew of the other:
all are kept.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache, wraps
from math import prod
from typing import Any

import numpy as np

from ssgi_cl.bench.every import everything, opened
from ssgi_cl.device.opencl import opencl

WORD = 4
"""Bytes: all that the library writes has a multiple of them."""
FILL, COPY = "host_fill", "host_copy"
"""Names of the kernels. A copy is no use of what is copied: where that is uninitialised, so is the copy."""
_TEXT = f"""
__kernel void {FILL}(__global uint *to, const ulong first, const uint value)
{{
    to[first + get_global_id(0)] = value;
}}
__kernel void {COPY}(__global uint *to, __global const uint *from, const ulong to_first, const ulong from_first,
                     const ulong to_pitch, const ulong from_pitch)
{{
    const size_t column = get_global_id(0), row = get_global_id(1);
    to[to_first + row * to_pitch + column] = from[from_first + row * from_pitch + column];
}}
"""


@cache
def _kernel(context: Any, name: str) -> Any:
    cl = opencl()
    return cl.Kernel(cl.Program(context, _TEXT).build(), name)


def _words(count: int) -> np.uint64:
    words, rest = divmod(count, WORD)
    assert rest == 0, f"{count} bytes"
    return np.uint64(words)


def fill(queue: Any, buffer: Any, pattern: Any, offset: int, size: int) -> Any:
    """As `enqueue_fill_buffer`."""
    kernel, value = _kernel(queue.context, FILL), np.array(pattern)
    assert value.nbytes == WORD
    kernel.set_args(buffer, _words(offset), value.view(np.uint32).reshape(())[()])
    return opencl().enqueue_nd_range_kernel(queue, kernel, (int(_words(size)),), None)


def copy_from(real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function like `enqueue_copy`: `real`, or a kernel where a buffer is written."""

    @wraps(real)
    def copy(queue: Any, target: Any, source: Any, **places: Any) -> Any:
        cl = opencl()
        if isinstance(target, np.ndarray):
            return real(queue, target, source, **places)
        if isinstance(source, np.ndarray):
            values = np.ascontiguousarray(source)
            places["byte_count"] = values.nbytes
            flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
            source = cl.Buffer(queue.context, flags, hostbuf=values)
        return _copied(queue, target, source, **places)

    return copy


def _copied(
    queue: Any,
    target: Any,
    source: Any,
    *,
    byte_count: int | None = None,
    src_offset: int = 0,
    dst_offset: int = 0,
    src_origin: Sequence[int] = (0, 0),
    dst_origin: Sequence[int] = (0, 0),
    src_pitches: Sequence[int] = (0,),
    dst_pitches: Sequence[int] = (0,),
    region: Sequence[int] | None = None,
    is_blocking: bool = True,
) -> Any:
    """Copy a row, or with a region a rectangle; the device runs what is queued in order, at once or not."""
    del is_blocking
    size = (min(source.size, target.size) if byte_count is None else byte_count, 1) if region is None else region
    kernel = _kernel(queue.context, COPY)
    kernel.set_args(
        target,
        source,
        _words(dst_offset + dst_origin[0] + dst_origin[1] * dst_pitches[0]),
        _words(src_offset + src_origin[0] + src_origin[1] * src_pitches[0]),
        _words(dst_pitches[0]),
        _words(src_pitches[0]),
    )
    work = (int(_words(size[0])), size[1])
    assert prod(work) > 0
    return opencl().enqueue_nd_range_kernel(queue, kernel, work, None)


def by_kernels() -> None:
    """Have kernels do what the host writes to buffers from now on, and keep all buffers."""
    cl = opencl()
    buffer, kept = cl.Buffer, []

    def keeping(*arguments: Any, **more: Any) -> Any:
        kept.append(buffer(*arguments, **more))
        return kept[-1]

    cl.enqueue_fill_buffer, cl.enqueue_copy, cl.Buffer = fill, copy_from(cl.enqueue_copy), keeping


def main(lanes: int, storage: str) -> None:
    by_kernels()
    runtime = opened(lanes, storage)
    runtime.shares_memory = False  # what is written to mapped memory passes by all functions
    everything(runtime)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
