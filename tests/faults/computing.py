"""Compute ambient occlusion of a step and print a digest; a script for tests that need a process.

With an argument, print it and go on for ever, so that it can be killed at any point: "compute"
builds kernel after kernel, "write" replaces one PNG and one OpenEXR file in this folder.
"""

from __future__ import annotations

import hashlib
import itertools
import sys

import numpy as np

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr, png

ADD = """#include "common/gbuffer.clh"
__kernel void add(ssgi_plane depth, __global float *restrict sum, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    ssgi_store(ssgi_load(depth, size, 0, x, y) + (float)TERM, sum, size, 0, x, y, 0.0f);
}
"""


def digest(runtime: Runtime) -> str:
    """Return a digest of A of two walls at different depths."""
    depth = np.full((24, 32), 2.0, np.float32)
    depth[:, 16:] = 2.3
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), width=32, height=24)
    a = gi.ssao(gi.GBuffer(camera=camera, depth=depth), runtime=runtime, radius=0.5)
    return hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest()


def added(runtime: Runtime, term: int) -> float:
    """Return 1 + term, by a kernel that is compiled for it."""
    depth, total = runtime.plane(1, (4, 4)), runtime.plane(1, (4, 4))
    depth.upload(np.ones((1, 4, 4), np.float32))
    runtime.kernel_from_text("add", ADD, {"TERM": term}).run((4, 4), depth=depth, sum=total)
    return float(total.download()[0, 0, 0])


def main() -> None:
    """Do what the arguments say."""
    if sys.argv[1:2] == ["write"]:
        for value in itertools.cycle(range(256)):
            if value == 1:
                print("write", flush=True)
            png.write("a.png", np.full((400, 600, 3), value, np.uint8))
            exr.write("a.exr", {"depth": np.full((400, 600), value, np.float32)})
    runtime = Runtime.open()
    if sys.argv[1:2] == ["compute"]:
        print("compute", flush=True)
        for term in range(10**6):
            added(runtime, term)
    total = added(runtime, 7)
    print(digest(runtime), total)


if __name__ == "__main__":
    main()
