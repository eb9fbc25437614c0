"""Columns in the open: a portico, a ring or a court, with fluted shafts, arches and balusters."""

from __future__ import annotations

from itertools import product

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment

from ...parts import Part, complete
from ..scatter import Doubles, about_x, about_y, rotation
from ..shapes import joined, lathe, rounded
from . import furniture, solids
from .chance import Chance
from .draft import Draft, directions
from .model import IRON, STONE, Model
from .views import Candidate


def colonnade(chance: Chance) -> Draft:
    """Make a colonnade with columns of 2.6 to 5 m; everything is closed."""
    model = Model()
    high = chance.uniform(2.6, 5.0)
    plan = chance.pick((_portico, _ring, _court))
    candidates = plan(model, chance, high, _column(chance, high))
    away = chance.uniform(-0.9, 0.9)
    sun = DirectionalLight((-0.6, -chance.uniform(0.5, 0.9), away), (17.0, 15.0, 12.0))
    lights = (sun, Environment((0.8, 1.0, 1.3)))
    return Draft(model, candidates, lights, ao_radius=0.15 * high, yfov=chance.uniform(0.85, 1.05), coverage=0.7)


def _column(chance: Chance, high: float) -> Part:
    """Return a column with base, shaft and capital, whose axis is that of y."""
    radius = high / chance.uniform(13.0, 20.0)
    flutes = chance.pick((0, 0, 12, 16, 20))
    depth = chance.uniform(0.05, 0.09)

    def fluted(angle: Doubles, height: Doubles) -> Doubles:
        away = np.abs((angle * flutes / (2.0 * np.pi)) % 1.0 - 0.5)
        factor: Doubles = 1.0 - depth * np.sqrt(np.maximum(1.0 - (2.0 * away) ** 2, 0.0))
        return factor + 0.0 * height

    base = [
        (0.0, 0.0), (1.55, 0.0), (1.55, 0.25), (1.45, 0.3), (1.5, 0.42), (1.4, 0.55), (1.15, 0.58), (1.15, 0.62),
        (0.0, 0.62),
    ]  # fmt: skip
    top = high / radius
    bell = rounded([(1.0, top - 0.62), (1.15, top - 0.45), (1.6, top - 0.2), (1.65, top - 0.17)], 4)
    neck = [(0.0, top - 1.1), (1.0, top - 1.1), (1.02, top - 0.8), (1.15, top - 0.72), (1.0, top - 0.66)]
    capital = [*neck, *bell, (0.0, top - 0.17)]
    heights = np.linspace(0.6, top - 1.05, 7)
    swell = 1.0 - 0.16 * ((heights - 0.6) / top) ** 1.8
    profile = [(0.0, 0.6), *zip(swell, heights, strict=True), (0.0, top - 1.05)]
    segments = 4 * flutes if flutes else 28
    shaft = lathe(radius * np.array(profile), segments, shape=fluted if flutes else None)
    parts = [lathe(radius * np.array(base), 28), lathe(radius * np.array(capital), 28), shaft]
    return joined([complete(part) for part in parts])


def _stand(model: Model, chance: Chance, column: Part, places: Doubles, high: float) -> None:
    """Add columns at `places` [n, 3] with plinths below and slabs above; a few are broken off."""
    turns = rotation((0.0, 1.0, 0.0), chance.uniforms(0.0, 6.28, len(places)))
    scale = np.ones((len(places), 3))
    broken = chance.uniforms(0.0, 1.0, len(places)) < 0.05
    scale[broken, 1] = 0.5
    tints = np.repeat(chance.uniforms(0.9, 1.1, len(places), 1), 3, axis=1)
    model.scatter(column, STONE, places, turns=turns, scales=scale, tints=tints)
    wide = 0.28 * high / 2.6
    for (x, y, z), short in zip(places, broken, strict=True):
        model.put("box", (x, y - 0.04, z), (wide * 1.2, 0.08, wide * 1.2), STONE)
        if not short:
            model.put("box", (x, y + high * 0.992, z), (wide, 0.016 * high, wide), STONE)


def _paving(model: Model, chance: Chance, half_x: float, half_z: float, y: float) -> None:
    """Add slabs with gaps on a base."""
    size = chance.uniform(0.5, 1.1)
    rows, columns = max(round(2 * half_z / size), 1), max(round(2 * half_x / size), 1)
    model.box((-half_x, y - 0.4, -half_z), (half_x, y - 0.05, half_z), STONE, 0.8)
    step_x, step_z = 2 * half_x / columns, 2 * half_z / rows
    slab = (step_x - 0.015, 0.06, step_z - 0.015)
    for row, column in product(range(rows), range(columns)):
        x, z = -half_x + (column + 0.5) * step_x, -half_z + (row + 0.5) * step_z
        place = (x, y - 0.03 + chance.uniform(-0.008, 0.004), z)
        model.put("box", place, slab, STONE, tint=chance.uniform(0.8, 1.1))


def _balustrade(model: Model, chance: Chance, start: Doubles, end: Doubles) -> None:
    """Add a balustrade 0.9 m high from one point to another."""
    along = end - start
    length = float(np.linalg.norm(along))
    count = max(int(length / 0.19), 2)
    outline = [(0.035, 0.1), (0.05, 0.14), (0.03, 0.22), (0.065, 0.4), (0.03, 0.62), (0.05, 0.7), (0.04, 0.74)]
    baluster = lathe([(0.0, 0.1), *rounded(outline, 2), (0.0, 0.74)], 12)
    share = (np.arange(count) + 0.5)[:, None] / count
    model.scatter(baluster, STONE, start + share * along)
    middle, turn = 0.5 * (start + end), about_y(float(np.arctan2(-along[2], along[0])))
    model.put("box", middle + np.array((0, 0.05, 0)), (length, 0.1, 0.16), STONE, turn=turn)
    model.put("box", middle + np.array((0, 0.79, 0)), (length, 0.1, 0.18), STONE, turn=turn)


def _beam(model: Model, start: Doubles, end: Doubles, y: float, size: float) -> None:
    """Add an architrave of three bands and a cornice between two columns' tops."""
    along = end - start
    turn = about_y(float(np.arctan2(-along[2], along[0])))
    middle, length = 0.5 * (start + end), float(np.linalg.norm(along))
    for i, (low, high, out) in enumerate(((0.0, 0.5, 1.0), (0.5, 1.0, 1.06), (1.0, 1.15, 1.3), (1.15, 1.3, 1.5))):
        place = (middle[0], y + 0.5 * (low + high) * size, middle[2])
        model.put("box", place, (length + (0.3 + 0.02 * i) * size, (high - low) * size, out * size), STONE, turn=turn)


def _debris(model: Model, chance: Chance, bounds: tuple[float, float], y: float) -> None:
    """Add blocks, stones, vases and fallen drums."""
    for _ in range(chance.whole(4, 10)):
        x, z = chance.uniform(-1, 1) * bounds[0], chance.uniform(-1, 1) * bounds[1]
        with model.at((x, y, z), chance.uniform(0, 6.28)):
            kind, size = chance.whole(0, 3), chance.uniform(0.12, 0.35)
            if kind == 0:
                tilt = rotation((1, 0, 0.3), chance.uniform(-0.1, 0.1))[0]
                model.put("box", (0, 0.4 * size, 0), (2 * size, 0.8 * size, 1.2 * size), STONE, turn=tilt)
            elif kind == 1:
                rock = solids.rock(chance.whole(0, 10**6), 16)
                model.add(rock, STONE, (0, 0.5 * size, 0), scale=(size, 0.7 * size, size))
            elif kind == 2:
                furniture.vase(model, chance, 2.6 * size, STONE)
            else:
                model.bar((-size, 0.6 * size, 0), (size, 0.6 * size, 0), 0.6 * size, STONE, sides=28)


def _lantern(model: Model, top: float, drop: float, x: float, z: float) -> None:
    """Add a lantern of thin bars on a chain of rings."""
    link = complete(solids.torus(0.025, 0.006, 12, 5))
    count = int(drop / 0.045)
    places = np.array([(x, top - 0.045 * (i + 0.5), z) for i in range(count)])
    turns = rotation((0, 1, 0), 0.5 * np.pi * (np.arange(count) % 2)) @ about_x(0.5 * np.pi)
    model.scatter(link, IRON, places, turns=turns)
    low = top - drop
    for angle in np.arange(6) * (np.pi / 3):
        c, s = 0.1 * np.cos(angle), 0.1 * np.sin(angle)
        model.bar((x + c, low - 0.3, z + s), (x + c, low - 0.06, z + s), 0.005, IRON, sides=5)
        model.bar((x + c, low - 0.06, z + s), (x, low, z), 0.005, IRON, sides=5)
    for y in (low - 0.3, low - 0.06):
        model.add(solids.torus(0.1, 0.008, 24, 6), IRON, (x, y, z))


def _portico(model: Model, chance: Chance, high: float, column: Part) -> list[Candidate]:
    """Add one or two rows of columns before a wall with niches, on steps, under a ceiling."""
    count, gap = chance.whole(5, 8), chance.uniform(0.5, 0.75) * high
    rows, deep = chance.whole(1, 2), chance.uniform(0.7, 1.0) * high
    half = 0.5 * gap * (count - 1) + 0.6
    grid = product(range(rows), range(count))
    places = np.array([(gap * (i - 0.5 * (count - 1)), 0.0, -deep * row) for row, i in grid])
    _stand(model, chance, column, places, high)
    size, back = 0.11 * high, -deep * rows
    for row in range(rows):
        _beam(model, np.array((-half, 0, -deep * row)), np.array((half, 0, -deep * row)), high, size)
    if chance.yes(0.7):
        model.box((-half - 0.3, high + 1.3 * size, back - 0.3), (half + 0.3, high + 1.3 * size + 0.15, 0.4), STONE)
        for x in np.arange(-half + 0.4, half, 0.5 * gap):
            model.box((x - 0.08, high + 1.05 * size, back), (x + 0.08, high + 1.3 * size, 0.0), STONE)
    top = high + 1.3 * size
    model.box((-half, -0.1, back - 0.3), (half, top, back), STONE, (1.1, 1.02, 0.9))
    for i in range(count - 1):
        x = gap * (i + 0.5 - 0.5 * (count - 1))
        model.add(solids.arch(0.5 * gap, 0.12, 0.16), STONE, (x, 0.55 * high, back + 0.05))
        for side in (-1.0, 1.0):
            edge = x + side * (0.25 * gap + 0.06)
            model.box((edge - 0.06, 0, back), (edge + 0.06, 0.55 * high, back + 0.13), STONE)
        if chance.yes(0.6):
            model.box((x - 0.2, 0, back + 0.1), (x + 0.2, 0.5, back + 0.5), STONE)
            with model.at((x, 0.5, back + 0.3)):
                furniture.vase(model, chance, chance.uniform(0.5, 1.0), STONE)
        if chance.yes(0.5):
            _lantern(model, high + 0.9 * size, 0.25 * high, x, 0.5 * back)
        if chance.yes(0.4):
            _balustrade(model, chance, np.array((x - 0.36 * gap, 0, 0)), np.array((x + 0.36 * gap, 0, 0)))
    with model.at((0, 0, 0.5 * back)):
        _paving(model, chance, half + 0.3, 0.5 * abs(back) + 0.5, 0.0)
    for step in range(4):
        low = -0.14 * (step + 1)
        model.box((-half - 0.6, low - 0.3, 0.4), (half + 0.6, low, 1.0 + 0.32 * (step + 1)), STONE, 0.95 + 0.03 * step)
    with model.at((0, 0, 3.5 + 0.5 * high)):
        _paving(model, chance, half + 4.0, 2.0 + 0.6 * high, -0.7)
        _debris(model, chance, (half, 1.5), -0.7)

    views = []
    for i in range(40):
        side = 1.0 if i % 2 else -1.0
        x = side * chance.uniform(0.2, 0.9) * half
        if i % 3 == 0:
            eye = (x, chance.uniform(1.2, 1.8), 0.5 * back + chance.uniform(-0.2, 0.2) * deep)
            target = (-x, chance.uniform(0.8, 1.6), 0.4 * back)
        else:
            eye = (x, chance.uniform(0.8, 1.9), chance.uniform(1.5, 3.5))
            target = (-0.3 * x, chance.uniform(0.2, 0.4) * high, back)
        views.append(Candidate(eye, target))
    return views


def _ring(model: Model, chance: Chance, high: float, column: Part) -> list[Candidate]:
    """Add a ring of columns round a basin, with an architrave that carries arches or balusters."""
    count = chance.whole(8, 14)
    radius = max(0.62 * high * count / (2.0 * np.pi), 0.7 * high)
    angle = np.arange(count) * (2.0 * np.pi / count)
    places = np.stack([radius * np.cos(angle), 0.0 * angle, radius * np.sin(angle)], axis=1)
    _stand(model, chance, column, places, high)
    for start, end in zip(places, np.roll(places, -1, axis=0), strict=True):
        if chance.yes(0.85):
            _beam(model, start, end, high, 0.1 * high)
        if chance.yes(0.35):
            _balustrade(model, chance, start + 0.16 * (end - start), end - 0.16 * (end - start))
    model.put("bar28", (0, -0.12, 0), (radius + 0.8, 0.1, radius + 0.8), STONE)
    model.put("bar28", (0, -0.3, 0), (radius + 1.2, 0.2, radius + 1.2), STONE, tint=0.9)
    half = radius + 4.5
    _paving(model, chance, half, half, -0.25)
    basin = [
        (0.0, 0.0), (0.9, 0.0), (1.0, 0.1), (0.95, 0.5), (1.1, 0.55), (1.1, 0.62), (0.85, 0.62),
        (0.8, 0.3), (0.0, 0.25),
    ]  # fmt: skip
    model.add(lathe(basin, 40), STONE, scale=(0.25 * radius, 1.0, 0.25 * radius))
    with model.at((0, 0.25, 0)):
        furniture.vase(model, chance, chance.uniform(0.8, 1.5), STONE)
    _debris(model, chance, (0.8 * half, 0.8 * half), -0.25)
    views = []
    for i, cosine, sine in directions(chance, 40):
        far = (0.6 if i % 2 else 1.35) * radius
        eye = (far * cosine, chance.uniform(1.0, 2.2), far * sine)
        views.append(Candidate(eye, (-0.4 * eye[0], chance.uniform(0.05, 0.3) * high, -0.4 * eye[2])))
    return views


def _court(model: Model, chance: Chance, high: float, column: Part) -> list[Candidate]:
    """Add a court with arcades on three sides: arches on columns, walls behind, a roof between."""
    gap, deep = 0.6 * high, 0.7 * high
    number = chance.whole(3, 5)
    half = 0.5 * gap * number
    size = 0.09 * high
    rise = 0.5 * (gap - 0.3)
    part = complete(solids.arch(gap - 0.3, 0.15, 0.3))
    for turn in (0.0, 0.5 * np.pi, -0.5 * np.pi):
        with model.at((0, 0, 0), turn):
            along = np.array([(gap * i - half, 0.0, -half) for i in range(number + 1)])
            _stand(model, chance, column, along[:-1] if turn else along, high)
            middles = 0.5 * (along[1:] + along[:-1]) + np.array((0, high, 0))
            model.scatter(part, STONE, middles)
            top = high + rise + 0.15
            model.box((-half - deep, top, -half - deep), (half + deep, top + 0.2, -half + 0.25), STONE)
            _beam(model, np.array((-half, 0, -half)), np.array((half, 0, -half)), top + 0.2, size)
            low, up = (-half - deep, -0.1, -half - deep - 0.3), (half + deep, top, -half - deep)
            model.box(low, up, STONE, chance.uniforms(0.9, 1.15, 3))
            for i in range(number):
                x = gap * (i + 0.5) - half
                if chance.yes(0.5):
                    _lantern(model, top, 0.4 * high, x, -half - 0.5 * deep)
                if chance.yes(0.4):
                    model.box((x - 0.5, 0, -half - deep), (x + 0.5, 0.45, -half - deep + 0.4), STONE)
                if chance.yes(0.3):
                    with model.at((x, 0, -half - 0.6 * deep)):
                        furniture.vase(model, chance, chance.uniform(0.6, 1.3), STONE)
                if chance.yes(0.25):
                    out = np.array((0.3, 0, 0))
                    _balustrade(model, chance, along[i] + out, along[i + 1] - out)
    _paving(model, chance, half + deep, half + deep, 0.0)
    _debris(model, chance, (0.8 * half, 0.8 * half), 0.0)
    views = []
    for i in range(40):
        spread = chance.uniform(-0.8, 0.8) * half
        if i % 3 == 1:
            side = 1.0 if i % 2 else -1.0
            eye = (side * (half + 0.5 * deep), chance.uniform(1.2, 1.7), chance.uniform(0, half))
            target = (side * half, 1.2, -half)
        else:
            eye = (spread, chance.uniform(1.0, 2.0), chance.uniform(0.5, 1.0) * (half + 0.5 * deep))
            target = (-0.5 * spread, 0.3 * high, -half)
        views.append(Candidate(eye, target))
    return views
