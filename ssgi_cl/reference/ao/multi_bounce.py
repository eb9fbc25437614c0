"""Multiple bounces of ambient light in float64, as defined in `techniques.ao.multi_bounce`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.reference.gbuffer import Doubles


def multi_bounce_reference(ao: ArrayLike, albedo: ArrayLike) -> Doubles:
    """Return max(A, a A^3 + b A^2 + c A) [rows, columns, 3], at most 1."""
    v = np.asarray(ao, np.float64)[..., None]
    rho = np.asarray(albedo, np.float64)
    a = 2.0404 * rho - 0.3324
    b = -4.7951 * rho + 0.6417
    c = 2.7552 * rho + 0.6903
    brightened: Doubles = np.minimum(np.maximum(v, a * v**3 + b * v**2 + c * v), 1.0)
    return brightened
