"""A generated scene before its views are chosen, and the parts of it that kinds share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight

from .chance import Chance
from .model import Model
from .views import Candidate


@dataclass(frozen=True)
class Draft:
    """A scene before its views are chosen.

    Attributes:
        model: its parts.
        candidates: possible views, the preferred ones first.
        lights: in W and metres.
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

    def places(
        self, chance: Chance, bounds: tuple[float, float, float, float], wide: float, deep: float, count: int = 1
    ) -> Iterator[tuple[float, float]]:
        """Take up to `count` free rectangles within bounds (x0, x1, z0, z1); yield their middles (x, z).

        Each is looked for at 12 places.
        """
        x0, x1, z0, z1 = bounds
        for _ in range(count):
            for _ in range(12):
                u, v = chance.uniforms(0.0, 1.0, 2)
                x = float(x0 + 0.5 * wide + u * (x1 - x0 - wide))
                z = float(z0 + 0.5 * deep + v * (z1 - z0 - deep))
                if self.take(x, z, wide, deep):
                    yield x, z
                    break


def directions(chance: Chance, count: int, most: float = 6.28) -> Iterator[tuple[int, float, float]]:
    """Yield number, cosine and sine of directions that differ from each other by the golden angle.

    The first lies at an angle from 0 to `most`.
    """
    start = chance.uniform(0.0, most)
    for i in range(count):
        yield i, float(np.cos(start + 2.4 * i)), float(np.sin(start + 2.4 * i))


def inside_views(
    chance: Chance,
    wide: float,
    deep: float,
    count: int,
    *,
    far: tuple[float, float],
    eye: tuple[float, float],
    target: tuple[float, float],
    spread: float,
) -> Iterator[Candidate]:
    """Yield views of a room of `wide` x `deep` metres from near its corners and from its middle.

    Args:
        chance: of the scene.
        wide, deep: metres.
        count: of views.
        far: distance of the eye from the middle as a share of the room: of two views in three, and of every third.
        eye, target: least and greatest height, metres.
        spread: of the target to either side, metres.
    """
    for i, cosine, sine in directions(chance, count, 2.0 * np.pi):
        share = far[0] if i % 3 else far[1]
        x, z = share * wide * cosine, share * deep * sine
        height = chance.uniform(*eye)
        aim_x = -0.4 * x + chance.uniform(-spread, spread)
        aim_y = chance.uniform(*target)
        yield Candidate((x, height, z), (aim_x, aim_y, -0.4 * z + chance.uniform(-spread, spread)))


def indoor_lights(chance: Chance, slant: float, lamp: PointLight) -> tuple[Light, ...]:
    """Return sun and bright sky, or a lamp and dim sky; the sun's z varies by `slant` to either side."""
    if not chance.yes(0.6):
        return lamp, Environment((0.35, 0.38, 0.42))
    sun = DirectionalLight((-0.8, -0.55, chance.uniform(-slant, slant)), (14.0, 12.5, 10.0))
    return sun, Environment((0.9, 0.95, 1.05))
