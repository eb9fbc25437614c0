"""Furniture and clutter of rooms; every piece faces +z and stands on y = 0."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from ..scatter import about_x, about_y, rotation
from ..shapes import lathe, rounded
from . import solids
from .chance import Chance
from .model import CLOTH, COLOURS, IRON, LEAF, PAINT, SOIL, STEEL, WOOD, Model


def _corners(x: float, z: float) -> Iterator[tuple[float, float]]:
    """Return the corners (x, z) of a rectangle round the origin with these half sides."""
    return product((-x, x), (-z, z))


def shelves(model: Model, chance: Chance, wide: float, high: float, deep: float) -> None:
    """Add open shelves with books, boxes, balls and jars."""
    levels = max(int(high / chance.uniform(0.32, 0.5)), 2)
    ys = np.linspace(0.06, high - 0.03, levels + 1)
    post = 0.012 if chance.yes(0.4) else 0.03
    for x, z in _corners(0.5 * wide, 0.5 * deep):
        if post < 0.02:
            model.bar((x, 0.0, z), (x, high, z), post, IRON)
        else:
            model.box((x - post, 0.0, z - post), (x + post, high, z + post), WOOD)
    for y, above in zip(ys, [*ys[1:], high + 0.3], strict=True):
        model.box((-0.5 * wide, y - 0.02, -0.5 * deep), (0.5 * wide, y, 0.5 * deep), WOOD)
        goods(model, chance, wide - 0.1, deep, y, above - y - 0.05)


def goods(model: Model, chance: Chance, wide: float, deep: float, y: float, room: float) -> None:
    """Add a row of things at height y that are at most `room` high."""
    x = -0.5 * wide
    while True:
        kind, size, tall, push = chance.uniforms(0.0, 1.0, 4)
        width = 0.03 + 0.22 * size**2
        if x + width > 0.5 * wide:
            return
        height = min(room * (0.4 + 0.55 * tall), 0.45)
        z = (push - 0.5) * 0.25 * deep
        tint = chance.pick(COLOURS)
        middle = x + 0.5 * width
        if kind < 0.4:  # a run of books
            while x + 0.02 < middle + 0.5 * width and x + 0.06 < 0.5 * wide:
                thick, part = chance.uniforms(0.0, 1.0, 2)
                thick = 0.015 + 0.03 * thick
                top = room * (0.6 + 0.3 * part)
                model.box((x, y, -0.35 * deep), (x + thick, y + top, 0.32 * deep), PAINT, chance.pick(COLOURS))
                x += thick + 0.002
        elif kind < 0.65:
            model.put("box", (middle, y + 0.5 * height, z), (width, height, min(0.7 * deep, width)), PAINT, tint=tint)
        elif kind < 0.8:
            radius = 0.5 * min(width, room, 0.8 * deep)
            model.put("ball", (middle, y + radius, z), radius, PAINT, tint=tint)
        else:
            radius = 0.5 * min(width, 0.8 * deep)
            model.put("bar16", (middle, y, z), (radius, height, radius), PAINT, tint=tint)
        x = max(x, middle + 0.5 * width) + 0.01 + 0.08 * float(chance.uniform(0, 1)) ** 2


def cabinet(model: Model, chance: Chance, wide: float, high: float, deep: float) -> None:
    """Add a cupboard on feet with doors, gaps and handles, and a few things on its top."""
    tint = chance.pick(COLOURS) if chance.yes(0.5) else (1.0, 1.0, 1.0)
    foot = 0.08
    for x, z in _corners(0.45 * wide, 0.4 * deep):
        model.box((x - 0.02, 0.0, z - 0.02), (x + 0.02, foot, z + 0.02), WOOD)
    model.box((-0.5 * wide, foot, -0.5 * deep), (0.5 * wide, high, 0.5 * deep - 0.025), WOOD, tint)
    doors = max(round(wide / 0.5), 1)
    for i in range(doors):
        left = -0.5 * wide + (i * wide) / doors + 0.006
        right = left + wide / doors - 0.012
        model.box((left, foot + 0.01, 0.5 * deep - 0.02), (right, high - 0.02, 0.5 * deep), WOOD, tint)
        x, y, z = right - 0.06 if i % 2 == 0 else left + 0.06, 0.5 * high, 0.5 * deep + 0.025
        model.bar((x, y - 0.07, z), (x, y + 0.07, z), 0.006, STEEL)
    model.box((-0.5 * wide - 0.02, high, -0.5 * deep), (0.5 * wide + 0.02, high + 0.025, 0.5 * deep + 0.02), WOOD)
    if high < 1.5:
        goods(model, chance, wide - 0.1, deep, high + 0.025, 0.4)


def sofa(model: Model, chance: Chance, wide: float, deep: float) -> None:
    """Add a sofa with cushions."""
    tint = chance.pick(COLOURS)
    model.put("cushion", (0, 0.2, 0), (0.5 * wide, 0.13, 0.5 * deep), CLOTH, tint=tint)
    model.put("cushion", (0, 0.45, -0.4 * deep), (0.5 * wide, 0.35, 0.12 * deep), CLOTH, tint=tint)
    for x in (-0.47 * wide, 0.47 * wide):
        model.put("cushion", (x, 0.35, 0), (0.06 * wide, 0.25, 0.48 * deep), CLOTH, tint=tint)
        for z in (-0.4 * deep, 0.4 * deep):
            model.bar((x, 0.0, z), (x, 0.1, z), 0.02, WOOD)
    seats = max(round(wide / 0.7), 1)
    for i in range(seats):
        x = (i + 0.5) * 0.86 * wide / seats - 0.43 * wide
        size = (0.42 * wide / seats, 0.08, 0.36 * deep)
        model.put("cushion", (x, 0.36, 0.05 * deep), size, CLOTH, tint=0.9 * np.asarray(tint))
        if chance.yes(0.6):
            turn = about_x(-0.35) @ rotation((0, 0, 1), chance.uniform(-0.4, 0.4))[0]
            model.put("cushion", (x, 0.58, -0.2 * deep), (0.2, 0.18, 0.06), CLOTH, turn=turn, tint=chance.pick(COLOURS))


def table(model: Model, chance: Chance, wide: float, deep: float, high: float = 0.75) -> None:
    """Add a table of some make with things on it."""
    style = chance.whole(0, 2)
    if style == 0:  # round, on one foot
        radius = 0.5 * min(wide, deep)
        model.put("bar28", (0, high - 0.03, 0), (radius, 0.03, radius), WOOD)
        model.bar((0, 0, 0), (0, high - 0.03, 0), 0.04, IRON, sides=16)
        model.put("bar28", (0, 0, 0), (0.5 * radius, 0.03, 0.5 * radius), IRON)
        wide = deep = 1.3 * radius
    else:
        model.box((-0.5 * wide, high - 0.035, -0.5 * deep), (0.5 * wide, high, 0.5 * deep), WOOD)
        for x, z in _corners(0.46 * wide, 0.44 * deep):
            if style == 1:
                model.bar((x, 0, z), (0.9 * x, high - 0.035, 0.9 * z), 0.014, IRON)
            else:
                model.box((x - 0.03, 0, z - 0.03), (x + 0.03, high - 0.035, z + 0.03), WOOD)
        if style == 2:
            for z in (-0.44 * deep, 0.44 * deep):
                model.box((-0.46 * wide, high - 0.12, z - 0.01), (0.46 * wide, high - 0.035, z + 0.01), WOOD)
    for _ in range(chance.whole(3, 7)):
        x, z = chance.uniform(-0.4, 0.4) * wide, chance.uniform(-0.4, 0.4) * deep
        with model.at((x, high, z), chance.uniform(0.0, 6.28)):
            trinket(model, chance)


def trinket(model: Model, chance: Chance) -> None:
    """Add something small that stands on the origin."""
    kind, tint = chance.whole(0, 5), chance.pick(COLOURS)
    size = chance.uniform(0.04, 0.12)
    if kind == 0:
        for i in range(chance.whole(1, 4)):
            place, turn = (0.01 * i, 0.015 + 0.03 * i, 0), about_y(chance.uniform(-0.3, 0.3))
            model.put("box", place, (0.2, 0.028, 0.14), PAINT, turn=turn, tint=chance.pick(COLOURS))
    elif kind == 1:
        model.put("ball", (0, size, 0), size, PAINT, tint=tint)
    elif kind == 2:
        model.put("bar16", (0, 0, 0), (0.4 * size, 1.6 * size, 0.4 * size), PAINT, tint=tint)
    elif kind == 3:
        model.add(solids.torus(size, 0.22 * size), PAINT, (0, 0.22 * size, 0), tint=tint)
    elif kind == 4:
        vase(model, chance, 2.2 * size)
    else:
        for angle in np.arange(6) * 1.05:
            tip = (0.35 * size * np.cos(angle), 2.4 * size, 0.35 * size * np.sin(angle))
            model.bar((0.1 * size * np.cos(angle), 0.01, 0.1 * size * np.sin(angle)), tip, 0.003, WOOD, sides=5)
        model.put("bar16", (0, 0, 0), (0.3 * size, size, 0.3 * size), PAINT, tint=tint)


def vase(model: Model, chance: Chance, high: float, material: int = PAINT) -> None:
    """Add a turned vase."""
    belly, neck = chance.uniform(0.25, 0.42), chance.uniform(0.1, 0.2)
    outline = [(0.0, 0.0), (0.2, 0.0), (belly, 0.4), (neck, 0.8), (1.3 * neck, 1.0), (0.9 * neck, 1.0), (0.0, 0.9)]
    profile = rounded(outline, 4)
    profile[0] = profile[-1] * [0.0, 0.0]
    profile[-1, 0] = 0.0
    model.add(lathe(high * profile, 24), material, tint=chance.pick(COLOURS))


def chair(model: Model, chance: Chance) -> None:
    """Add a chair of bars, 0.45 m wide."""
    thin = chance.uniform(0.008, 0.018)
    material = chance.pick((WOOD, IRON, STEEL))
    model.put("cushion", (0, 0.45, 0), (0.22, 0.025, 0.21), CLOTH, tint=chance.pick(COLOURS))
    for x in (-0.2, 0.2):
        model.bar((x, 0, 0.2), (0.95 * x, 0.44, 0.18), thin, material)
        model.bar((1.05 * x, 0, -0.22), (x, 0.92, -0.24), thin, material)
    for y in (0.18, 0.3):
        model.bar((-0.2, y, -0.22), (0.2, y, -0.22), 0.7 * thin, material, sides=5)
    count = chance.whole(3, 6)
    for x in np.linspace(-0.17, 0.17, count):
        model.bar((x, 0.46, -0.215), (x, 0.9, -0.24), 0.6 * thin, material, sides=5)
    model.bar((-0.21, 0.9, -0.24), (0.21, 0.9, -0.24), thin, material)


def plant(model: Model, chance: Chance, high: float, closed: bool) -> None:
    """Add a pot with long leaves; with `closed` the leaves have a thickness."""
    radius = 0.16 * high
    pot = [(0.0, 0.0), (0.75 * radius, 0.0), (radius, 0.3 * high), (0.9 * radius, 0.3 * high)]
    pot += [(0.85 * radius, 0.26 * high), (0.0, 0.26 * high)]
    model.add(lathe(pot, 20), PAINT, tint=(0.75, 0.36, 0.22))
    model.put("bar16", (0, 0.2 * high, 0), (0.84 * radius, 0.07 * high, 0.84 * radius), SOIL)
    s = np.linspace(0.0, 1.0, 7)[:, None]
    for i in range(chance.whole(10, 20)):
        lean, size = chance.uniform(0.15, 0.7), chance.uniform(0.6, 1.0)
        along = np.concatenate([lean * s * size, 0.28 + 0.72 * size * (s - 0.5 * lean * s**2), 0.0 * s], axis=1) * high
        half = 0.045 * high * np.sin(np.pi * np.clip(0.1 + 0.87 * s, 0, 1))
        middle = along + np.array((0.02 * high * (i % 3), 0.0, 0.0))
        across, down = half * [0, 0, 1], np.array((0, -0.012 * high, 0))
        blade = solids.sheet(np.stack([middle - across, middle + down, middle + across], axis=1), 0.003 * closed)
        turn = about_y(chance.uniform(0, 6.28))
        model.add(blade, LEAF, turn=turn, closed=closed, tint=chance.uniforms(0.7, 1.2, 3))


def radiator(model: Model, chance: Chance, wide: float) -> None:
    """Add a radiator of round ribs."""
    for x, z in product(np.arange(-0.5 * wide, 0.5 * wide, 0.055), (-0.04, 0.04)):
        model.bar((x, 0.12, z), (x, 0.72, z), 0.018, PAINT)
    for y in (0.14, 0.7):
        model.bar((-0.5 * wide, y, 0), (0.5 * wide, y, 0), 0.03, PAINT, sides=16)
    model.bar((0.5 * wide, 0.14, 0), (0.5 * wide + 0.15, 0.14, 0), 0.012, STEEL)


def lamp(model: Model, chance: Chance, high: float, closed: bool) -> None:
    """Add a standing lamp."""
    model.put("bar28", (0, 0, 0), (0.15, 0.025, 0.15), IRON)
    model.bar((0, 0, 0), (0, high - 0.1, 0), 0.01, IRON)
    profile = [(0.2, -0.14), (0.13, 0.14), (0.126, 0.14), (0.196, -0.14)]
    shade = lathe([*profile, profile[0]] if closed else profile[:2], 28)
    model.add(shade, CLOTH, (0, high - 0.05, 0), closed=closed)
    model.put("ball", (0, high - 0.08, 0), 0.045, PAINT)


def rack(model: Model, chance: Chance, wide: float, high: float) -> None:
    """Add a rack of thin bars, such as for drying or of a cage, with rings on some."""
    for x, z in _corners(0.5 * wide, 0.3):
        model.bar((x, 0, z), (x, high, 0.0), 0.011, STEEL)
    count = chance.whole(7, 14)
    for i, share in enumerate(np.linspace(0.25, 1.0, count)):
        z = 0.3 * (1.0 - share) * (-1.0 if i % 2 else 1.0)
        model.bar((-0.5 * wide, share * high, z), (0.5 * wide, share * high, z), 0.005, STEEL)
        if chance.yes(0.4):
            x, size = chance.uniform(-0.4, 0.4) * wide, chance.uniform(0.05, 0.12)
            ring, place = solids.torus(size, 0.012, 24, 6), (x, share * high - size + 0.012, z)
            model.add(ring, PAINT, place, turn=about_x(0.5 * np.pi), tint=chance.pick(COLOURS))


def leaning_rods(model: Model, chance: Chance, wide: float, high: float) -> None:
    """Add rods and boards that lean at the wall behind, z = -0.2."""
    for _ in range(chance.whole(3, 8)):
        x, foot = chance.uniform(-0.5, 0.5) * wide, chance.uniform(0.05, 0.3)
        top = chance.uniform(0.6, 1.0) * high
        side = chance.uniform(-0.12, 0.12)
        if chance.yes(0.75):
            radius = chance.uniform(0.003, 0.02)
            model.bar((x, 0, foot), (x + side, top, -0.2 + radius), radius, chance.pick((WOOD, STEEL, IRON)))
        else:
            tilt = about_x(-np.arctan((foot + 0.2) / top))
            model.put("box", (x, 0.5 * top, 0.5 * (foot - 0.2)), (0.14, top, 0.02), WOOD, turn=tilt)


def ladder(model: Model, chance: Chance, high: float) -> None:
    """Add a ladder that leans at the wall behind, z = -0.3."""
    ends = [np.array((x, 0.0, 0.25)) for x in (-0.2, 0.2)]
    tops = [np.array((x, high, -0.28)) for x in (-0.17, 0.17)]
    for low, top in zip(ends, tops, strict=True):
        model.bar(low, top, 0.02, WOOD)
    for share in np.arange(0.28, high - 0.1, 0.28) / high:
        model.bar(ends[0] + share * (tops[0] - ends[0]), ends[1] + share * (tops[1] - ends[1]), 0.012, WOOD)


def clutter(model: Model, chance: Chance) -> None:
    """Add something that lies or stands on the floor."""
    kind, tint = chance.whole(0, 5), chance.pick(COLOURS)
    size = chance.uniform(0.1, 0.28)
    if kind == 0:
        y = 0.0
        for _ in range(chance.whole(1, 4)):
            w, h, d = chance.uniforms(0.5, 1.3, 3) * size
            turn = about_y(chance.uniform(0, 3))
            model.put("box", (0, y + 0.5 * h, 0), (w, h, d), PAINT, turn=turn, tint=chance.pick(COLOURS))
            y += h
    elif kind == 1:
        model.put("ball", (0, size, 0), size, PAINT, tint=tint)
    elif kind == 2:
        minor = 0.18 * size
        for i in range(chance.whole(1, 4)):
            place = (0.1 * size * i, minor * (1 + 1.9 * i), 0)
            model.add(solids.torus(size, minor), PAINT, place, tint=0.3 * np.asarray(tint))
    elif kind == 3:
        model.put("bar28", (0, 0, 0), (size, 1.8 * size, size), PAINT, tint=tint)
    elif kind == 4:
        vase(model, chance, 2.5 * size)
    else:
        for _ in range(4):
            x, z = chance.uniforms(-0.3, 0.3, 2)
            angle = chance.uniform(0, 3.1)
            radius = chance.uniform(0.004, 0.025)
            way = np.array((np.cos(angle), 0.0, np.sin(angle))) * chance.uniform(0.2, 0.5)
            middle = np.array((x, radius, z))
            model.bar(middle - way, middle + way, radius, STEEL)
