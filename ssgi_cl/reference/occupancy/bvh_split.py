"""Nodes of a hierarchy of boxes, split one after the other, in float32 as kernels/rays/bvh_split.cl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

LEAF, BINS, DEEPEST = 4, 16, 39
"""Boxes of a leaf at most; bins that boxes are sorted into; levels that are split where it promises the least work."""


def bvh_split(boxes: Floats) -> tuple[Floats, Ints, Ints]:
    """Return the nodes of the hierarchy of boxes [boxes, 8], see `ssgi_cl.core.bvh.Halves`."""
    nodes, all_lefts = np.zeros((len(boxes), 2, 8), np.float32), np.zeros((len(boxes), 2), np.int32)
    order = np.arange(len(boxes), dtype=np.int32)
    waiting = [(0, len(boxes), 0, 0)]
    while waiting:
        first, count, depth, lefts = waiting.pop()
        own = order[first : first + count]
        left = 0
        if count > LEAF:
            left = _sorted(boxes, own) if depth < DEEPEST else count // 2
            waiting.append((first, left, depth + 1, lefts + 1))
            waiting.append((first + left, count - left, depth + 1, lefts))
        place = first + left, int(count <= LEAF)
        nodes[place] = boxes[own].max(axis=0)
        nodes.view(np.int32)[place][3], nodes.view(np.int32)[place][7] = first, count
        all_lefts[place] = lefts + 1
    return nodes, all_lefts, order


def _sorted(boxes: Floats, own: Ints) -> int:
    """Sort boxes by their bins and return how many the first half has."""
    all_ = boxes[own]
    middle = np.float32(0.5) * (all_[:, 4:7] - all_[:, 0:3])
    apart = np.ptp(middle, axis=0)
    axis = int(apart.argmax())
    along = (middle[:, axis] - middle[:, axis].min()) / max(apart[axis], np.float32(1e-30))
    bins = np.clip((along * np.float32(BINS)).astype(np.int64), 0, BINS - 1)
    order = np.argsort(bins, kind="stable")
    own[:] = own[order]
    best, least = len(own) // 2, np.float32(np.inf)
    for bin_ in range(1, BINS):
        left = int((bins < bin_).sum())
        if 0 < left < len(own):
            halves = all_[bins < bin_], all_[bins >= bin_]
            with np.errstate(over="ignore"):  # then no split promises anything
                work = sum((np.float32(len(half)) * _area(half.max(axis=0)) for half in halves), np.float32(0.0))
            if work < least:
                best, least = left, work
    return best


def _area(box: Floats) -> np.float32:
    """Return half the surface of a box."""
    x, y, z = box[4:7] + box[0:3]
    with np.errstate(over="ignore"):
        return np.float32(x * y + y * z + z * x)
