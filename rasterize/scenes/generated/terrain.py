"""Open country: hills or terraces with boulders, stones set upright, tufts, a wall, a hut."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment

from ..scatter import Doubles, about_x, about_y, noise, rotation
from . import plants, solids
from .chance import Chance
from .draft import Draft, directions
from .model import SOIL, STONE, WOOD, Model
from .views import Candidate

_HALF = 14.0


def terrain(chance: Chance) -> Draft:
    """Make 28 m x 28 m of open ground, an open sheet, and what stands on it."""
    model = Model()
    height = _height(chance)

    model.add(solids.height_field(np.linspace(-_HALF, _HALF, 121), height), SOIL, closed=False)
    rocks = [solids.rock(chance.whole(0, 10**6), 18, chance.uniform(0.4, 0.8)) for _ in range(4)]
    for part in rocks:
        count = chance.whole(12, 40)
        at = chance.uniforms(-0.9 * _HALF, 0.9 * _HALF, count, 2)
        size = 0.12 + 1.1 * chance.uniforms(0.0, 1.0, count) ** 5
        places, turns = solids.all_on_ground(height, at, 0.25 * size), plants.turned_anyhow(chance, count, 0.5)
        tints = np.repeat(chance.uniforms(0.7, 1.15, count, 1), 3, axis=1)
        model.scatter(part, STONE, places, turns=turns, scales=size, tints=tints)
    thing = chance.pick((_ring_of_stones, _dry_wall, _hut, _cairns))
    x, z = (float(v) for v in chance.uniforms(-2.5, 2.5, 2))
    with model.at(solids.on_ground(height, x, z), chance.uniform(0.0, 6.28)):
        thing(model, chance)
    for _ in range(chance.whole(5, 14)):
        spot = chance.uniforms(-9.0, 9.0, 2)
        if chance.yes(0.6):
            count = chance.whole(40, 120)
            spots = spot + chance.uniforms(-0.6, 0.6, count, 2)
            plants.grass(model, chance, solids.all_on_ground(height, spots, -0.01), 0.4)
        else:
            with model.at(solids.on_ground(height, *spot)):
                plants.bush(model, chance, chance.uniform(0.3, 0.9), 260)
    for _ in range(chance.whole(0, 4)):
        spot = chance.uniforms(-10.0, 10.0, 2)
        with model.at(solids.on_ground(height, *spot)):
            _bare_tree(model, chance)
    sun = DirectionalLight((chance.uniform(-0.9, 0.9), -chance.uniform(0.35, 0.8), -0.5), (17.0, 15.0, 12.0))
    views, lights = _candidates(chance, height, (x, z)), (sun, Environment((0.75, 0.95, 1.3)))
    reach, yfov = chance.pick((0.5, 1.0, 1.5)), chance.uniform(0.8, 1.0)
    return Draft(model, views, lights, ao_radius=reach, yfov=yfov, clearance=0.4, coverage=0.55)


def _height(chance: Chance) -> solids.Height:
    """Return a landscape: noise of four octaves, ridged or stepped in some."""
    seed, steep = chance.whole(0, 10**6), chance.uniform(1.0, 4.0)
    style, step = chance.whole(0, 2), chance.uniform(0.5, 1.1)

    def height(x: Doubles, z: Doubles) -> Doubles:
        total = np.zeros(np.broadcast(x, z).shape)
        for octave in range(4):
            scale = 0.11 * 2.1**octave
            value = noise(seed + octave, scale * x + 25.0 + octave, scale * z + 25.0)
            if style == 1:
                value = 1.0 - np.abs(2.0 * value - 1.0)
            total = total + (value - 0.5) * 0.45**octave
        y = steep * total
        if style == 2:
            level = y / step
            share = level - np.floor(level)
            smooth = np.clip((share - 0.35) / 0.3, 0.0, 1.0)
            y = step * (np.floor(level) + smooth * smooth * (3.0 - 2.0 * smooth)) + 0.1 * y
        rim = np.maximum(np.hypot(x, z) - 9.0, 0.0)
        result: Doubles = y + 0.05 * rim**1.6
        return result

    return height


def _ring_of_stones(model: Model, chance: Chance) -> None:
    """Add upright slabs in a ring, some of them with a lintel."""
    count, radius, high = chance.whole(8, 13), chance.uniform(2.2, 3.6), chance.uniform(1.3, 2.4)
    for i in range(count):
        angle = 2.0 * np.pi * i / count
        wide, tall = chance.uniform(0.5, 0.8), high * chance.uniform(0.8, 1.1)
        lean = about_x(chance.uniform(-0.1, 0.1))
        with model.at((radius * np.sin(angle), 0, radius * np.cos(angle)), angle, lean):
            place, size = (0, 0.5 * tall - 0.3, 0), (0.5 * wide, 0.5 * tall + 0.3, 0.17)
            model.put("cushion", place, size, STONE, tint=chance.uniform(0.8, 1.1))
        if i % 2 == 0 and chance.yes(0.7):
            half = angle + np.pi / count
            with model.at((radius * np.sin(half), high, radius * np.cos(half)), half):
                model.put("cushion", (0, 0.1, 0), (0.5 * 7.0 * radius / count, 0.18, 0.2), STONE)


def _dry_wall(model: Model, chance: Chance) -> None:
    """Add a wall of rough stones, with a gap and a gate of bars."""
    for course in range(6):
        x = -4.0
        while x < 4.0:
            wide = chance.uniform(0.2, 0.5)
            if not -0.5 < x + 0.5 * wide < 0.6 and (course < 5 or chance.yes(0.7)):
                middle = (x + 0.5 * wide, 0.19 * course - 0.1, chance.uniform(-0.03, 0.03))
                size, turn = (0.5 * wide - 0.008, 0.093, 0.2), about_y(chance.uniform(-0.08, 0.08))
                model.put("cushion", middle, size, STONE, turn=turn, tint=chance.uniform(0.7, 1.15))
            x += wide
    for x in (-0.5, 0.6):
        model.bar((x, -0.3, 0), (x, 1.15, 0), 0.06, WOOD)
    for y in np.arange(0.15, 1.1, 0.16):
        model.bar((-0.5, y, 0), (0.6, y + 0.05, 0), 0.016, WOOD)


def _hut(model: Model, chance: Chance) -> None:
    """Add a hut of logs with an open front under a roof of slats."""
    half, deep, high = 1.6, 1.3, 1.9
    for y in np.arange(-0.3, high, 0.17):
        model.bar((-half - 0.2, y, -deep), (half + 0.2, y, -deep), 0.09, WOOD)
        for x in (-half, half):
            model.bar((x, y + 0.085, -deep - 0.2), (x, y + 0.085, deep), 0.09, WOOD)
    for x in (-half, 0.0, half):
        model.bar((x, -0.3, deep), (x, high + 0.5, deep), 0.07, WOOD)
    slope, slat = about_x(0.18).T, (0.13, 0.03, 2 * deep + 0.9)
    for x in np.arange(-half - 0.4, half + 0.4, 0.16):
        model.put("box", (x, high + 0.28, 0), slat, WOOD, turn=slope, tint=chance.uniform(0.75, 1.15))
    model.box((-half, -0.3, -deep), (half, 0.05, deep + 0.5), WOOD)
    for _ in range(4):
        place = (chance.uniform(-1.2, 1.2), 0.25, chance.uniform(-0.9, 0.3))
        model.put("box", place, (0.4, 0.4, 0.4), WOOD, turn=about_y(chance.uniform(0, 3)))


def _cairns(model: Model, chance: Chance) -> None:
    """Add piles of flat stones and leaning poles."""
    for _ in range(chance.whole(4, 7)):
        x, z = chance.uniforms(-3.0, 3.0, 2)
        y, size = -0.3, chance.uniform(0.35, 0.7)
        for _ in range(chance.whole(5, 9)):
            flat = chance.uniform(0.09, 0.16)
            place, turn = (x, y + flat, z), rotation((0, 1, 0.05), chance.uniform(0, 6.28))[0]
            model.put("cushion", place, (size, flat, 0.9 * size), STONE, turn=turn, tint=chance.uniform(0.7, 1.15))
            y, size = y + 1.9 * flat, size * chance.uniform(0.78, 0.97)
        if chance.yes(0.6):
            model.bar((x + 0.6, -0.3, z), (x + 0.1, 2.2, z + 0.1), 0.02, WOOD)


def _bare_tree(model: Model, chance: Chance) -> None:
    """Add a tree without leaves, or a fir of cones."""
    high = chance.uniform(2.0, 4.5)
    if chance.yes(0.5):
        model.bar((0, -0.2, 0), (0, 0.9 * high, 0), 0.03 * high, WOOD)
        for share in np.linspace(0.2, 0.85, 7):
            radius = 0.3 * high * (1.05 - share)
            model.put("cone", (0, share * high, 0), (radius, 0.22 * high, radius), WOOD, tint=(0.35, 0.7, 0.35))
        return
    plants.tree(model, chance, high, 40)


def _candidates(chance: Chance, height: solids.Height, middle: tuple[float, float]) -> list[Candidate]:
    """Return views of what stands in the middle, from all sides and heights."""
    views = []
    for _, cosine, sine in directions(chance, 60):
        far = chance.uniform(3.5, 8.0)
        x, y, z = solids.on_ground(height, middle[0] + far * cosine, middle[1] + far * sine)
        eye, aim = (x, y + chance.uniform(0.9, 2.6), z), solids.on_ground(height, *middle)
        views.append(Candidate(eye, (aim[0], aim[1] + chance.uniform(-0.3, 0.5), aim[2])))
    return views
