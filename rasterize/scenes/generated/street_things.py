"""Furniture of streets, facing +z: lamps, bins, benches, bicycles, bollards, crates, cars."""

from __future__ import annotations

import numpy as np

from ...parts import complete
from ..scatter import about_x, rotation
from . import furniture, solids
from .chance import Chance
from .model import COLOURS, GLASS, IRON, PAINT, STEEL, WOOD, Model


def street_light(model: Model, chance: Chance) -> None:
    """Add a lamp on a post."""
    high = chance.uniform(3.2, 4.5)
    model.bar((0, 0, 0), (0, 0.5, 0), 0.09, IRON, sides=16)
    model.bar((0, 0.5, 0), (0, high, 0), 0.04, IRON, sides=16)
    model.bar((0, high - 0.3, 0), (0, high, 0.5), 0.018, IRON)
    model.bar((0, high, 0), (0, high, 0.9), 0.025, IRON)
    model.put("ball", (0, high - 0.16, 0.85), 0.13, PAINT)
    model.put("cone", (0, high - 0.12, 0.85), (0.2, 0.16, 0.2), IRON)


def waste_bin(model: Model, chance: Chance) -> None:
    """Add a round bin."""
    model.put("bar16", (0, 0, 0), (0.25, 0.85, 0.25), STEEL, tint=chance.pick(COLOURS))
    model.add(solids.torus(0.25, 0.02), IRON, (0, 0.85, 0))


def bench(model: Model, chance: Chance) -> None:
    """Add a bench of slats."""
    for i in range(4):
        model.box((-0.8, 0.42, -0.1 + 0.12 * i), (0.8, 0.45, -0.01 + 0.12 * i), WOOD)
    for i in range(3):
        model.box((-0.8, 0.55 + 0.14 * i, -0.16), (0.8, 0.64 + 0.14 * i, -0.13), WOOD)
    for x in (-0.65, 0.65):
        model.bar((x, 0, 0.3), (x, 0.42, 0.28), 0.02, IRON)
        model.bar((x, 0, -0.1), (x, 0.95, -0.15), 0.02, IRON)
        model.bar((x, 0.41, -0.1), (x, 0.41, 0.34), 0.015, IRON)


def bicycle(model: Model, chance: Chance) -> None:
    """Add a bicycle: two wheels with thin spokes and a frame of tubes."""
    upright, tint = about_x(0.5 * np.pi), chance.pick(COLOURS)
    with model.at((0, 0, 0.1), 0.0, about_x(0.12)):
        for x in (-0.52, 0.52):
            model.add(solids.torus(0.32, 0.017, 36, 6), IRON, (x, 0.34, 0), turn=upright)
            for angle in np.arange(16) * (np.pi / 8):
                tip = (x + 0.31 * np.cos(angle), 0.34 + 0.31 * np.sin(angle), 0)
                model.bar((x, 0.34, 0.0), tip, 0.0015, STEEL, sides=5)
        rear, crank, saddle, front = (-0.52, 0.34), (-0.05, 0.3), (-0.2, 0.75), (0.52, 0.34)
        tubes = (rear, crank), (crank, (0.38, 0.75)), (crank, (-0.2, 0.8)), (saddle, (0.38, 0.78)), (rear, saddle)
        for start, end in (*tubes, (front, (0.36, 0.9))):
            model.bar((*start, 0), (*end, 0), 0.015, PAINT, tint=tint)
        model.put("cushion", (-0.22, 0.85, 0), (0.13, 0.03, 0.07), IRON)
        model.bar((0.36, 0.9, -0.25), (0.36, 0.9, 0.25), 0.012, STEEL)


def bollards(model: Model, chance: Chance) -> None:
    """Add bollards joined by chains."""
    for x in (-0.8, 0.0, 0.8):
        model.bar((x, -0.05, -0.2), (x, 0.8, -0.2), 0.05, IRON, sides=16)
        model.put("ball", (x, 0.84, -0.2), 0.07, IRON)
    link = complete(solids.torus(0.03, 0.007, 12, 5))
    share = np.linspace(0.0, 1.0, 15)
    turns = rotation((1, 0, 0), 0.5 * np.pi * (np.arange(15) % 2)) @ about_x(0.5 * np.pi)
    for start in (-0.8, 0.0):
        at = np.stack([start + 0.8 * share, 0.7 - 0.8 * share * (1 - share), 0.0 * share - 0.2], axis=1)
        model.scatter(link, STEEL, at, turns=turns)


def crates(model: Model, chance: Chance) -> None:
    """Add crates of fruit."""
    for i in range(chance.whole(2, 5)):
        with model.at((0.5 * (i % 3) - 0.5, 0.36 * (i // 3), chance.uniform(-0.1, 0.1)), chance.uniform(-0.2, 0.2)):
            for y in (0.02, 0.13, 0.24):
                for z in (-0.15, 0.15):
                    model.box((-0.22, y, z - 0.008), (0.22, y + 0.08, z + 0.008), WOOD)
                for x in (-0.22, 0.22):
                    model.box((x - 0.008, y, -0.15), (x + 0.008, y + 0.08, 0.15), WOOD)
            model.box((-0.22, 0.0, -0.15), (0.22, 0.015, 0.15), WOOD)
            for _ in range(5):
                place = (chance.uniform(-0.14, 0.14), 0.2, chance.uniform(-0.08, 0.08))
                model.put("ball", place, 0.06, PAINT, tint=chance.pick(COLOURS))
    with model.at((1.1, 0, 0)):
        furniture.clutter(model, chance)


def car(model: Model, chance: Chance) -> None:
    """Add a car 4.2 m long along z."""
    tint = chance.pick(COLOURS)
    model.put("cushion", (0, 0.62, 0), (0.85, 0.32, 2.1), PAINT, tint=tint)
    model.put("cushion", (0, 1.08, -0.15), (0.72, 0.34, 1.15), GLASS)
    model.put("cushion", (0, 1.36, -0.15), (0.62, 0.07, 0.85), PAINT, tint=tint)
    side = rotation((0, 0, 1), 0.5 * np.pi)[0]
    for x in (-0.78, 0.78):
        for z in (-1.3, 1.3):
            model.add(solids.torus(0.24, 0.09, 28, 8), IRON, (x, 0.33, z), turn=side)
            model.put("bar16", (x + 0.06, 0.33, z), (0.17, 0.12, 0.17), STEEL, turn=side)
        model.bar((x, 0.55, 2.0), (x, 0.55, 2.1), 0.1, PAINT, sides=16)
        model.box((x * 1.05 - 0.02, 0.6, 0.1), (x * 1.05 + 0.02, 0.64, 0.3), STEEL)
        model.box((x * 1.12 - 0.07, 0.92, 0.7), (x * 1.12 + 0.07, 1.06, 0.78), PAINT, tint)
    for z in (-2.12, 2.12):
        model.box((-0.8, 0.36, z - 0.05), (0.8, 0.48, z + 0.05), STEEL)
