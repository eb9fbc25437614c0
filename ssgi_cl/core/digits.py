"""Numbers as text: places far from the origin, with the digits that tell them apart."""

from __future__ import annotations

import math
from collections.abc import Iterable

LEAST, MOST = 4, 17
"""Significant digits: of what is near the origin, and of any float64."""


def place_text(place: Iterable[float], extent: float, between: str = " ") -> str:
    """Return coordinates as text, each to within some 1e-4 of `extent`, the size of what is spoken of, or to
    four digits. What is below a millionth of it is 0.

    Scenes in the metres of a map lie at 5e6 with an extent of 100: four digits would not tell their corners apart.
    """
    numbers = [float(value) if abs(value) > 1e-6 * extent else 0.0 for value in place]
    most = max(map(abs, numbers), default=0.0)
    apart = most / extent if extent > 0.0 else 1.0
    digits = LEAST + (math.ceil(math.log10(apart)) if apart > 1.0 else 0)
    return between.join(f"{number:.{min(digits, MOST)}g}" for number in numbers)
