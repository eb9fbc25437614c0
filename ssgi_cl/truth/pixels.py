"""Some pixels that stand for all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import r_points

Pixels = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Rows and columns, each [count]."""


def spread_pixels(seen: NDArray[np.bool_], count: int) -> Pixels:
    """Return `count` pixels of a mask, evenly spread; all of them if it has fewer."""
    total = int(np.count_nonzero(seen))
    if total <= count:
        rows, columns = np.nonzero(seen)
        return rows, columns
    # Points of the whole image until enough of them have fallen on different pixels of the mask.
    points = 2 * count * seen.size // total
    while True:
        place = (r_points(0, points, 2) * seen.shape).astype(np.intp)
        number = place[:, 0] * seen.shape[1] + place[:, 1]
        _, first = np.unique(number, return_index=True)
        number = number[np.sort(first)]
        number = number[seen.ravel()[number]]
        if len(number) >= count:
            return np.divmod(np.sort(number[:count]), seen.shape[1])
        points *= 2
