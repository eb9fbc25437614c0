"""Light exchange between patches, in float64."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

MOST_ROW = 1.5
"""Factor by which a row of form factors is raised, at most."""


def form_factors(position: Doubles, normal: Doubles, area: Doubles, visible: NDArray[np.bool_]) -> Doubles:
    """Return [receivers, senders] form factors from a point to discs, 0 where not `visible`.

    A cos cos / (pi d^2 + A); Wallace et al. 1989, "A Ray Tracing Algorithm for Progressive
    Radiosity", equation 8.
    """
    way = position[None, :] - position[:, None]
    squared = np.sum(way**2, axis=-1) + 1e-24
    received = np.maximum(np.einsum("ijc,ic->ij", way, normal), 0.0)
    emitted = np.maximum(-np.einsum("ijc,jc->ij", way, normal), 0.0)
    factors: Doubles = area * received * emitted / (squared * (math.pi * squared + area))
    return np.where(visible, factors, 0.0)


def radiosity_reference(
    factors: Doubles, open_part: Doubles, albedo: Doubles, exitance: Doubles, sky: Doubles, first: Doubles, bounces: int
) -> Doubles:
    """Return irradiance [n, 3] of patches after some bounces.

    Args:
        factors: see `form_factors`.
        open_part: [n] of each hemisphere, weighted by the cosine, through which sky is visible.
        albedo, exitance: [n, 3], what is reflected, and emitted in W/m^2.
        sky: [n, 3] irradiance in W/m^2 by the environment.
        first: [n, 3] irradiance by light that has been reflected once.
        bounces: of the light that the patches send, at most; >= 1.
    """
    whole = np.maximum(factors.sum(axis=1), 1e-20)
    rows = factors * np.minimum((1.0 - open_part) / whole, MOST_ROW)[:, None]
    received, sent = np.zeros_like(albedo), exitance
    for bounce in range(bounces):
        received = rows @ sent + sky + (first if bounce else 0.0)
        sent = exitance + albedo * received
    return received
