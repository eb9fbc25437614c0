"""Places within a pixel, spread evenly over it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def pixel_places(count: int) -> NDArray[np.float64]:
    """Return `count` places within a pixel, [count, 2] (right, down) in (0, 1); one of an odd number is the centre.

    They are the rank-1 lattice of (1, g) / n whose least distance, pixels next to each other included, is greatest
    (Dammertz et al. 2008, "Image Synthesis by Rank-1 Lattices"): no two are in one row or column, so that upright
    and level edges take as many steps as there are places. Those of 5 are a grid turned by 27 degrees.
    """
    numbers = np.arange(count)
    found, most = numbers, -1
    for step in range(1, max(count, 2)):
        if np.gcd(step, count) != 1:
            continue
        across, down = numbers[1:], step * numbers[1:] % count
        apart = np.minimum(across, count - across) ** 2 + np.minimum(down, count - down) ** 2
        if int(apart.min(initial=count)) > most:
            found = (step * (numbers - count // 2) + count // 2) % count
            most = int(apart.min(initial=count))
    return (np.stack([numbers, found], axis=1) + 0.5) / count
