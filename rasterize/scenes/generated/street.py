"""A street between houses: windows, balconies, lamps, cars, kerbs, wires; all closed."""

from __future__ import annotations

from itertools import product

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment

from ..scatter import about_x
from . import solids
from . import street_things as things
from .chance import Chance
from .draft import Draft, Ground
from .model import ASPHALT, BRICK, CLOTH, COLOURS, GLASS, IRON, PAINT, PLASTER, STEEL, STONE, WOOD, Model
from .views import Candidate

_LENGTH = 24.0


def street(chance: Chance) -> Draft:
    """Make 24 m of a street along z, 5 to 8 m wide, with houses of 2 to 4 storeys."""
    model = Model()
    half, walk = 0.5 * chance.uniform(5.0, 8.0), chance.uniform(1.4, 2.4)
    _road(model, chance, half, walk)
    for side in (-1.0, 1.0):
        ground = Ground()
        z = -0.5 * _LENGTH
        while z < 0.5 * _LENGTH - 2.0:
            wide = min(chance.uniform(4.0, 7.5), 0.5 * _LENGTH - z)
            if wide > 3.0:
                with model.at((side * (half + walk), 0.0, z + 0.5 * wide), -side * 0.5 * np.pi):
                    _house(model, chance, wide)
            z += wide + (0.0 if chance.yes(0.7) else 0.9)
        _furnish(model, chance, ground, side, half, walk)
    for end, turn in ((-1.0, 0.0), (1.0, np.pi)):  # what closes the street
        if chance.yes(0.7):
            with model.at((chance.uniform(-1, 1), 0.0, end * (0.5 * _LENGTH + 1.0)), turn):
                _house(model, chance, 2.0 * (half + walk))
    for z in np.arange(-9.0, 10.0, chance.uniform(5.0, 9.0)):
        y = chance.uniform(4.5, 6.0)
        across = (half + walk, y + 0.3, z + chance.uniform(-2, 2))
        model.sag((-half - walk, y, z), across, 0.5, chance.uniform(0.005, 0.015), IRON)
    low = -chance.uniform(0.7, 1.2)
    sun = DirectionalLight((chance.uniform(-0.7, 0.7), low, chance.uniform(-0.6, 0.2)), (17.0, 15.5, 13.0))
    views = []
    for i in range(60):
        side = 1.0 if i % 2 else -1.0
        x = side * chance.uniform(0.1, 1.0) * (half + 0.6 * walk)
        z = chance.uniform(3.0, 10.0) * (-1.0 if i % 3 == 2 else 1.0)
        eye = (x, chance.uniform(1.1, 2.0) if i % 4 else chance.uniform(2.8, 3.8), z)
        aim_x, aim_y = -side * chance.uniform(0.2, 1.2) * half, chance.uniform(0.5, 1.6)
        views.append(Candidate(eye, (aim_x, aim_y, float(z - np.sign(z) * chance.uniform(4.0, 8.0)))))
    lights, reach = (sun, Environment((0.85, 1.0, 1.25))), chance.pick((0.5, 0.8, 1.2))
    return Draft(model, views, lights, ao_radius=reach, yfov=chance.uniform(0.8, 1.05), clearance=0.4, coverage=0.75)


def _road(model: Model, chance: Chance, half: float, walk: float) -> None:
    """Add the roadway, kerbs, pavements of slabs, a manhole and bollards."""
    end = 0.5 * _LENGTH
    model.box((-half - walk - 4, -0.6, -end - 3), (half + walk + 4, -0.14, end + 3), ASPHALT)
    if chance.yes(0.4):  # setts
        for x, z in product(np.arange(-half, half, 0.5), np.arange(-end, end, 0.5)):
            place = (x + 0.25, -0.13 + chance.uniform(-0.01, 0.01), z + 0.25)
            model.put("box", place, (0.47, 0.06, 0.47), STONE, tint=chance.uniform(0.5, 0.75))
    for side, z in product((-1.0, 1.0), np.arange(-end, end, 1.0)):
        place, tint = (side * (half + 0.07), -0.1, z + 0.5), chance.uniform(0.8, 1.0)
        model.put("box", place, (0.14, 0.24, 0.985), STONE, tint=tint)
        for x in np.arange(0.16, walk, 0.5):
            deep = min(0.5, walk - x)
            size = (deep - 0.01, 0.1 + chance.uniform(-0.006, 0.006), 0.985)
            place, tint = (side * (half + x + 0.5 * deep), -0.05, z + 0.5), chance.uniform(0.75, 0.95)
            model.put("box", place, size, STONE, tint=tint)
    model.put("bar28", (0.3 * half, -0.14, 1.0), (0.35, 0.02, 0.35), IRON)
    model.put("bar28", (-0.4 * half, -0.14, -5.0), (0.35, 0.02, 0.35), IRON)


def _house(model: Model, chance: Chance, wide: float) -> None:
    """Add a house whose front is the plane z = 0 and faces +z."""
    storeys, deep = chance.whole(2, 4), 4.0
    tall = chance.uniform(2.6, 3.1)
    high = storeys * tall
    wall, tint = chance.pick((PLASTER, BRICK, STONE)), chance.uniforms(0.75, 1.1, 3)
    count = max(round(wide / chance.uniform(1.5, 2.1)), 2)
    opening, sill = chance.uniform(0.8, 1.1), chance.uniform(0.7, 0.95)
    half, thick = 0.5 * wide, 0.3
    model.box((-half, -0.3, -deep), (half, high, -thick), wall, 0.6 * tint)
    balcony = chance.yes(0.5)
    door = chance.whole(0, count - 1)
    for storey in range(storeys):
        low = storey * tall
        top = low + tall - 0.35
        model.box((-half, top, -thick), (half, low + tall, 0), wall, tint)
        if storey:
            model.box((-half, low, -thick), (half, low + sill, 0), wall, tint)
        edges = [-half]
        for i in range(count):
            middle = -half + (i + 0.5) * wide / count
            is_door = storey == 0 and i == door
            start = low if is_door else low + sill
            left, right = middle - 0.5 * opening, middle + 0.5 * opening
            edges += [left, right]
            if storey == 0 and not is_door:
                model.box((left, low - 0.3, -thick), (right, low + sill, 0), wall, tint)
            with model.at((middle, start, 0.0)):
                if is_door:
                    _door(model, chance, opening, top - start)
                else:
                    _window(model, chance, opening, top - start, storey)
                    if storey and balcony and chance.yes(0.7):
                        _balcony(model, chance, opening + 0.5, -sill + 0.05)
        edges.append(half)
        for left, right in zip(edges[::2], edges[1::2], strict=True):
            model.box((left, -0.3 if not storey else low, -thick), (right, top, 0), wall, tint)
        if chance.yes(0.6):
            model.box((-half, low + tall - 0.1, -thick), (half, low + tall, 0.08), STONE)
    model.box((-half - 0.05, high, -deep), (half + 0.05, high + 0.12, 0.28), STONE)
    for x in np.arange(-half + 0.2, half, 0.45):
        model.box((x - 0.06, high - 0.2, -0.05), (x + 0.06, high, 0.24), STONE)
    if chance.yes(0.6):
        x = half - 0.15
        model.bar((x, 0.0, 0.07), (x, high, 0.07), 0.045, STEEL)
    if chance.yes(0.5):
        _awning(model, chance, wide, tall)


def _window(model: Model, chance: Chance, wide: float, high: float, storey: int) -> None:
    """Add a window 15 cm behind the front, with bars, a sill and maybe shutters or flowers."""
    half = 0.5 * wide
    model.box((-half, 0, -0.22), (half, high, -0.2), GLASS)
    for x in (-half + 0.03, 0.0, half - 0.03):
        model.box((x - 0.03, 0, -0.2), (x + 0.03, high, -0.15), PAINT)
    for y in (0.03, 0.62 * high, high - 0.03):
        model.box((-half, y - 0.03, -0.2), (half, y + 0.03, -0.15), PAINT)
    model.box((-half - 0.06, -0.05, -0.15), (half + 0.06, 0.0, 0.08), STONE)
    kind = chance.whole(0, 4)
    if kind == 0:
        tint = chance.pick(COLOURS)
        for side in (-1, 1):
            x = side * (half + 0.02 + 0.25 * wide)
            model.box((x - 0.24 * wide, 0, 0.005), (x + 0.24 * wide, high, 0.02), PAINT, tint)
            for y in np.arange(0.05, high - 0.05, 0.09):
                model.put("box", (x, y, 0.03), (0.42 * wide, 0.06, 0.012), PAINT, tint=tint, turn=about_x(0.5))
    elif kind == 1 and storey:
        model.box((-half, 0.0, 0.0), (half, 0.14, 0.16), PAINT, (0.7, 0.35, 0.2))
        for _ in range(12):
            x, size = chance.uniform(-0.9, 0.9) * half, chance.uniform(0.04, 0.09)
            model.put("octahedron", (x, 0.18 + chance.uniform(0, 0.08), 0.08), size, PAINT, tint=chance.pick(COLOURS))
    elif kind == 2 and not storey:
        for x in np.linspace(-half, half, 8):
            model.bar((x, 0, -0.05), (x, high, -0.05), 0.009, IRON)
        for y in (0.15, 0.5 * high, high - 0.15):
            model.bar((-half, y, -0.05), (half, y, -0.05), 0.009, IRON)


def _door(model: Model, chance: Chance, wide: float, high: float) -> None:
    """Add a panelled door with steps."""
    half, tint = 0.5 * wide, chance.pick(COLOURS)
    model.box((-half, 0, -0.22), (half, high, -0.16), WOOD, tint)
    for x, y in product((-0.25 * wide, 0.25 * wide), (0.1, 0.4, 0.7)):
        model.box((x - 0.18 * wide, y * high, -0.16), (x + 0.18 * wide, (y + 0.24) * high, -0.14), WOOD, tint)
    for step in range(2):
        model.box((-half - 0.1, -0.05, 0), (half + 0.1, 0.14 - 0.07 * step, 0.25 + 0.25 * step), STONE)


def _balcony(model: Model, chance: Chance, wide: float, y: float) -> None:
    """Add a balcony with a railing of bars."""
    half, out = 0.5 * wide, 0.75
    model.box((-half, y - 0.1, 0), (half, y, out), STONE)
    gap = chance.uniform(0.09, 0.14)
    radius = chance.uniform(0.005, 0.01)
    for x in np.arange(-half + 0.04, half, gap):
        model.bar((x, y, out - 0.04), (x, y + 0.9, out - 0.04), radius, IRON, sides=5)
    for z, x in product(np.arange(0.05, out, gap), (-half + 0.04, half - 0.04)):
        model.bar((x, y, z), (x, y + 0.9, z), radius, IRON, sides=5)
    model.bar((-half, y + 0.9, out - 0.04), (half, y + 0.9, out - 0.04), 0.02, IRON)
    for x in (-half + 0.04, half - 0.04):
        model.bar((x, y + 0.9, 0), (x, y + 0.9, out), 0.02, IRON)


def _awning(model: Model, chance: Chance, wide: float, tall: float) -> None:
    """Add a striped awning with a scalloped edge on two bars."""
    u = np.linspace(-0.42 * wide, 0.42 * wide, 33)[None, :]
    v = np.array([0.0, 0.5, 1.0, 1.12])[:, None]
    drop = 0.35 * np.minimum(v, 1.0) ** 1.2 + np.maximum(v - 1.0, 0.0) * (1.0 + 0.4 * np.cos(u * 12.0))
    points = np.stack([u + 0.0 * v, tall - 0.35 - drop, 0.02 + 1.1 * np.minimum(v, 1.0) + 0.0 * u], axis=-1)
    model.add(solids.sheet(points[::-1], 0.012), CLOTH, tint=chance.pick(COLOURS))
    for x in (-0.4 * wide, 0.4 * wide):
        model.bar((x, tall - 0.9, 0.02), (x, tall - 0.7, 1.08), 0.012, IRON)


def _furnish(model: Model, chance: Chance, ground: Ground, side: float, half: float, walk: float) -> None:
    """Add lamps, trees in grates, bins, benches, bollards, bicycles and parked cars."""
    kerb = half + 0.35
    for z in np.arange(-9.0, 10.0, chance.uniform(5.0, 8.0)):
        ground.take(0.0, z, 0.4, 0.4)
        with model.at((side * kerb, 0.0, z), -side * 0.5 * np.pi):
            things.street_light(model, chance)
    small = (things.waste_bin, 3), (things.bench, 2), (things.bicycle, 2), (things.bollards, 2), (things.crates, 2)
    for kind, number in small:
        for _, z in ground.places(chance, (-0.1, 0.1, -10.0, 10.0), 0.2, 2.0, chance.whole(0, number)):
            with model.at((side * (half + 0.5), 0.0, z), -side * 0.5 * np.pi):
                kind(model, chance)
    for _, z in Ground().places(chance, (-0.1, 0.1, -10.0, 9.0), 0.2, 5.0, chance.whole(0, 3)):
        turn = 0.0 if chance.yes(0.5) else np.pi
        with model.at((side * (half - 1.05), -0.14, z), turn):
            things.car(model, chance)
