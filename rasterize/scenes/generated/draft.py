"""What a kind of scene makes of a seed, before views are chosen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ssgi_cl.core.lights import Light

from .chance import Chance
from .model import Model
from .views import Candidate


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A scene before its views are chosen.

    Attributes:
        model: what it consists of.
        candidates: possible views, the preferred ones first.
        lights: what lights it, in W and metres.
        ao_radius: reach of ambient occlusion, metres.
        yfov: vertical field of view, radians.
        clearance: least distance from a camera to any surface, metres.
        coverage: least share of the picture in which a surface is seen.
    """

    model: Model
    candidates: Iterable[Candidate]
    lights: tuple[Light, ...]
    ao_radius: float
    yfov: float = 0.95
    clearance: float = 0.3
    coverage: float = 0.97


class Ground:
    """Rectangles of a floor plan that are taken."""

    def __init__(self) -> None:
        self._taken: list[tuple[float, float, float, float]] = []

    def take(self, x: float, z: float, wide: float, deep: float, gap: float = 0.05) -> bool:
        """Take the rectangle round (x, z) unless something of it is taken already."""
        low_x, high_x = x - 0.5 * wide - gap, x + 0.5 * wide + gap
        low_z, high_z = z - 0.5 * deep - gap, z + 0.5 * deep + gap
        for a, b, c, d in self._taken:
            if low_x < b and a < high_x and low_z < d and c < high_z:
                return False
        self._taken.append((low_x, high_x, low_z, high_z))
        return True

    def find(
        self, chance: Chance, bounds: tuple[float, float, float, float], wide: float, deep: float, tries: int = 12
    ) -> tuple[float, float] | None:
        """Take a free rectangle within bounds (x0, x1, z0, z1); return its middle, or None."""
        x0, x1, z0, z1 = bounds
        for _ in range(tries):
            u, v = chance.uniforms(0.0, 1.0, 2)
            x = x0 + 0.5 * wide + u * (x1 - x0 - wide)
            z = z0 + 0.5 * deep + v * (z1 - z0 - deep)
            if self.take(float(x), float(z), wide, deep):
                return float(x), float(z)
        return None
