"""Nodes of hierarchies split on the device."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.bvh import NODE, Floats, Halves, Ints
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import SSGI_GROUP
from ssgi_cl.device.runtime import Runtime

WHOLE = 1024
"""Boxes that a work-group splits down to leaves. Nodes of more are split level by level, a work-group each."""


def bvh_split(runtime: Runtime, boxes: Floats) -> Halves:
    """Return the nodes of the hierarchy of boxes, see kernels/rays/bvh_split.cl."""
    count = len(boxes)
    kernel = runtime.kernel("rays/bvh_split.cl")
    even, odd = runtime.array(boxes.ravel()), runtime.empty(NODE * count, np.float32)
    nodes = runtime.empty(2 * NODE * count, np.float32)
    lefts = runtime.array(np.zeros(2 * count, np.int32))
    order = runtime.empty(count, np.int32)
    group = SSGI_GROUP if kernel.lanes == 1 else 1

    def run(open_: Ints, halves: DeviceArray, once: bool) -> None:
        kernel.run(
            (1, len(open_)), grid=(1, group * len(open_)), local=(1, group), open=runtime.array(open_),
            even=even, odd=odd, halves=halves, nodes=nodes, lefts=lefts, order=order, once=int(once),
        )  # fmt: skip

    ready: list[Ints] = []
    open_ = np.array([[0, count, 0, 0]], np.int32)
    while True:
        large = open_[:, 1] > WHOLE
        ready.append(open_[~large])
        if not large.any():
            break
        halves = runtime.empty(8 * int(np.count_nonzero(large)), np.int32)
        run(open_[large], halves, once=True)
        open_ = halves.download().reshape(-1, 4)
    run(np.concatenate(ready), runtime.empty(1, np.int32), once=False)
    return Halves(nodes.download().reshape(-1, 2, NODE), lefts.download().reshape(-1, 2), order.download())
