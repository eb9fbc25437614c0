"""Cloth and iron for the built-in scenes; all of material 0."""

from __future__ import annotations

import numpy as np

from ..parts import Part, complete
from .shapes import grid, joined, lathe, moved, tube


def banner(width: float, height: float, phase: float) -> Part:
    """Return a banner in the plane z = 0 that hangs from y = 0 and faces +z and -z."""
    u = np.linspace(-0.5, 0.5, 29)[None, :]
    v = np.linspace(-1.0, 0.0, 25)[:, None]
    fall = -v
    folds = 0.055 * (0.35 + fall) * np.sin(4.5 * np.pi * u + phase + 1.2 * fall)
    sway = 0.10 * fall**2 * np.sin(phase)
    swallowtail = 0.12 * height * fall**6 * (1.0 - 2.0 * np.abs(u))
    front = np.stack([width * u * (1.0 - 0.06 * fall), height * v + swallowtail, folds + sway], axis=-1)
    # Two sheets 6 mm apart: each is seen from its own side only.
    back = front - [0.0, 0.0, 0.006]
    return joined([grid(front), grid(back[:, ::-1])])


def railing(x: float, floor: float, height: float, start: float, end: float) -> Part:
    """Return an iron railing along z: bars of 16 mm every 14 cm between two rails."""
    radius = 0.008
    count = round((end - start) / 0.14)
    places = start + (np.arange(count) + 0.5) * (end - start) / count
    profile = [(radius, 0.06), (radius, 0.42), (0.022, 0.46), (radius, 0.5), (radius, height)]
    bar = complete(lathe(profile, 8))
    bars = [moved(bar, x, floor, z) for z in places]
    rails = [
        tube(np.array([(x, floor + y, start), (x, floor + y, end)]), (1.0, 0.0, 0.0), radius, 12)
        for y, radius in ((0.06, 0.014), (height, 0.03))
    ]
    return joined([*bars, *rails])
