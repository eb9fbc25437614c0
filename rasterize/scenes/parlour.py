"""A parlour: two plain rooms with an arch between them and large, simple furniture.

Metres; the front room is 5 m wide (x), 4.4 m deep (z) and 2.7 m high, the back room lies behind
-z. Where the workshop and the terrace are full of thin things, this has walls, corners and bulk.
"""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import Environment, SpotLight
from ssgi_cl.core.scene import Material

from ..parts import Part, assemble
from .builtin import BuiltinScene
from .scatter import between
from .shapes import ball, box, grid, lathe, moved, of_materials, rounded, turned

_MATERIALS = (
    Material(name="wall", albedo=(0.78, 0.75, 0.68)),
    Material(name="floor", albedo=(0.42, 0.30, 0.20)),
    Material(name="cloth", albedo=(0.20, 0.33, 0.42)),
    Material(name="wood", albedo=(0.50, 0.33, 0.19)),
    Material(name="book", albedo=(0.60, 0.22, 0.15)),
    Material(name="clay", albedo=(0.70, 0.45, 0.32)),
)
_WALL, _FLOOR, _CLOTH, _WOOD, _BOOK, _CLAY = range(len(_MATERIALS))

_X, _Z, _TOP, _BACK, _THICK = 2.5, 2.2, 2.7, -5.2, 0.25


def parlour() -> BuiltinScene:
    """Make the parlour: about 20,000 triangles, always the same; a lamp under each ceiling."""
    parts = [*_rooms(), *_arch(), *_sofa(), *_table(), *_bookcase(), *_steps()]
    return BuiltinScene(
        name="parlour",
        scene=assemble(parts, _MATERIALS),
        eye=(1.9, 1.6, 1.9),
        target=(-0.7, 0.75, -1.2),
        yfov=1.0,
        lights=(
            SpotLight((0.0, 2.6, 0.4), (0.0, -1.0, 0.0), 1.3, (9.0, 8.0, 6.5)),
            SpotLight((0.0, 2.6, -3.7), (0.0, -1.0, 0.0), 1.3, (7.0, 7.0, 7.5)),
            Environment(radiance=(0.25, 0.25, 0.28)),
        ),
        ao_radius=0.5,
        more_views=(((0.9, 1.5, -2.9), (-1.1, 0.6, -4.6)),),  # the back room and its steps
    )


def _rooms() -> list[Part]:
    """Return floor, ceiling, outer walls, and skirting boards."""
    t = _THICK
    walls = [
        box((-_X - t, _TOP, _BACK - t), (_X + t, _TOP + t, _Z + t)),
        box((-_X - t, 0.0, _BACK - t), (-_X, _TOP, _Z + t)),
        box((_X, 0.0, _BACK - t), (_X + t, _TOP, _Z + t)),
        box((-_X, 0.0, _Z), (_X, _TOP, _Z + t)),
        box((-_X, 0.0, _BACK - t), (_X, _TOP, _BACK)),
        box((-_X, _TOP - 0.22, -0.3), (_X, _TOP, 0.0)),
    ]
    skirting = [box((-_X, 0.0, _BACK), (-_X + 0.02, 0.12, _Z)), box((_X - 0.02, 0.0, _BACK), (_X, 0.12, _Z))]
    floor = box((-_X - t, -t, _BACK - t), (_X + t, 0.0, _Z + t))
    return of_materials(([floor], _FLOOR), (walls, _WALL), (skirting, _WOOD))


def _arch() -> list[Part]:
    """Return the wall between the rooms: a round arch 1.8 m wide, a column on each side."""
    near, far, half, spring = -_Z, -_Z - _THICK, 0.9, 1.4
    angle = np.linspace(np.pi, 0.0, 33)
    edge = np.stack([half * np.cos(angle), spring + half * np.sin(angle)], axis=1)
    edge = np.concatenate([[(-half, 0.0)], edge, [(half, 0.0)]])
    above = np.stack([edge[:, 0], np.full(len(edge), _TOP)], axis=1)
    front = np.stack([np.column_stack([line, np.full(len(edge), near)]) for line in (edge, above)])
    soffit = np.stack([np.column_stack([edge, np.full(len(edge), z)]) for z in (far, near)])
    back = front[::-1] - [0.0, 0.0, _THICK]
    walls = [
        grid(front), grid(back), grid(soffit),
        box((-_X, 0.0, far), (-half, _TOP, near)), box((half, 0.0, far), (_X, _TOP, near)),
    ]  # fmt: skip
    profile = [(0.19, 0.0), (0.19, 0.1), (0.14, 0.16), (0.12, 1.3), (0.13, 2.2), (0.2, 2.4), (0.2, _TOP)]
    walls += [moved(lathe(profile, 48), x, 0.0, near + 0.35) for x in (-1.35, 1.35)]
    return of_materials((walls, _WALL))


def _sofa() -> list[Part]:
    """Return a sofa along the wall of -x, with cushions, and a pouffe."""
    x = -_X + 0.08
    base = [
        box((x, 0.08, -0.9), (x + 0.85, 0.42, 1.1)), box((x, 0.42, -0.9), (x + 0.22, 0.85, 1.1)),
        box((x, 0.08, -1.12), (x + 0.85, 0.62, -0.9)), box((x, 0.08, 1.1), (x + 0.85, 0.62, 1.32)),
        *[box((x + 0.24, 0.42, z), (x + 0.87, 0.55, z + 0.64)) for z in (-0.88, -0.22, 0.44)],
    ]  # fmt: skip
    cushion = turned(box((-0.07, 0.0, -0.22), (0.07, 0.42, 0.22)), 0.35)
    base += [moved(cushion, x + 0.36, 0.55, -0.6), moved(ball(0.17, 40), x + 0.5, 0.72, 0.85)]
    profile = rounded([(0.0, 0.0), (0.3, 0.01), (0.36, 0.12), (0.34, 0.32), (0.2, 0.4), (0.0, 0.4)], 6)
    base.append(moved(lathe(profile, 48), -0.7, 0.0, 1.3))
    return of_materials((base, _CLOTH))


def _table() -> list[Part]:
    """Return a round table on one leg with a bowl, a jug and a ball, and two stools."""
    top = rounded([(0.0, 0.7), (0.6, 0.7), (0.64, 0.72), (0.6, 0.745), (0.0, 0.745)], 4)
    leg = [(0.3, 0.0), (0.3, 0.04), (0.07, 0.1), (0.06, 0.5), (0.14, 0.7)]
    stool = [(0.17, 0.0), (0.13, 0.3), (0.19, 0.44), (0.0, 0.44)]
    wood = [
        moved(lathe(top, 64), 0.2, 0.0, -0.5), moved(lathe(leg, 40), 0.2, 0.0, -0.5),
        moved(lathe(stool, 32), 0.95, 0.0, 0.1), moved(lathe(stool, 32), -0.5, 0.0, -1.2),
    ]  # fmt: skip
    bowl = rounded([(0.0, 0.0), (0.1, 0.01), (0.2, 0.12), (0.185, 0.12), (0.09, 0.03), (0.0, 0.02)], 5)
    jug = rounded([(0.0, 0.0), (0.07, 0.0), (0.1, 0.1), (0.045, 0.2), (0.06, 0.28)], 6)
    clay = [
        moved(lathe(bowl, 48), 0.35, 0.745, -0.3), moved(lathe(jug, 40), -0.05, 0.745, -0.6),
        moved(ball(0.06, 32), 0.3, 0.825, -0.3),
    ]  # fmt: skip
    return of_materials((wood, _WOOD), (clay, _CLAY))


def _bookcase() -> list[Part]:
    """Return a bookcase on the wall of +x, its books leaning back by differing depths."""
    x, z0, z1, deep = _X - 0.02, -1.5, 0.3, 0.32
    wood = [box((x - deep, 0.0, z), (x, 2.0, z + 0.04)) for z in (z0, 0.5 * (z0 + z1), z1)]
    wood += [box((x - deep, y, z0), (x, y + 0.035, z1)) for y in (0.06, 0.5, 0.92, 1.34, 1.965)]
    wood.append(box((x - 0.015, 0.06, z0), (x, 2.0, z1)))
    books = []
    for shelf, y in enumerate((0.095, 0.535, 0.955, 1.375)):
        thick = between(10 + shelf, 0.025, 0.06, 40)
        tall = between(20 + shelf, 0.2, 0.33, 40)
        out = between(30 + shelf, 0.04, 0.12, 40)
        start = z0 + 0.06 + np.concatenate([[0.0], np.cumsum(thick[:-1])])
        for z, width, height, inset in zip(start, thick, tall, out, strict=True):
            if z + width < z1 and not z < 0.5 * (z0 + z1) + 0.04 < z + width + 0.04:
                books.append(box((x - deep + inset, y, z), (x - 0.02, y + height, z + width)))
    return of_materials((wood, _WOOD), (books, _BOOK))


def _steps() -> list[Part]:
    """Return steps up to a platform in the back room, with a chest, balls and a leaning board."""
    steps = [box((-_X, 0.0, _BACK), (0.4, 0.17 * (i + 1), _BACK + 1.5 - 0.3 * i)) for i in range(4)]
    chest = turned(box((-0.4, 0.0, -0.25), (0.4, 0.45, 0.25)), 0.5)
    things = [moved(chest, 1.3, 0.0, -4.5)]
    foot, head = (1.75, 0.0), (2.45, 1.7)
    board = np.array([[(x, y, z) for z in (-3.4, -4.0)] for x, y in (foot, head)])
    things += [grid(board), grid(board[:, ::-1])]
    balls = [moved(ball(r, 40), px, py + r, pz) for r, px, py, pz in (
        (0.28, -1.5, 0.68, -4.8), (0.15, -0.6, 0.34, -4.25), (0.22, 0.8, 0.0, -3.9))]  # fmt: skip
    return of_materials((steps, _CLAY), (things, _WOOD), (balls, _CLOTH))
