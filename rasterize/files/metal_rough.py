"""Materials of metal and roughness, as glTF and trimesh have them, as albedo and a Phong lobe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]

DIELECTRIC = 0.04
"""Reflectance of what is no metal, seen from straight ahead."""

LEAST_GLOSS = 4.0
"""Exponent below which a lobe is so broad that the surface counts as matt."""

MOST_GLOSS = 1e6


@dataclass(frozen=True, kw_only=True)
class Lobe:
    """Reflection of a surface.

    Attributes:
        matt: what the base colour is times to be the albedo: 1 less the metal, and less what the lobe
            takes of a bright colour.
        specular: reflectance of the Phong lobe.
        gloss: its exponent.
    """

    matt: float = 1.0
    specular: Rgb = (0.0, 0.0, 0.0)
    gloss: float = 1.0


def metal_rough_lobe(base: NDArray[np.float64], metal: float, roughness: float) -> Lobe:
    """Return the lobe of metal and roughness.

    2 / a^2 - 2 is the exponent of a lobe as wide as GGX's of a = roughness^2 (Walter et al. 2007).
    Fresnel's rise towards grazing angles is left out. What is rougher than 0.76, and what says
    neither metal nor roughness, is matt: then the albedo is the base colour, metal or not.

    Args:
        base: [3] base colour, the mean of its texture.
        metal, roughness: in [0, 1], likewise.
    """
    metal = min(max(metal, 0.0), 1.0)
    reflectance = DIELECTRIC * (1.0 - metal) + metal * base
    return rough_lobe(reflectance, base * (1.0 - metal), roughness, matt=1.0 - metal)


def rough_lobe(
    reflectance: NDArray[np.float64], albedo: NDArray[np.float64], roughness: float, *, matt: float = 1.0
) -> Lobe:
    """Return a lobe of reflectance and roughness; the albedo has what it leaves, in the least channel."""
    alpha = min(max(roughness, 1e-2), 1.0) ** 2
    gloss = min(2.0 / alpha**2 - 2.0, MOST_GLOSS)
    if gloss < LEAST_GLOSS:
        return Lobe()
    specular = np.clip(reflectance, 0.0, 1.0)
    left, wanted = 1.0 - specular, np.clip(albedo, 0.0, 1.0)
    share = float(np.divide(left, wanted, where=wanted > left, out=np.ones(3)).min())
    red, green, blue = specular.tolist()
    return Lobe(matt=matt * share, specular=(red, green, blue), gloss=gloss)
