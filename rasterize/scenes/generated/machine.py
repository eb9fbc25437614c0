"""A hall with machines: tanks, pipes, gears, flywheels, cables, catwalks, ladders; all closed."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import Environment, PointLight, SpotLight

from ..scatter import Doubles, about_x
from ..shapes import lathe, rounded
from . import furniture, solids
from .chance import Chance
from .draft import Draft, Ground, directions
from .model import COLOURS, GLASS, IRON, PAINT, PLASTER, STEEL, STONE, Model
from .views import Candidate

_LYING = about_x(0.5 * np.pi)
"""Rotation from the y axis to z: a wheel about y stands upright then."""


def machine(chance: Chance) -> Draft:
    """Make a hall of 7 to 11 m by 6 to 9 m, 3.5 to 5 m high, full of machines."""
    wide, deep, high = chance.uniform(7, 11), chance.uniform(6, 9), chance.uniform(3.5, 5.0)
    model, ground = Model(), Ground()
    _hall(model, chance, wide, deep, high)
    inner = (-0.44 * wide, 0.44 * wide, -0.46 * deep, 0.3 * deep)
    large = (_engine, 2.6), (chance.pick((_engine, _gears)), 2.2), (_tank, 1.6), (_tank, 1.4)
    for kind, size in (*large, (_gears, 1.4), (_panel, 1.0), (_panel, 1.0)):
        for x, z in ground.places(chance, inner, size, size):
            with model.at((x, 0.0, z), chance.whole(0, 3) * 0.5 * np.pi):
                kind(model, chance, 0.42 * size)
    for _ in range(chance.whole(6, 12)):
        _pipe(model, chance, wide, deep, high)
    for _ in range(chance.whole(2, 6)):
        start = (chance.uniform(-0.45, 0.45) * wide, high - 0.3, -0.48 * deep)
        end = (chance.uniform(-0.45, 0.45) * wide, high - 0.3, chance.uniform(0.0, 0.45) * deep)
        model.sag(start, end, chance.uniform(0.2, 0.9), chance.uniform(0.003, 0.015), IRON)
    if chance.yes(0.7):
        _catwalk(model, chance, wide, deep, chance.uniform(2.0, 2.4))
    floor = (-0.4 * wide, 0.4 * wide, -0.3 * deep, 0.42 * deep)
    for x, z in ground.places(chance, floor, 0.5, 0.5, chance.whole(3, 8)):
        with model.at((x, 0.0, z), chance.uniform(0.0, 6.28)):
            furniture.clutter(model, chance)
    lamp = PointLight((0.15 * wide, high - 0.6, 0.1 * deep), (16.0, 14.5, 12.0), 0.05)
    spot = SpotLight((-0.2 * wide, high - 0.4, 0.2 * deep), (0.1, -1.0, -0.4), 0.9, (20.0, 19.0, 17.0))
    views = []
    for _, cosine, sine in directions(chance, 60):
        eye = (0.4 * wide * cosine, chance.uniform(0.9, 2.2), 0.42 * deep * sine)
        aim = -0.3 * eye[0] + chance.uniform(-0.8, 0.8)
        views.append(Candidate(eye, (aim, chance.uniform(0.5, 1.3), -0.4 * eye[2])))
    lights, reach = (lamp, spot, Environment((0.35, 0.38, 0.42))), chance.pick((0.25, 0.4, 0.6))
    return Draft(model, views, lights, ao_radius=reach, yfov=chance.uniform(0.85, 1.05), clearance=0.25)


def _hall(model: Model, chance: Chance, wide: float, deep: float, high: float) -> None:
    """Add floor, walls with piers, a ceiling with girders and a grating in the floor."""
    x, z = 0.5 * wide, 0.5 * deep
    tint = chance.uniforms(0.75, 1.0, 3)
    model.box((-x - 0.2, -0.2, -z - 0.2), (x + 0.2, 0.0, z + 0.2), STONE, 0.7)
    model.box((-x - 0.2, high, -z - 0.2), (x + 0.2, high + 0.2, z + 0.2), PLASTER)
    model.box((-x - 0.2, 0, -z - 0.2), (x + 0.2, high, -z), PLASTER, tint)
    model.box((-x - 0.2, 0, z), (x + 0.2, high, z + 0.2), PLASTER, tint)
    model.box((-x - 0.2, 0, -z), (-x, high, z), PLASTER, tint)
    model.box((x, 0, -z), (x + 0.2, high, z), PLASTER, tint)
    for place in np.linspace(-0.8 * x, 0.8 * x, chance.whole(3, 6)):
        model.box((place - 0.15, 0, -z), (place + 0.15, high, -z + 0.12), PLASTER, 0.9 * tint)
    for place in np.linspace(-0.8 * z, 0.8 * z, chance.whole(3, 5)):
        for below, above, half in ((-0.05, 0.0, 0.1), (-0.3, -0.05, 0.015), (-0.35, -0.3, 0.1)):
            model.box((-x, high + below, place - half), (x, high + above, place + half), IRON, (3.0, 2.0, 1.8))
    for step in np.arange(-1.0, 1.0, 0.08):
        model.box((step, 0.0, 0.5 * z), (step + 0.012, 0.035, 0.5 * z + 1.0), STEEL)
    for step in np.arange(0.0, 1.05, 0.25):
        model.bar((-1.0, 0.018, 0.5 * z + step), (1.0, 0.018, 0.5 * z + step), 0.006, STEEL, sides=5)


def _flange(model: Model, place: Doubles, way: Doubles, radius: float) -> None:
    """Add two rings and bolts round a pipe."""
    unit = way / np.linalg.norm(way)
    model.bar(place - 0.03 * unit, place + 0.03 * unit, 1.5 * radius, STEEL, sides=16)
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    up = np.cross(unit, side)
    for angle in np.arange(6) * (np.pi / 3):
        at = place + 1.25 * radius * (np.cos(angle) * side + np.sin(angle) * up)
        model.bar(at - 0.045 * unit, at + 0.045 * unit, 0.1 * radius + 0.003, IRON, sides=5)


def _pipe(model: Model, chance: Chance, wide: float, deep: float, high: float) -> None:
    """Add a pipe of straight runs along the walls and the ceiling, with bends and flanges."""
    radius = chance.pick((0.012, 0.02, 0.035, 0.05, 0.08))
    x, z = 0.5 * wide - 0.12 - radius, -0.5 * deep + 0.18 + radius
    place = np.array((chance.uniform(-0.9, 0.9) * x, 0.0, z))
    tint = chance.pick(COLOURS) if chance.yes(0.5) else np.ones(3)
    material = PAINT if chance.yes(0.5) else STEEL
    up, side = np.array((0.0, 1.0, 0.0)), np.array((1.0, 0.0, 0.0))
    ahead = np.array((0.0, 0.0, 1.0))
    for turn in range(chance.whole(3, 6)):
        way = (up, side, up, ahead, side, -1.0 * up)[turn]
        sign = 1.0 if turn % 2 == 0 or chance.yes(0.5) else -1.0
        step = chance.uniform(0.5, 0.35 * high if turn % 2 == 0 else 0.3 * wide)
        end = place + sign * step * way
        end = np.clip(end, [-x, 0.1, z], [x, high - 0.15 - radius, 0.4 * deep])
        if np.linalg.norm(end - place) < 0.15:
            continue
        model.bar(place, end, radius, material, sides=16, tint=tint)
        model.put("ball", end, 1.2 * radius, material, tint=tint)
        _flange(model, 0.5 * (place + end), end - place, radius)
        if radius > 0.03 and chance.yes(0.4):
            with model.at(0.3 * place + 0.7 * end):
                _valve(model, chance, 2.6 * radius)
        place = end


def _valve(model: Model, chance: Chance, size: float) -> None:
    """Add a hand wheel on a stem that points to +z."""
    model.bar((0, 0, 0), (0, 0, 1.5 * size), 0.1 * size, STEEL)
    model.add(solids.torus(size, 0.12 * size, 24, 6), PAINT, (0, 0, 1.5 * size), turn=_LYING, tint=(0.75, 0.15, 0.1))
    for angle in np.arange(5) * 1.2566:
        tip = (size * np.cos(angle), size * np.sin(angle), 1.5 * size)
        model.bar((0, 0, 1.5 * size), tip, 0.06 * size, IRON, sides=5)


def _engine(model: Model, chance: Chance, half: float) -> None:
    """Add an engine: a bed, a ribbed block with cylinders, a shaft and a flywheel."""
    tint = chance.pick(COLOURS)
    model.box((-half, 0, -0.4 * half), (half, 0.18, 0.4 * half), STONE, 0.8)
    low, top = 0.18, 0.18 + chance.uniform(0.5, 0.9)
    model.box((-0.7 * half, low, -0.28 * half), (0.55 * half, top, 0.28 * half), PAINT, tint)
    for x in np.linspace(-0.66 * half, 0.5 * half, chance.whole(8, 16)):
        model.box((x - 0.012, low, -0.34 * half), (x + 0.012, top + 0.03, 0.34 * half), PAINT, tint)
    count = chance.whole(2, 5)
    for x in np.linspace(-0.55 * half, 0.4 * half, count):
        model.put("bar16", (x, top, 0), (0.14 * half, 0.3, 0.14 * half), STEEL)
        for y in np.arange(top + 0.05, top + 0.3, 0.045):
            model.put("bar16", (x, y, 0), (0.19 * half, 0.015, 0.19 * half), STEEL)
        rise = top + 0.3
        model.bar((x, rise, 0), (x, rise + 0.15, 0), 0.018, IRON)
        model.bar((x, rise + 0.15, 0), (x, rise + 0.15, -0.4 * half), 0.018, IRON)
        model.bar((x, rise + 0.15, -0.4 * half), (x, 0.3, -0.45 * half), 0.018, IRON)
    axis, radius = 0.5 * (low + top), 0.5 * half
    model.bar((0.5 * half, axis, 0), (half + 0.15, axis, 0), 0.04, STEEL, sides=16)
    with model.at((0.85 * half, max(axis, radius + 0.25), 0), 0.5 * np.pi):
        model.add(solids.torus(radius, 0.07, 40, 10), IRON, turn=_LYING, tint=(2.0, 2.0, 2.0))
        for angle in np.arange(8) * (np.pi / 4):
            tip = (radius * np.cos(angle), radius * np.sin(angle), 0)
            model.bar((0, 0, 0), tip, 0.022, IRON)
        model.bar((0, 0, -0.1), (0, 0, 0.1), 0.08, STEEL, sides=16)
    for _ in range(chance.whole(2, 5)):
        a = (chance.uniform(-0.6, 0.5) * half, top, 0.28 * half)
        b = (chance.uniform(-0.6, 0.5) * half, low + 0.1, 0.36 * half)
        model.sag(a, b, 0.15, chance.uniform(0.004, 0.012), IRON, 8)


def _tank(model: Model, chance: Chance, half: float) -> None:
    """Add an upright tank on legs with bands, a ladder, gauges and a pipe."""
    radius, tall = 0.75 * half, chance.uniform(1.4, 2.4)
    outline = rounded([(0.0, 0.0), (0.6, 0.03), (0.97, 0.18), (1.0, 0.3)], 3)
    bottom = [(0.0, 0.0), *outline[1:]]
    top = [(r, tall / radius - y) for r, y in outline[::-1]]
    profile = [*bottom, *top[:-1], (0.0, tall / radius)]
    tint = chance.pick((np.array((0.8, 0.8, 0.82)), *COLOURS))
    model.add(lathe(radius * np.array(profile), 36), PAINT, (0, 0.4, 0), tint=tint)
    for share in (0.25, 0.5, 0.75):
        model.add(solids.torus(radius + 0.004, 0.018, 36, 6), STEEL, (0, 0.4 + share * tall, 0))
    for angle in np.arange(4) * (0.5 * np.pi) + 0.78:
        x, z = 0.8 * radius * np.cos(angle), 0.8 * radius * np.sin(angle)
        model.bar((x, 0, z), (x, 0.62, z), 0.045, IRON)
    for x in (-0.18, 0.18):
        model.bar((x, 0.1, radius + 0.12), (x, tall + 0.9, radius + 0.12), 0.012, STEEL)
    for y in np.arange(0.25, tall + 0.8, 0.25):
        model.bar((-0.18, y, radius + 0.12), (0.18, y, radius + 0.12), 0.009, STEEL)
    for side in (-1.0, 1.0):
        place = np.array((side * radius, 0.4 + chance.uniform(0.3, 0.6) * tall, 0.0))
        model.bar(place, place + np.array((0.14 * side, 0, 0)), 0.03, STEEL, sides=16)
        _flange(model, place + np.array((0.1 * side, 0, 0)), np.array((1.0, 0, 0)), 0.03)
        end = (side * (radius + 0.14), 0.0, 0.0)
        model.bar(place + np.array((0.14 * side, 0, 0)), end, 0.03, STEEL)


def _gears(model: Model, chance: Chance, half: float) -> None:
    """Add a train of upright gears between two frames."""
    x, y = -0.8 * half, 0.9
    for _ in range(chance.whole(2, 4)):
        radius, teeth = chance.uniform(0.18, 0.42), chance.whole(12, 30)
        x += radius
        if x > half:
            break
        part = solids.gear(radius, teeth, 0.09, 0.05)
        model.add(part, STEEL, (x, y, -0.045), turn=_LYING, tint=chance.uniform(0.7, 1.2))
        model.bar((x, y, -0.3), (x, y, 0.3), 0.03, IRON, sides=16)
        for angle in np.arange(6) * (np.pi / 3):
            at = (x + 0.6 * radius * np.cos(angle), y + 0.6 * radius * np.sin(angle))
            model.bar((*at, -0.07), (*at, 0.07), 0.015, IRON)
        for z in (-0.25, 0.25):
            model.box((x - 0.03, 0, z - 0.03), (x + 0.03, y + 0.08, z + 0.03), IRON, 3.0)
        x += 0.9 * radius
    for z in (-0.25, 0.25):
        model.box((-0.9 * half, 0.0, z - 0.06), (half, 0.12, z + 0.06), IRON, 3.0)


def _panel(model: Model, chance: Chance, half: float) -> None:
    """Add a switchboard with knobs, gauges and levers on its slanted desk."""
    tint = chance.pick(COLOURS)
    model.box((-half, 0, -0.4), (half, 1.7, -0.1), PAINT, tint)
    model.box((-half, 0, -0.1), (half, 0.75, 0.25), PAINT, tint)
    for row in range(3):
        for x in np.linspace(-0.8 * half, 0.8 * half, 5):
            kind, y = chance.whole(0, 3), 0.95 + 0.25 * row
            if kind == 0:
                model.bar((x, y, -0.1), (x, y, -0.06), 0.05, IRON, sides=16)
                model.bar((x, y, -0.06), (x, y, -0.055), 0.042, GLASS, sides=16)
            elif kind == 1:
                model.bar((x, y, -0.1), (x, y, -0.04), 0.02, IRON)
            elif kind == 2:
                model.bar((x, y, -0.1), (x, y + 0.08, 0.02), 0.006, STEEL)
                model.put("ball", (x, y + 0.08, 0.02), 0.016, PAINT, tint=(0.8, 0.1, 0.1))
            else:
                model.box((x - 0.04, y - 0.06, -0.1), (x + 0.04, y + 0.06, -0.085), PAINT, chance.pick(COLOURS))
    for x in np.linspace(-0.7 * half, 0.7 * half, 4):
        model.put("ball", (x, 0.76, 0.1), 0.025, PAINT, tint=chance.pick(COLOURS))


def _catwalk(model: Model, chance: Chance, wide: float, deep: float, y: float) -> None:
    """Add a gangway of bars along the back wall with a railing, and a ladder up to it."""
    x, back, front = 0.45 * wide, -0.5 * deep + 0.3, -0.5 * deep + 1.2
    for step in np.arange(-x, x, 0.1):
        model.box((step, y, back), (step + 0.015, y + 0.03, front), STEEL)
    for z in (back, 0.5 * (back + front), front):
        model.box((-x, y - 0.08, z - 0.02), (x, y, z + 0.02), IRON, 3.0)
    for step in np.linspace(-x, x, max(round(2 * x / 1.1), 2)):
        model.bar((step, y, front), (step, y + 1.0, front), 0.018, IRON)
        model.box((step - 0.04, 0, back - 0.04), (step + 0.04, y - 0.08, back + 0.04), IRON, 3.0)
    for rise in (0.35, 0.68, 1.0):
        model.bar((-x, y + rise, front), (x, y + rise, front), 0.015, IRON)
    foot = chance.uniform(-0.8, 0.8) * x
    with model.at((foot, 0, front + 0.3)):
        furniture.ladder(model, chance, y + 0.1)
