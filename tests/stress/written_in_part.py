"""A kernel that reads memory: all a kernel's, and a part the host's since then; or written by nothing."""

from __future__ import annotations

import sys

import numpy as np
from every_by_kernels import by_kernels

from ssgi_cl.device.opencl import opencl

COUNT, PART = 64, 16
TEXT = """
__kernel void put(__global float *values) { values[get_global_id(0)] = 1.0f; }
__kernel void look(__global const float *values, __global float *found)
{
    found[get_global_id(0)] = values[get_global_id(0)] > 0.5f ? 2.0f : 3.0f;
}
"""


def main(case: str, *how: str) -> None:
    if how:
        by_kernels()
    cl = opencl()
    context = cl.Context([cl.get_platforms()[0].get_devices()[0]])
    queue, program = cl.CommandQueue(context), cl.Program(context, TEXT).build()
    values, found = (cl.Buffer(context, cl.mem_flags.READ_WRITE, 4 * COUNT) for _ in range(2))
    if case != "never":
        program.put(queue, (COUNT,), None, values)
    if case == "beside a fill":
        cl.enqueue_fill_buffer(queue, values, np.float32(1.0), 0, 4 * PART)
    elif case == "beside a copy":
        cl.enqueue_copy(queue, values, np.ones(PART, np.float32), dst_offset=4 * PART)
    program.look(queue, (COUNT,), None, values, found)
    queue.finish()


if __name__ == "__main__":
    main(*sys.argv[1:])
