"""A terrace in the open: paving, a dry wall, thin railings, a pergola, trees, rocks and reeds.

Metres; the terrace is 7 m wide (x) and 5 m deep (z), 0.6 m above the ground round it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment
from ssgi_cl.core.scene import Material

from ..parts import Part, assemble, complete
from .builtin import BuiltinScene
from .furnishings import railing
from .scatter import Doubles, between, copies, noise, rotation, shares
from .shapes import beam, box, grid, joined, lathe, mesh, moved, of_material, of_materials, pole, rounded, tube, turned

_MATERIALS = (
    Material(name="ground", albedo=(0.42, 0.36, 0.25)),
    Material(name="stone", albedo=(0.58, 0.54, 0.48)),
    Material(name="iron", albedo=(0.08, 0.09, 0.10), specular=(0.1, 0.1, 0.1), gloss=30.0),
    Material(name="wood", albedo=(0.45, 0.31, 0.20)),
    Material(name="leaf", albedo=(0.22, 0.38, 0.10)),
    Material(name="bark", albedo=(0.26, 0.20, 0.15)),
    Material(name="terracotta", albedo=(0.62, 0.29, 0.17)),
    Material(name="reed", albedo=(0.42, 0.46, 0.16)),
)
_GROUND, _STONE, _IRON, _WOOD, _LEAF, _BARK, _TERRACOTTA, _REED = range(len(_MATERIALS))

_WIDE, _DEEP, _HIGH = 7.0, 5.0, 0.6


def terrace() -> BuiltinScene:
    """Make the terrace: about 147,000 triangles under an open sky, always the same."""
    parts = [_land(), *_paving(), *_rails(), *_pergola(), *_furniture(), *_trees(), *_rocks(), _reeds()]
    return BuiltinScene(
        name="terrace",
        scene=assemble(parts, _MATERIALS),
        eye=(-5.6, 2.6, 5.4),
        target=(0.3, 0.9, -0.6),
        yfov=0.90,
        lights=(
            DirectionalLight(direction=(0.55, -0.62, -0.56), irradiance=(18.0, 15.5, 12.0)),
            Environment(radiance=(0.85, 1.1, 1.5)),
        ),
        ao_radius=0.5,
        more_views=(
            ((2.9, 1.9, 1.9), (-2.2, 0.9, -1.6)),  # on the terrace
            ((5.4, 1.1, 4.6), (1.2, 0.7, -0.5)),  # from among the rocks
        ),
    )


def _ground(x: Doubles, z: Doubles) -> Doubles:
    """Return the height of the land: rough, flat under the terrace, rising to hills far away."""
    away = np.hypot(np.maximum(np.abs(x) - 0.5 * _WIDE, 0.0), np.maximum(np.abs(z) - 0.5 * _DEEP, 0.0))
    rough = 0.5 * noise(1, 0.35 * x + 20.0, 0.35 * z + 20.0) + 0.22 * noise(2, x + 20.0, z + 20.0)
    rough += 0.07 * noise(3, 3.1 * x + 50.0, 3.1 * z + 50.0) - 0.35
    hills = 0.035 * np.maximum(away - 3.0, 0.0) ** 1.7
    hills = hills * (0.6 + 0.8 * noise(4, 0.2 * x + 9.0, 0.2 * z + 9.0))
    height: Doubles = np.clip(away / 1.5, 0.15, 1.0) * rough + hills
    return height


def _land() -> Part:
    side = np.sinh(np.linspace(-2.2, 2.2, 131)) / np.sinh(2.2) * 14.0  # fine in the middle
    x, z = np.meshgrid(side, side[::-1])
    return of_material(grid(np.stack([x, _ground(x, z), z], axis=-1)), _GROUND)


def _stones(seed: int, middles: Doubles, sizes: Doubles) -> Part:
    """Return rough blocks with tilts, sizes and shades that vary a little."""
    count = len(middles)
    turns = rotation((0.0, 1.0, 0.0), between(seed, -0.03, 0.03, count))
    turns = turns @ rotation((0.3, 0.0, 1.0), between(seed + 1, -0.012, 0.012, count))
    shade = between(seed + 2, 0.72, 1.1, count, 1) * [1.0, 0.98, 0.95]
    unit = beam((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    return of_material(copies(unit, middles, turns=turns, scales=sizes, tints=shade), _STONE)


def _paving() -> list[Part]:
    """Return the core of the terrace, flagstones, the dry wall round it and the steps."""
    core = box((-0.5 * _WIDE + 0.1, -0.6, -0.5 * _DEEP + 0.1), (0.5 * _WIDE - 0.1, _HIGH - 0.06, 0.5 * _DEEP - 0.1))
    columns, rows = 12, 9
    row, column = np.divmod(np.arange(rows * columns), columns)
    cell = np.array([_WIDE / columns, 0.06, _DEEP / rows])
    heights = _HIGH - 0.03 + between(10, -0.006, 0.006, len(row))
    x, z = (column + 0.5) * cell[0] - 0.5 * _WIDE, (row + 0.5) * cell[2] - 0.5 * _DEEP
    flags = np.column_stack([x, heights, z])
    gaps = np.column_stack([between(11, 0.012, 0.03, len(row)), 0.0 * row, between(12, 0.012, 0.03, len(row))])
    middles, sizes = [], []
    for course in range(4):
        y = _HIGH - 0.06 - 0.15 * (course + 0.5)
        for length, axis, side in ((_WIDE, 0, 1.0), (_WIDE, 0, -1.0), (_DEEP, 2, 1.0), (_DEEP, 2, -1.0)):
            cuts = np.linspace(-0.5 * length, 0.5 * length, 17)
            cuts[1:-1] += between(60 + course + 4 * axis + int(20 * side), -0.12, 0.12, 15)
            across = side * (0.5 * (_DEEP if axis == 0 else _WIDE) - 0.12)
            for start, end in pairwise(cuts):
                along = 0.5 * (start + end)
                middles.append((along, y, across) if axis == 0 else (across, y, along))
                extent = end - start - 0.015
                sizes.append((extent, 0.138, 0.25) if axis == 0 else (0.25, 0.138, extent))
    bulge = between(13, 0.94, 1.1, len(middles), 1)
    steps = np.array([(-1.9, 0.15 * (i + 0.5) - 0.02, 0.5 * _DEEP + 0.30 * (4 - i) - 0.15) for i in range(4)])
    return [
        of_material(core, _STONE),
        _stones(14, flags, cell - gaps),
        _stones(17, np.array(middles), np.array(sizes) * np.where(np.arange(3) == 1, 1.0, bulge)),
        _stones(20, steps, np.tile([1.6, 0.15, 0.34], (4, 1))),
    ]


def _rails() -> list[Part]:
    """Return railings of 16 mm bars on two sides and two strained wires on a third."""
    x, z = 0.5 * _WIDE - 0.1, 0.5 * _DEEP - 0.1
    end = complete(railing(x, _HIGH, 0.95, -z, z))
    back = turned(complete(railing(z, _HIGH, 0.95, -x, x)), 0.5 * np.pi)
    parts = [end, back]
    x, reach = -x, z
    for z in np.linspace(-reach, reach, 4):
        parts.append(pole((x, _HIGH, z), (x, _HIGH + 0.9, z), 0.02, 10))
    for y in (0.3, 0.6, 0.88):
        parts.append(pole((x, _HIGH + y, -reach), (x, _HIGH + y, reach), 0.005, 6))
    return of_materials((parts, _IRON))


def _pergola() -> list[Part]:
    x0, x1, z0, z1, top = -0.3, 3.0, -2.1, 0.9, _HIGH + 2.3
    parts = [beam((x - 0.06, _HIGH, z - 0.06), (x + 0.06, top, z + 0.06)) for x in (x0, x1) for z in (z0, z1)]
    parts += [beam((x0 - 0.3, top, z - 0.04), (x1 + 0.3, top + 0.14, z + 0.04)) for z in (z0, z1)]
    slat = beam((-0.025, top + 0.1, z0 - 0.35), (0.025, top + 0.2, z1 + 0.35))
    parts.append(copies(slat, [(x, 0.0, 0.0) for x in np.linspace(x0 - 0.2, x1 + 0.2, 14)]))
    for x in (x0, x1):
        for z, way in ((z0, 1.0), (z1, -1.0)):
            parts.append(pole((x, top - 0.5, z), (x, top, z + 0.5 * way), 0.035, 4))
    return of_materials((parts, _WOOD))


def _furniture() -> list[Part]:
    """Return a table, chairs with thin legs, crockery and pots of plants."""
    top = _HIGH + 0.74
    legs = [(x, z) for x in (0.75, 2.05) for z in (-1.22, -0.58)]
    iron = [pole((x, _HIGH, z), (1.4 + 0.8 * (x - 1.4), top - 0.03, z), 0.012) for x, z in legs]
    chair = [box((-0.21, 0.43, -0.2), (0.21, 0.45, 0.2))]
    chair += [box((-0.2, y, -0.225), (0.2, y + 0.05, -0.21)) for y in (0.58, 0.68, 0.78)]
    frame = [pole((x, 0.0, 0.18), (x, 0.43, 0.17), 0.01) for x in (-0.19, 0.19)]
    frame += [pole((x, 0.0, -0.2), (x, 0.85, -0.23), 0.01) for x in (-0.19, 0.19)]
    seats = complete(joined(of_materials((chair, _WOOD), (frame, _IRON))))
    where = [(1.0, _HIGH, -1.65), (1.8, _HIGH, -1.62), (1.1, _HIGH, -0.15), (2.0, _HIGH, 0.1)]
    chairs = copies(seats, where, turns=rotation((0.0, 1.0, 0.0), [0.1, -0.2, 3.0, 2.4]))
    cup = [(0.0, 0.0), (0.03, 0.0), (0.035, 0.05), (0.045, 0.1), (0.04, 0.1), (0.03, 0.05), (0.0, 0.012)]
    plate = [(0.0, 0.0), (0.07, 0.0), (0.12, 0.018), (0.115, 0.02), (0.07, 0.006), (0.0, 0.006)]
    plates, cups = ((1.0, -1.08), (1.8, -1.06), (1.15, -0.72)), ((1.2, -1.1), (1.95, -0.9), (1.38, -0.68))
    crockery = [moved(lathe(plate, 32), x, top, z) for x, z in plates]
    crockery += [moved(lathe(rounded(cup, 3), 24), x, top, z) for x, z in cups]
    pot = rounded(
        [(0.0, 0.0), (0.14, 0.0), (0.19, 0.2), (0.23, 0.36), (0.26, 0.37), (0.26, 0.42), (0.22, 0.42), (0.2, 0.34),
         (0.0, 0.33)], 3,
    )  # fmt: skip
    places = np.array([(-3.0, -1.9), (-2.2, -2.1), (-3.0, 1.6), (-0.6, 2.1), (3.0, 2.0)])
    places = np.insert(places, 1, _HIGH, axis=1)
    scales = np.array([1.1, 0.7, 1.25, 0.8, 1.0])
    pots = copies(complete(lathe(pot, 32)), places, scales=scales)
    above = zip(places + 0.62 * scales[:, None] * [0.0, 1.0, 0.0], scales, strict=True)
    return [
        of_material(box((0.7, top - 0.03, -1.3), (2.1, top, -0.5)), _WOOD),
        *of_materials((iron, _IRON)),
        chairs,
        *of_materials((crockery, _STONE), ([pots], _TERRACOTTA)),
        *[_foliage(90 + i, place, 0.3 * scale, 130) for i, (place, scale) in enumerate(above)],
    ]


def _foliage(seed: int, middle: Doubles, radius: float, count: int, size: float = 0.09) -> Part:
    """Return leaves, solid and 8 % as thick as long, that fill a ball, its rim the most."""
    height = between(seed, -1.0, 1.0, count)
    turn = between(seed + 1000, 0.0, 2.0 * np.pi, count)
    ring = np.sqrt(1.0 - height**2)
    outward = np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)
    places = middle + radius * between(seed + 2000, 0.15, 1.0, count, 1) ** 0.4 * outward
    leaf = mesh(
        [(0, 0, 0), (0.28, 0, 0.45), (0, 0, 1), (-0.28, 0, 0.45), (0, 0.08, 0.45), (0, -0.04, 0.45)],
        [(0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0), (1, 5, 0), (2, 5, 1), (3, 5, 2), (0, 5, 3)],
    )
    # Each leaf points outwards and down, turned about by chance.
    turns = (
        rotation((0.0, 1.0, 0.0), 0.5 * np.pi - turn)
        @ rotation((1.0, 0.0, 0.0), between(seed + 3000, -0.2, 1.1, count))
        @ rotation((0.0, 0.0, 1.0), between(seed + 4000, -0.8, 0.8, count))
    )
    shade = between(seed + 5000, 0.6, 1.25, count, 1) * [1.0, 1.0, 0.9]
    scales = size * between(seed + 6000, 0.7, 1.4, count)
    return of_material(copies(complete(leaf, 0.1), places, turns=turns, scales=scales, tints=shade), _LEAF)


def _trees() -> list[Part]:
    """Return three trees: a bent trunk, branches, and a cloud of leaves at the end of each."""
    parts = []
    for tree, (x, z, tall, leaves) in enumerate(((-4.6, -1.2, 3.6, 150), (1.4, -4.4, 4.4, 170), (5.2, 0.4, 2.8, 130))):
        base = np.array([x, float(_ground(np.array(x), np.array(z))) - 0.1, z])
        s = np.linspace(0.0, 1.0, 13)
        bend = 0.25 * np.sin(2.4 * s + tree)[:, None] * [1.0, 0.0, 0.0]
        path = base + tall * 0.75 * s[:, None] * [0.0, 1.0, 0.0] + bend - bend[0]
        trunk = tube(path, (0.0, 0.0, 1.0), 0.035 * tall, 12)
        parts.append(of_material(trunk, _BARK))
        for branch in range(10):
            a = 2.4 * branch + tree
            start = path[6 + branch * 6 // 9]
            way = np.array([np.cos(a), 0.55 + 0.05 * branch, np.sin(a)])
            end = start + tall * (0.30 - 0.012 * branch) * way
            parts.append(of_material(pole(start, end, 0.012 * tall, 7), _BARK))
            parts.append(_foliage(200 + 20 * tree + branch, end, 0.15 * tall, leaves, 0.13))
    return parts


def _rocks() -> list[Part]:
    """Return rocks of all sizes, sunk into the ground, denser near the terrace."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 15)
    parts = []
    for kind in range(3):

        def dented(angle: Doubles, height: Doubles, kind: int = kind) -> Doubles:
            spin = np.cos(angle) * 1.3 + 7.0 * kind + 3.0
            lumps: Doubles = 0.65 + 0.6 * noise(70 + kind, spin + height, np.sin(angle) * 1.3 + 5.0)
            return lumps

        profile = np.stack([np.cos(turn), 0.75 * np.sin(turn)], axis=1)
        rock = complete(lathe(profile, 22, shape=dented))
        count = 26
        angle = between(75 + kind, 0.0, 2.0 * np.pi, count)
        far = 1.0 + 0.9 * shares(80 + kind, count) ** 1.5
        x, z = far * (0.62 * _WIDE) * np.cos(angle), far * (0.72 * _DEEP) * np.sin(angle)
        size = 0.06 + 0.42 * shares(85 + kind, count) ** 2.5
        places = np.column_stack([x, _ground(x, z) + 0.25 * size, z])
        shade = between(88 + kind, 0.6, 1.05, count, 1) * [1.0, 1.0, 1.0]
        turns = rotation((0.0, 1.0, 0.0), 5.0 * angle)
        rocks = copies(rock, places, turns=turns, scales=size, tints=shade)
        parts.append(of_material(rocks, _STONE))
    return parts


def _reeds() -> Part:
    """Return tufts of thin blades on the ground, each blade a long three-sided pyramid."""
    corners = [(-0.5, 0.0, 0.2), (0.5, 0.0, 0.2), (0.0, 0.0, -0.4), (0.0, 1.0, 0.0)]
    blade = complete(mesh(corners, [(0, 1, 3), (1, 2, 3), (2, 0, 3)]), 0.1)
    tufts, each = 70, 26
    angle, far = between(100, 0.0, 2.0 * np.pi, tufts), 1.0 + 0.8 * shares(101, tufts)
    x = np.repeat(far * 0.60 * _WIDE * np.cos(angle), each)
    z = np.repeat(far * 0.68 * _DEEP * np.sin(angle), each)
    x, z = x + between(102, -0.16, 0.16, len(x)), z + between(103, -0.16, 0.16, len(x))
    places = np.column_stack([x, _ground(x, z) - 0.02, z])
    turns = rotation((0.0, 1.0, 0.0), between(104, 0.0, 6.0, len(x)))
    turns = turns @ rotation((1.0, 0.0, 0.0), between(105, -0.45, 0.45, len(x)))
    wide = between(106, 0.010, 0.018, len(x))
    sizes = np.column_stack([wide, between(107, 0.2, 0.62, len(x)), wide])
    shade = between(108, 0.6, 1.2, len(x), 1) * [1.0, 1.0, 1.0]
    return of_material(copies(blade, places, turns=turns, scales=sizes, tints=shade), _REED)
