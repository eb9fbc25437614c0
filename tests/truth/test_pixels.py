"""Pixels that stand for all of them."""

from __future__ import annotations

import numpy as np

from ssgi_cl.truth.pixels import spread_pixels


def test_pixels_are_spread_evenly_over_the_mask() -> None:
    seen = np.ones((60, 80), bool)
    seen[:, 40:] = False
    rows, columns = spread_pixels(seen, 400)
    assert len(rows) == len(set(zip(rows.tolist(), columns.tolist(), strict=True))) == 400
    assert seen[rows, columns].all()
    counts, _, _ = np.histogram2d(rows, columns, bins=(4, 4), range=((0, 60), (0, 40)))
    # 25 in each of 16 parts on average; at random they would be off by 5.
    assert np.abs(counts - 25).max() <= 5
    assert len(spread_pixels(seen, 1 << 20)[0]) == 2400
