"""Chambers behind one another: thick walls, pillars, steps, solid furniture, few slender things."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import PointLight

from . import furniture, solids
from .chance import Chance
from .draft import Draft, Ground, indoor_lights, inside_views
from .model import CLOTH, COLOURS, PLASTER, STONE, WOOD, Model

_OUTER = 0.35
"""Thickness of outer walls, metres."""


def chambers(chance: Chance) -> Draft:
    """Make chambers of 6 to 10 m by 9 to 15 m in all, open to the sun at +x; closed meshes."""
    wide, deep, high = chance.uniform(6, 10), chance.uniform(9, 15), chance.uniform(2.8, 4.8)
    model, ground = Model(), Ground()
    _shell(model, chance, wide, deep, high)
    for z in _partitions(chance, deep):
        _partition(model, chance, ground, wide, high, z)
    if chance.yes(0.6):
        _pillars(model, chance, ground, wide, deep, high)
    if chance.yes(0.6):
        _steps(model, chance, ground, wide, deep)
    _furnish(model, chance, ground, wide, deep)
    for _ in range(chance.whole(0, 3)):
        _drape(model, chance, ground, wide, deep, high)
    lamp = PointLight((0.1 * wide, high - 0.4, 0.12 * deep), (24.0, 21.0, 17.0), 0.05)
    lights = indoor_lights(chance, 0.4, lamp)
    heights, aims = (1.1, min(2.2, high - 0.6)), (0.5, 1.4)
    views = inside_views(chance, wide, deep, 80, far=(0.4, 0.22), eye=heights, target=aims, spread=0.8)
    reach, yfov = chance.pick((0.35, 0.5, 0.7)), chance.uniform(0.85, 1.1)
    return Draft(model, views, lights, ao_radius=reach, yfov=yfov, clearance=0.25, coverage=0.9)


def _shell(model: Model, chance: Chance, wide: float, deep: float, high: float) -> None:
    """Add floor, ceiling with beams, and walls with deep windows on the side of +x."""
    x, z, t = 0.5 * wide, 0.5 * deep, _OUTER
    tint = chance.uniforms(0.8, 1.1, 3)
    model.box((-x - t, -0.3, -z - t), (x + t, 0.0, z + t), STONE)
    model.box((-x - t, high, -z - t), (x + t, high + t, z + t), PLASTER)
    model.box((-x - t, 0.0, -z - t), (x + t, high, -z), PLASTER, tint)
    model.box((-x - t, 0.0, z), (x + t, high, z + t), PLASTER, tint)
    model.box((-x - t, 0.0, -z), (-x, high, z), PLASTER, tint)
    sill, top = chance.uniform(0.5, 1.0), high - chance.uniform(0.3, 0.7)
    model.box((x, 0.0, -z), (x + t, sill, z), PLASTER, tint)
    model.box((x, top, -z), (x + t, high, z), PLASTER, tint)
    count = chance.whole(2, 4)
    ends = np.linspace(-z, z, count + 1)
    pier = chance.uniform(0.25, 0.4) * 2.0 * z / count
    for end in ends:
        model.box((x, sill, max(end - pier, -z)), (x + t, top, min(end + pier, z)), PLASTER, tint)
    if chance.yes(0.5):
        thick = chance.uniform(0.15, 0.3)
        for place in np.linspace(-0.9 * z, 0.9 * z, chance.whole(4, 8)):
            model.box((-x, high - 1.2 * thick, place - 0.5 * thick), (x, high, place + 0.5 * thick), WOOD)
    for side in (-z, z):  # pilasters
        for place in np.linspace(-0.8 * x, 0.8 * x, chance.whole(2, 5)):
            deeper = np.sign(side) * chance.uniform(0.12, 0.3)
            half = chance.uniform(0.15, 0.3)
            low, up = sorted((side, side - deeper))
            model.box((place - half, 0.0, low), (place + half, high, up), PLASTER, tint)


def _partitions(chance: Chance, deep: float) -> list[float]:
    """Return where walls across stand."""
    if chance.yes(0.4):
        return [chance.uniform(-0.12, 0.12) * deep]
    return [chance.uniform(-0.25, -0.15) * deep, chance.uniform(0.15, 0.25) * deep]


def _partition(model: Model, chance: Chance, ground: Ground, wide: float, high: float, z: float) -> None:
    """Add a thick wall across, with one or two openings up to a lintel."""
    x, half = 0.5 * wide, 0.5 * chance.uniform(0.25, 0.6)
    tint = chance.uniforms(0.8, 1.1, 3)
    lintel = min(chance.uniform(2.1, 3.0), high - 0.3)
    model.box((-x, lintel, z - half), (x, high, z + half), PLASTER, tint)
    edges = [-x]
    for middle in (0.0,) if chance.yes(0.5) else (-0.5 * x, 0.5 * x):
        place, opening = middle + chance.uniform(-0.1, 0.1) * x, 0.5 * chance.uniform(1.1, 2.2)
        edges += [place - opening, place + opening]
    edges.append(x)
    for left, right in zip(edges[::2], edges[1::2], strict=True):
        model.box((left, 0.0, z - half), (right, lintel, z + half), PLASTER, tint)
    ground.take(0.0, z, wide, 2.0 * half + 0.4)


def _pillars(model: Model, chance: Chance, ground: Ground, wide: float, deep: float, high: float) -> None:
    """Add two rows of pillars, square or round, with plinths and slabs on top."""
    half = 0.5 * chance.uniform(0.3, 0.6)
    square = chance.yes(0.5)
    for x in (-0.27 * wide, 0.27 * wide):
        for z in np.linspace(-0.4, 0.4, chance.whole(3, 5)) * deep:
            if not ground.take(x, float(z), 2.6 * half, 2.6 * half):
                continue
            if square:
                model.box((x - half, 0.0, z - half), (x + half, high, z + half), STONE)
            else:
                model.bar((x, 0.0, z), (x, high, z), half, STONE, sides=28)
            wider = 1.3 * half
            for low, up in ((0.0, 0.25), (high - 0.2, high)):
                model.box((x - wider, low, z - wider), (x + wider, up, z + wider), STONE)


def _steps(model: Model, chance: Chance, ground: Ground, wide: float, deep: float) -> None:
    """Add solid steps up to a platform in a corner."""
    rise, tread, count = chance.uniform(0.14, 0.2), chance.uniform(0.26, 0.36), chance.whole(3, 7)
    broad, top = chance.uniform(1.0, 2.2), chance.uniform(0.8, 1.6)
    length = count * tread + top
    x, side = 0.5 * wide - 0.5 * length, chance.pick((-1.0, 1.0))
    z = side * (0.5 * deep - 0.5 * broad)
    if not ground.take(-x, z, length, broad):
        return
    for i in range(count):
        end = -0.5 * wide + length - i * tread
        model.box((-0.5 * wide, i * rise, z - 0.5 * broad), (end, (i + 1) * rise, z + 0.5 * broad), STONE)


def _furnish(model: Model, chance: Chance, ground: Ground, wide: float, deep: float) -> None:
    """Put solid furniture, blocks and a few tables with chairs."""
    inner = (-0.47 * wide, 0.47 * wide, -0.47 * deep, 0.47 * deep)
    sizes = {
        "cabinet": (1.2, 0.5), "chest": (1.0, 0.6), "sofa": (1.8, 0.9), "blocks": (1.1, 1.1),
        "counter": (2.0, 0.7), "table": (2.2, 2.2), "vase": (0.6, 0.6), "plant": (0.7, 0.7),
    }  # fmt: skip
    for _ in range(chance.whole(14, 24)):
        kind = chance.pick(tuple(sizes))
        size, across = sizes[kind], chance.yes(0.5)
        for x, z in ground.places(chance, inner, *(size if across else size[::-1])):
            turn = chance.pick((0.0, np.pi)) + (0.0 if across else 0.5 * np.pi)
            with model.at((x, 0.0, z), turn):
                _piece(model, chance, kind, *size)


def _piece(model: Model, chance: Chance, kind: str, w: float, d: float) -> None:
    """Add a piece of furniture, w wide and d deep."""
    tint = chance.pick(COLOURS)
    if kind == "cabinet":
        furniture.cabinet(model, chance, w, chance.uniform(1.0, 2.2), d)
    elif kind == "chest":
        high = chance.uniform(0.4, 0.7)
        model.box((-0.5 * w, 0.0, -0.5 * d), (0.5 * w, high, 0.5 * d), WOOD)
        model.box((-0.53 * w, high, -0.53 * d), (0.53 * w, high + 0.08, 0.53 * d), WOOD, 0.8)
    elif kind == "sofa":
        furniture.sofa(model, chance, w, d)
    elif kind == "blocks":
        for x, z in ((-0.25, -0.25), (0.3, -0.2), (-0.1, 0.3)):
            half, high = 0.5 * chance.uniform(0.3, 0.6), chance.uniform(0.3, 1.3)
            model.box((x - half, 0.0, z - half), (x + half, high, z + half), WOOD, chance.pick(COLOURS))
    elif kind == "counter":
        model.box((-0.48 * w, 0.0, -0.4 * d), (0.48 * w, 0.86, 0.4 * d), WOOD, tint)
        model.box((-0.5 * w, 0.86, -0.5 * d), (0.5 * w, 0.92, 0.5 * d), STONE)
        with model.at((0.0, 0.92, 0.0)):
            furniture.trinket(model, chance)
    elif kind == "table":
        furniture.table(model, chance, 1.4, 0.9)
        for angle in (0.0, np.pi):
            with model.at((-0.65 * np.sin(angle), 0.0, -0.65 * np.cos(angle)), angle):
                furniture.chair(model, chance)
    elif kind == "vase":
        furniture.vase(model, chance, chance.uniform(0.5, 1.1))
    else:
        furniture.plant(model, chance, chance.uniform(0.8, 1.6), closed=True)


def _drape(model: Model, chance: Chance, ground: Ground, wide: float, deep: float, high: float) -> None:
    """Hang a folded cloth from the ceiling, 1 cm thick."""
    broad = chance.uniform(0.8, 1.6)
    for x, z in ground.places(chance, (-0.4 * wide, 0.4 * wide, -0.4 * deep, 0.4 * deep), 0.4, broad):
        u = np.linspace(-0.5 * broad, 0.5 * broad, 41)[None, :]
        v = np.linspace(high, chance.uniform(0.3, 1.2), 9)[:, None]
        fold = chance.uniform(0.04, 0.1) * np.sin(chance.uniform(9.0, 22.0) * u) * (0.7 + 0.1 * v)
        cloth = np.stack([x + fold, v + 0.0 * u, z + u + 0.0 * v], axis=-1)
        model.add(solids.sheet(cloth, 0.01), CLOTH, closed=True, tint=chance.pick(COLOURS))
