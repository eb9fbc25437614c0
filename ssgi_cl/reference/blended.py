"""Layers that are seen through in float64, as defined in kernels/blended/blended.cl."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]


def blended_reference(layers: Sequence[tuple[Doubles, Doubles, Doubles]], behind: Doubles) -> Doubles:
    """Return the radiance [..., 3] that reaches the eye, from the back to the front.

    Args:
        layers: nearest first: radiance [..., 3], opacity [...] and what is let through [..., 3].
        behind: [..., 3] radiance behind them all.
    """
    seen = np.asarray(behind, np.float64)
    for radiance, opacity, transmitted in reversed(layers):
        seen = np.asarray(opacity)[..., None] * radiance + np.asarray(transmitted) * seen
    return seen
