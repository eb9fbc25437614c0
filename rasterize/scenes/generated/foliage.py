"""A garden or a wood: trees, bushes, ferns, grass, stones, a fence; leaves are open sheets."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment

from ..scatter import Doubles, noise
from . import plants, solids
from .chance import Chance
from .draft import Draft, Ground, directions
from .model import IRON, SOIL, STONE, WOOD, Model
from .views import Candidate

_HALF = 5.0


def foliage(chance: Chance) -> Draft:
    """Make a piece of a garden, 10 m square and surrounded by hedges and trees."""
    model, ground = Model(), Ground()
    seed = chance.whole(0, 10**6)
    rough = chance.uniform(0.15, 0.6)
    bend = chance.uniform(-1.2, 1.2)

    def height(x: Doubles, z: Doubles) -> Doubles:
        y = rough * (noise(seed, 0.4 * x + 20.0, 0.4 * z + 20.0) - 0.5)
        y += 0.12 * (noise(seed + 1, 1.3 * x + 30.0, 1.3 * z + 30.0) - 0.5)
        away = np.maximum(np.hypot(x, z) - _HALF, 0.0)
        path = np.exp(-(((x - bend * np.sin(0.6 * z)) / 0.6) ** 2))
        result: Doubles = y - 0.12 * path + 0.06 * away**1.5
        return result

    side = np.linspace(-2.4 * _HALF, 2.4 * _HALF, 97)
    model.add(solids.height_field(side, height), SOIL, closed=False)
    bounds = (-_HALF, _HALF, -_HALF, _HALF)
    for x, z in ground.places(chance, bounds, 1.5, 1.5, chance.whole(2, 5)):
        with model.at(solids.on_ground(height, x, z)):
            plants.tree(model, chance, chance.uniform(2.5, 5.0), chance.whole(900, 1600))
    for kind, most, size in (("bush", 7, 1.0), ("fern", 12, 0.8), ("rock", 9, 0.7)):
        for x, z in ground.places(chance, bounds, size, size, chance.whole(most // 3, most)):
            with model.at(solids.on_ground(height, x, z), chance.uniform(0, 6.28)):
                if kind == "bush":
                    plants.bush(model, chance, chance.uniform(0.35, 0.8), chance.whole(250, 600))
                elif kind == "fern":
                    plants.fern(model, chance, chance.uniform(0.4, 0.9))
                else:
                    _stone(model, chance)
    for angle in np.arange(14) * (2.0 * np.pi / 14):
        far = _HALF * chance.uniform(1.2, 1.5)
        with model.at(solids.on_ground(height, far * np.cos(angle), far * np.sin(angle))):
            plants.bush(model, chance, chance.uniform(0.9, 1.7), 380)
    for _ in range(chance.whole(6, 14)):  # tufts
        x, z = chance.uniforms(-_HALF, _HALF, 2)
        count = chance.whole(60, 160)
        spots = np.array((x, z)) + chance.uniforms(-0.5, 0.5, count, 2)
        plants.grass(model, chance, solids.all_on_ground(height, spots, -0.01), chance.uniform(0.2, 0.7))
    if chance.yes(0.6):
        _fence(model, chance, height)
    if chance.yes(0.5):
        x, z = chance.uniforms(-3.0, 3.0, 2)
        with model.at(solids.on_ground(height, x, z), chance.uniform(0, 3.1)):
            radius = chance.uniform(0.12, 0.25)
            model.bar((-1.1, 0.8 * radius, 0), (1.1, 0.8 * radius, 0.2), radius, WOOD, sides=16)
            model.bar((0.3, radius, 0), (0.8, 2.6 * radius, 0.4), 0.25 * radius, WOOD)
    low = -chance.uniform(0.45, 0.9)
    sun = DirectionalLight((chance.uniform(-0.8, 0.8), low, -0.5), (16.0, 14.5, 11.5))
    views, lights = _candidates(chance, height), (sun, Environment((0.8, 1.0, 1.25)))
    return Draft(model, views, lights, ao_radius=chance.pick((0.3, 0.5, 0.8)), yfov=0.9, coverage=0.6)


def _stone(model: Model, chance: Chance) -> None:
    size = chance.uniform(0.12, 0.45)
    rock = solids.rock(chance.whole(0, 10**6), 18)
    tint = chance.uniform(0.7, 1.1)
    scale = (size, size * chance.uniform(0.5, 0.9), size * chance.uniform(0.7, 1.2))
    model.add(rock, STONE, (0, 0.35 * size, 0), tint=tint, scale=scale)


def _fence(model: Model, chance: Chance, height: solids.Height) -> None:
    """Add a fence of posts and wires, or of pickets, across the garden."""
    z, high = chance.uniform(-3.5, -1.0), chance.uniform(0.8, 1.2)
    wired = chance.yes(0.5)
    xs = np.arange(-_HALF, _HALF + 0.1, 1.25 if wired else 0.16)
    feet = np.stack([xs, height(xs, np.full_like(xs, z)), np.full_like(xs, z)], axis=1)
    if wired:
        for foot in feet:
            model.bar(foot - [0, 0.2, 0], foot + np.array((0, high, 0)), 0.035, WOOD)
        for share in (0.25, 0.5, 0.75, 0.95):
            model.rope(feet + np.array((0, share * high, 0.036)), 0.0025, IRON)
        return
    for foot in feet:
        place = foot + np.array((0, 0.5 * high, 0))
        model.put("box", place, (0.07, high, 0.02), WOOD, tint=chance.uniform(0.8, 1.2))
    for share in (0.2, 0.8):
        for start, end in zip(feet[:-1:4], feet[4::4], strict=False):
            up = np.array((0, share * high, -0.03))
            model.bar(start + up, end + up, 0.02, WOOD)


def _candidates(chance: Chance, height: solids.Height) -> list[Candidate]:
    """Return views at the height of eyes and near the ground."""
    views = []
    for i, cosine, sine in directions(chance, 60):
        far = _HALF * chance.uniform(0.35, 0.95)
        up = chance.uniform(0.5, 1.0) if i % 3 == 2 else chance.uniform(1.3, 2.0)
        x, y, z = solids.on_ground(height, far * cosine, far * sine)
        views.append(Candidate((x, y + up, z), (-0.3 * x, chance.uniform(0.1, 0.6), -0.3 * z)))
    return views
