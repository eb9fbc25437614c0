"""A furnished room: clutter, thin rods and wires, rings, boxes; closed or of single sheets."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from ssgi_cl.core.lights import PointLight

from ..scatter import about_x
from ..shapes import quad
from . import furniture, solids
from .chance import Chance
from .draft import Draft, Ground, indoor_lights, inside_views
from .model import CLOTH, COLOURS, IRON, PAINT, PLASTER, STEEL, WOOD, Model

_THICK = 0.15


def room(chance: Chance) -> Draft:
    """Make a room of 4 to 8 m by 3.6 to 7 m with a window on the side of +x."""
    wide, deep, high = chance.uniform(4, 8), chance.uniform(3.6, 7), chance.uniform(2.5, 3.6)
    closed = chance.yes(0.5)
    model, ground = Model(), Ground()
    _shell(model, chance, wide, deep, high, closed)
    _fittings(model, chance, wide, deep, high, closed)
    _along_walls(model, chance, ground, wide, deep, high, closed)
    _middle(model, chance, ground, wide, deep, closed)
    lamp = PointLight((0.1 * wide, high - 0.5, 0.1 * deep), (9.0, 8.0, 6.5), 0.05)
    lights = indoor_lights(chance, 0.3, lamp)
    heights, aims = (0.9, min(1.8, high - 0.5)), (0.3, 1.1)
    views = inside_views(chance, wide, deep, 60, far=(0.42, 0.2), eye=heights, target=aims, spread=0.6)
    reach, yfov = chance.pick((0.25, 0.4, 0.5)), chance.uniform(0.85, 1.1)
    return Draft(model, views, lights, ao_radius=reach, yfov=yfov, clearance=0.25, coverage=0.9)


def _shell(model: Model, chance: Chance, wide: float, deep: float, high: float, closed: bool) -> None:
    """Add floor, walls, ceiling and the window with its curtains."""
    x, z = 0.5 * wide, 0.5 * deep
    start, end = -0.3 * deep, chance.uniform(0.0, 0.3) * deep
    sill, top = chance.uniform(0.5, 0.95), high - chance.uniform(0.25, 0.5)
    tint = chance.uniforms(0.8, 1.1, 3)
    round_window = ((top, -z), (high, z)), ((sill, -z), (top, start)), ((sill, end), (top, z))
    if closed:
        t = _THICK
        model.box((-x - t, -0.3, -z - t), (x + t, -0.04, z + t), PLASTER)
        model.box((-x - t, high, -z - t), (x + t, high + t, z + t), PLASTER)
        model.box((-x - t, -0.04, -z - t), (x + t, high, -z), PLASTER, tint)
        model.box((-x - t, -0.04, z), (x + t, high, z + t), PLASTER, tint)
        model.box((-x - t, -0.04, -z), (-x, high, z), PLASTER, tint)
        for (y0, z0), (y1, z1) in (((-0.04, -z), (sill, z)), *round_window):
            model.box((x, y0, z0), (x + t, y1, z1), PLASTER, tint)
        _boards(model, chance, x, z)
    else:

        def wall(*corners: tuple[float, float, float]) -> None:
            model.add(quad(corners), PLASTER, tint=tint, closed=False)

        wall((-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z))
        wall((-x, high, -z), (x, high, -z), (x, high, z), (-x, high, z))
        wall((-x, 0, -z), (x, 0, -z), (x, high, -z), (-x, high, -z))
        wall((x, 0, z), (-x, 0, z), (-x, high, z), (x, high, z))
        wall((-x, 0, z), (-x, 0, -z), (-x, high, -z), (-x, high, z))
        for (y0, z0), (y1, z1) in (((0, -z), (sill, z)), *round_window):
            wall((x, y0, z0), (x, y0, z1), (x, y1, z1), (x, y1, z0))
    bars = chance.whole(1, 4)
    for place in np.linspace(start, end, bars + 2):
        model.box((x + 0.05, sill, place - 0.02), (x + 0.09, top, place + 0.02), WOOD)
    model.box((x + 0.05, 0.5 * (sill + top) - 0.02, start), (x + 0.09, 0.5 * (sill + top) + 0.02, end), WOOD)
    model.box((x - 0.1, sill - 0.04, start - 0.1), (x + 0.1, sill, end + 0.1), WOOD)
    rail = top + 0.1
    model.bar((x - 0.08, rail, start - 0.4), (x - 0.08, rail, end + 0.4), 0.012, IRON)
    for ahead, begin in ((1.0, start - 0.35), (-1.0, end + 0.35)):
        if chance.yes(0.7):
            u = np.linspace(0.0, 0.45, 33)[None, :]
            v = np.linspace(rail - 0.02, 0.06, 9)[:, None]
            fold = 0.05 * np.sin(38.0 * u) * (0.6 + 0.1 * (rail - v))
            curtain = np.stack([x - 0.08 + fold, v + 0.0 * u, begin + ahead * u + 0.0 * v], axis=-1)
            model.add(solids.sheet(curtain, 0.006 if closed else 0.0), CLOTH, closed=closed, tint=chance.pick(COLOURS))


def _boards(model: Model, chance: Chance, x: float, z: float) -> None:
    """Add floor boards with gaps, or tiles."""
    width = chance.pick((0.14, 0.2, 0.45))
    length = 0.45 if width > 0.4 else 1.4
    rows = max(round(2 * z / width), 1)
    for row in range(rows):
        low = -z + row * 2 * z / rows
        cuts = np.arange(-x + chance.uniform(0.2, 1.0) * length, x - 0.1, length)
        for left, right in pairwise([-x, *cuts, x]):
            up = (right - 0.004, chance.uniform(-0.002, 0.0), low + 2 * z / rows - 0.004)
            model.box((left, -0.04, low), up, WOOD, chance.uniform(0.75, 1.15))


def _fittings(model: Model, chance: Chance, wide: float, deep: float, high: float, closed: bool) -> None:
    """Add skirting, a door, pictures, pipes, wires and what hangs from the ceiling."""
    x, z = 0.5 * wide, 0.5 * deep
    model.box((-x, 0, -z), (x, 0.1, -z + 0.015), PAINT)
    model.box((-x, 0, z - 0.015), (x, 0.1, z), PAINT)
    model.box((-x, 0, -z), (-x + 0.015, 0.1, z), PAINT)
    door = chance.uniform(-0.3, 0.3) * wide
    model.box((door - 0.45, 0, z - 0.04), (door + 0.45, 2.05, z - 0.016), WOOD)
    for side in (-0.5, 0.5):
        model.box((door + side - 0.05, 0, z - 0.07), (door + side + 0.05, 2.1, z - 0.015), PAINT)
    model.box((door - 0.55, 2.05, z - 0.07), (door + 0.55, 2.15, z - 0.015), PAINT)
    model.bar((door + 0.36, 1.0, z - 0.09), (door + 0.24, 1.0, z - 0.09), 0.01, STEEL)
    if chance.yes(0.4):
        for place in np.linspace(-0.85 * z, 0.85 * z, chance.whole(3, 6)):
            model.box((-x, high - 0.2, place - 0.06), (x, high, place + 0.06), WOOD)
    for _ in range(chance.whole(1, 5)):
        place, y = chance.uniform(-0.8, 0.8) * x, chance.uniform(1.2, high - 0.6)
        w, h = chance.uniforms(0.15, 0.45, 2)
        model.box((place - w, y - h, -z), (place + w, y + h, -z + 0.02), PAINT, chance.pick(COLOURS))
        for sx, sy, ex, ey in ((-w, -h, w, -h), (-w, h, w, h), (-w, -h, -w, h), (w, -h, w, h)):
            model.box((place + sx - 0.02, y + sy - 0.02, -z), (place + ex + 0.02, y + ey + 0.02, -z + 0.035), WOOD)
    for radius in chance.some((0.008, 0.015, 0.03, 0.05), chance.whole(0, 3)):
        y = high - chance.uniform(0.15, 0.5)
        model.bar((-x, y, -z + 0.08), (x, y, -z + 0.08), radius, STEEL, sides=16)
        turn = chance.uniform(-0.7, 0.7) * x
        model.bar((turn, y, -z + 0.08), (turn, 0.1, -z + 0.08), radius, STEEL, sides=16)
        model.put("ball", (turn, y, -z + 0.08), 1.25 * radius, STEEL)
    for _ in range(chance.whole(0, 4)):
        start = (-x, high - chance.uniform(0.1, 0.4), chance.uniform(-0.8, 0.8) * z)
        end = (x, high - chance.uniform(0.1, 0.4), chance.uniform(-0.8, 0.8) * z)
        model.sag(start, end, chance.uniform(0.1, 0.5), chance.uniform(0.0015, 0.008), IRON)
    for _ in range(chance.whole(1, 3)):
        place = (chance.uniform(-0.5, 0.5) * x, high, chance.uniform(-0.5, 0.5) * z)
        drop = chance.uniform(0.5, 0.9)
        with model.at(place):
            model.bar((0, -drop, 0), (0, 0, 0), 0.004, IRON)
            if chance.yes(0.5):
                model.put("ball", (0, -drop, 0), chance.uniform(0.08, 0.2), PAINT)
            else:
                ring = chance.uniform(0.2, 0.4)
                model.add(solids.torus(ring, 0.02, 32), STEEL, (0, -drop, 0))
                for angle in np.arange(5) * 1.2566:
                    tip = (ring * np.cos(angle), -drop, ring * np.sin(angle))
                    model.bar((0, -0.5 * drop, 0), tip, 0.003, IRON, sides=5)
                    model.put("bar8", tip, (0.02, 0.12, 0.02), PAINT)


def _along_walls(
    model: Model, chance: Chance, ground: Ground, wide: float, deep: float, high: float, closed: bool
) -> None:
    """Put furniture with its back to the walls of -z, -x, +x and +z."""
    half_pi = 0.5 * np.pi
    kinds = ("shelves", "cabinet", "sofa", "radiator", "rods", "ladder", "plant", "table", "rack", "lamp")
    for angle in (0.0, half_pi, -half_pi, np.pi):
        length, away = (deep, 0.5 * wide) if abs(angle) == half_pi else (wide, 0.5 * deep)
        for _ in range(chance.whole(4, 7)):
            kind = chance.pick(kinds)
            w, d = {
                "shelves": (chance.uniform(0.7, 1.6), 0.34), "sofa": (1.8, 0.85),
                "cabinet": (chance.uniform(0.6, 1.5), 0.45), "radiator": (1.0, 0.16), "rods": (0.6, 0.45),
                "ladder": (0.45, 0.6), "plant": (0.5, 0.5), "table": (1.3, 0.65), "rack": (0.8, 0.62),
                "lamp": (0.42, 0.42),
            }[kind]  # fmt: skip
            along = chance.uniform(-0.5, 0.5) * (length - w - 0.2)
            inward = away - 0.03 - 0.5 * d
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            x, z = turn @ (along, -inward)
            size = (w, d) if abs(np.cos(angle)) > 0.5 else (d, w)
            if ground.take(float(x), float(z), *size):
                with model.at((x, 0.0, z), angle):
                    _piece(model, chance, kind, w, d, high, closed)


def _piece(model: Model, chance: Chance, kind: str, w: float, d: float, high: float, closed: bool) -> None:
    """Add a piece of furniture, w wide and d deep, in a room so high."""
    tall = min(chance.uniform(0.8, 2.2), high - 0.4)
    {
        "shelves": lambda: furniture.shelves(model, chance, w, max(tall, 1.2), d),
        "cabinet": lambda: furniture.cabinet(model, chance, w, min(tall, 1.9), d),
        "sofa": lambda: furniture.sofa(model, chance, w, d),
        "radiator": lambda: furniture.radiator(model, chance, w - 0.2),
        "rods": lambda: furniture.leaning_rods(model, chance, w - 0.1, high - 0.4),
        "ladder": lambda: furniture.ladder(model, chance, high - 0.5),
        "plant": lambda: furniture.plant(model, chance, tall, closed),
        "table": lambda: furniture.table(model, chance, w, d),
        "rack": lambda: furniture.rack(model, chance, w - 0.05, min(tall, 1.4)),
        "lamp": lambda: furniture.lamp(model, chance, max(tall, 1.3), closed),
    }[kind]()


def _middle(model: Model, chance: Chance, ground: Ground, wide: float, deep: float, closed: bool) -> None:
    """Put a rug, a table with chairs and clutter in the middle of the room."""
    spin = chance.uniform(0.0, 1.57)
    if chance.yes(0.7):
        model.put("box", (0, 0.006, 0), (0.4 * wide, 0.012, 0.4 * deep), CLOTH, tint=chance.pick(COLOURS))
    if chance.yes(0.8):
        x, z = chance.uniform(-0.12, 0.12) * wide, chance.uniform(-0.12, 0.12) * deep
        w, d = chance.uniform(0.9, 1.6), chance.uniform(0.7, 0.9)
        ground.take(x, z, 0.8 * max(w, d), 0.8 * max(w, d))
        with model.at((x, 0.012, z), spin):
            furniture.table(model, chance, w, d)
            for angle in np.arange(chance.whole(1, 4)) * (0.5 * np.pi) + chance.uniform(-0.2, 0.2):
                reach = 0.5 * (d if abs(np.cos(angle)) > 0.5 else w) + 0.12
                seat = (-reach * np.sin(angle), 0.0, -reach * np.cos(angle))
                with model.at(seat, angle + chance.uniform(-0.3, 0.3)):
                    furniture.chair(model, chance)
    inner = (-0.42 * wide, 0.42 * wide, -0.42 * deep, 0.42 * deep)
    for x, z in ground.places(chance, inner, 0.4, 0.4, chance.whole(5, 12)):
        with model.at((x, 0.0, z), chance.uniform(0.0, 6.28)):
            furniture.clutter(model, chance)
    for x, z in ground.places(chance, inner, 0.7, 0.7, int(chance.yes(0.5))):
        with model.at((x, 0.0, z), chance.uniform(0.0, 6.28)):
            _wheel(model, chance)


def _wheel(model: Model, chance: Chance) -> None:
    """Add a large wheel with thin spokes on a stand."""
    radius = chance.uniform(0.28, 0.4)
    model.add(solids.torus(radius, 0.018, 40), IRON, (0, radius + 0.1, 0), turn=about_x(0.5 * np.pi))
    for angle in np.arange(20) * (np.pi / 10):
        tip = (radius * np.cos(angle), radius + 0.1 + radius * np.sin(angle), 0)
        model.bar((0, radius + 0.1, 0.03 * (-1) ** round(angle / (np.pi / 10))), tip, 0.0018, STEEL, sides=5)
    model.bar((0, radius + 0.1, -0.07), (0, radius + 0.1, 0.07), 0.02, STEEL)
    for z, x in product((-0.07, 0.07), (-0.2, 0.2)):
        model.bar((x, 0, 2 * z), (0, radius + 0.1, z), 0.008, IRON)
