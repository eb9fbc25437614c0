"""Crops of shadow maps in a sequence: they stay while they serve what is seen."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.techniques.direct.kept_crops import KeptCrops
from ssgi_cl.techniques.direct.seen_depths import Seen
from ssgi_cl.techniques.direct.shadow_fit import CROPS, Crop, excess, fitted

FACE = (Camera.look_at((0.0, 4.0, 0.0), (0.0, 0.0, 0.001), yfov=1.2, width=256, height=256),)


def floor_seen(left: float, width: float = 1.0) -> Seen:
    """Return what a camera right above a floor sees of it: a strip of tiles from `left` on."""
    eye = Camera.look_at((left, 2.0, 0.0), (left, 0.0, 0.001), yfov=2.0 * np.arctan(width / 4.0), width=64, height=64)
    column, row = (index.ravel() * 8.0 for index in np.indices((8, 8)))
    sides = np.stack([column, column + 8.0, row, row + 8.0], axis=1)
    return Seen(eye, sides, np.full(64, 2.0), np.full(64, 2.0))


def test_crops_stay_while_the_camera_sees_a_little_more_or_less() -> None:
    kept, found, anew = KeptCrops(), set(), set()
    for width in (0.98, 0.96, 0.98, 0.96):
        seen = floor_seen(0.0, width)
        latest = kept.fitted(0, FACE, seen, CROPS)
        found.add(latest)
        anew.add(fitted(FACE, seen, CROPS))
        # What stays shows all, with texels about as fine.
        assert excess(latest, FACE, seen) <= 1.5 * excess(fitted(FACE, seen, CROPS), FACE, seen) + 0.05 * 64 * 64
    assert len(found) == 1 < len(anew)


def test_crops_that_do_not_serve_are_fitted_anew() -> None:
    kept = KeptCrops()
    first = kept.fitted(0, FACE, floor_seen(0.0), CROPS)
    assert kept.fitted(0, FACE, floor_seen(0.0), CROPS) is first
    elsewhere = floor_seen(1.5)
    assert excess(first, FACE, elsewhere) == np.inf
    assert kept.fitted(0, FACE, elsewhere, CROPS) == fitted(FACE, elsewhere, CROPS)
    # A closer look needs finer texels.
    kept.fitted(1, FACE, floor_seen(0.0), CROPS)
    close = floor_seen(0.0, 0.05)
    assert kept.fitted(1, FACE, close, CROPS) == fitted(FACE, close, CROPS) != first
    turned = (Camera.look_at((0.0, 4.0, 0.0), (0.3, 0.0, 0.0), yfov=1.2, width=256, height=256),)
    kept.fitted(2, FACE, floor_seen(0.0), CROPS)
    assert kept.fitted(2, turned, floor_seen(0.0), CROPS) == fitted(turned, floor_seen(0.0), CROPS)


def test_excess_is_that_of_the_finest_crop_that_shows_a_tile() -> None:
    seen = floor_seen(0.0)
    coarse, fine = (Crop(0),), fitted(FACE, seen, CROPS)
    assert 0.0 <= excess(fine, FACE, seen) < excess(coarse, FACE, seen) < np.inf
    assert excess((*coarse, *fine), FACE, seen) == excess(fine, FACE, seen)
    assert excess((), FACE, seen) == np.inf
