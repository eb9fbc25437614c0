"""A workshop: shelves of boxes and balls, a bench, open stairs, wires, rods and clutter.

Metres; the room is 6.4 m wide (x), 5.2 m deep (z) and 3 m high; the window is on the side of +x.
"""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment, SpotLight

from ..parts import Part, assemble, complete
from . import workshop_things as things
from .builtin import BuiltinScene
from .scatter import between, copies, shares
from .shapes import ball, beam, box, joined, lathe, moved, of_material, of_materials, pole, rounded, tube
from .workshop_things import ENAMEL, IRON, PAINT, PINE

_X, _Z, _TOP = things.SIDE, -things.BACK, 3.0


def workshop() -> BuiltinScene:
    """Make the workshop: about 108,000 triangles, the thinnest wire 3 mm across, always the same.

    The sun comes in by the window, a spot light hangs over the bench.
    """
    parts = [*_room(), *_shelves(), *things.bench(), *_stairs(), *_wires(), *things.wheels(), *things.grille()]
    parts += [*things.crates(), *things.leaning(), things.clutter()]
    return BuiltinScene(
        name="workshop",
        scene=assemble(parts, things.MATERIALS),
        eye=(2.55, 1.65, 2.35),
        target=(-0.55, 0.95, -1.6),
        yfov=0.95,
        lights=(
            DirectionalLight(direction=(-0.80, -0.55, -0.22), irradiance=(16.0, 14.0, 11.0)),
            Environment(radiance=(0.80, 0.85, 0.95)),
            SpotLight(
                position=(0.2, 2.7, -0.2), direction=(0.1, -1.0, -0.35), cone_angle=1.0, intensity=(9.0, 7.4, 5.0)
            ),
        ),
        ao_radius=0.25,
        more_views=(
            ((-0.2, 1.35, 0.6), (0.9, 1.15, -2.2)),  # close to the shelves
            ((2.0, 0.55, -0.4), (-2.3, 0.85, 0.5)),  # low, towards the stairs
        ),
    )


def _room() -> list[Part]:
    """Return floor boards, walls of 20 cm with the window, wainscot, ceiling and its beams."""
    wide, thick = 0.16, 0.2
    rows = round(2.0 * _Z / wide)
    board = beam((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    row, third = np.divmod(np.arange(3 * rows), 3)
    side = np.full(rows, _X)
    cuts = np.column_stack([-side, between(1, -1.8, -0.4, rows), between(2, 0.4, 1.8, rows), side])
    start, end = cuts[row, third], cuts[row, third + 1]
    sizes = np.column_stack([end - start - 0.006, np.full(len(row), 0.05), np.full(len(row), wide - 0.006)])
    heights = between(3, -0.028, -0.025, len(row))
    middles = np.column_stack([0.5 * (start + end), heights, -_Z + (row + 0.5) * wide])
    shade = between(4, 0.75, 1.1, len(row))[:, None] * np.array([1.0, 0.98, 0.95])
    floor = copies(board, middles, scales=sizes, tints=shade)
    walls = [
        box((-_X, -0.3, -_Z), (_X, -0.04, _Z)),
        box((-_X - thick, -0.3, -_Z - thick), (_X + thick, _TOP, -_Z)),
        box((-_X - thick, -0.3, _Z), (_X + thick, _TOP, _Z + thick)),
        box((-_X - thick, -0.3, -_Z), (-_X, _TOP, _Z)),
        box((_X, -0.3, -_Z), (_X + thick, 0.9, _Z)),
        box((_X, 2.4, -_Z), (_X + thick, _TOP, _Z)),
        box((_X, 0.9, -_Z), (_X + thick, 2.4, -1.1)),
        box((_X, 0.9, 1.3), (_X + thick, 2.4, _Z)),
        box((-_X - thick, _TOP, -_Z - thick), (_X + thick, _TOP + 0.2, _Z + thick)),
    ]
    bars = [box((_X + 0.08, 0.9, z - 0.02), (_X + 0.12, 2.4, z + 0.02)) for z in (-0.5, 0.1, 0.7)]
    bars.append(box((_X + 0.08, 1.63, -1.1), (_X + 0.12, 1.67, 1.3)))
    bars.append(box((_X - 0.08, 0.86, -1.2), (_X + 0.1, 0.9, 1.4)))
    count = round(2.0 * _X / 0.12)
    x = -_X + (np.arange(count) + 0.5) * 0.12
    planks = np.column_stack([x, np.full(count, 0.53), np.full(count, -_Z + 0.01)])
    wainscot = copies(beam((-0.057, -0.53, -0.01), (0.057, 0.53, 0.01)), planks)
    rail = box((-_X, 1.06, -_Z), (_X, 1.1, -_Z + 0.05))
    joist = beam((-_X, 2.78, -0.07), (_X, _TOP, 0.07))
    beams = copies(joist, [(0.0, 0.0, z) for z in np.linspace(-2.2, 2.2, 6)])
    groups = ([floor], things.BOARDS), (walls, things.PLASTER), (bars, PINE), ([wainscot, rail], ENAMEL)
    return of_materials(*groups, ([beams], things.OAK))


def _shelves() -> list[Part]:
    """Return two sets of shelves on the back wall, full of boxes, balls, jars and books."""
    depth, back = 0.36, -_Z + 0.03
    jar = rounded(
        [(0.0, 0.0), (0.40, 0.0), (0.46, 0.06), (0.48, 0.45), (0.40, 0.70), (0.26, 0.78), (0.26, 0.84), (0.34, 0.86),
         (0.34, 1.0), (0.0, 1.0)], 3,
    )  # fmt: skip
    tin = [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.44, 1.0), (0.42, 0.1), (0.0, 0.1)]
    kinds = [beam((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5)), complete(moved(ball(0.5, 28), 0.0, 0.5, 0.0))]
    kinds += [complete(lathe(profile, 24)) for profile in (jar, tin)]
    parts = []
    placed: list[tuple[int, float, float, float, float, float, float]] = []
    for left, right, heights in (
        (-0.55, 0.85, (0.10, 0.52, 0.90, 1.24, 1.62, 2.02)),
        (1.05, 2.95, (0.10, 0.62, 1.08, 1.46, 1.96)),
    ):
        for x in (left - 0.015, right + 0.015):
            parts += [
                box((x - 0.015, 0.0, z), (x + 0.015, heights[-1] + 0.06, z + 0.04)) for z in (back, back + depth - 0.04)
            ]
        parts += [box((left - 0.03, y, back), (right + 0.03, y + 0.024, back + depth)) for y in heights]
        parts.append(pole((left, heights[0], back + 0.02), (right, heights[-1], back + 0.02), 0.006, 8))
        for level, y in enumerate(heights):
            room = (heights[level + 1] - y - 0.06) if level + 1 < len(heights) else 0.34
            chance = shares(40 + len(placed), 80, 5)
            x = left + 0.02
            for kind, size, front, gap, tall in chance:
                wide = 0.035 + (0.24 * size**2)
                if x + wide > right:
                    break
                which = min(int(kind * 5.5), 4)
                high = min(room * (0.35 + 0.65 * tall), room)
                deep = min(wide * (0.7 + 0.8 * front), depth - 0.04)
                if which == 4:  # books: thin, and all about as tall
                    wide, high, deep = 0.02 + 0.03 * size, room * (0.72 + 0.25 * tall), 0.2
                elif which > 0:
                    wide = deep = min(wide, room, depth - 0.04)
                    high = wide if which == 1 else min(1.5 * wide, room)
                z = back + 0.5 * deep + (depth - deep) * (0.25 + 0.7 * front)
                z = min(z, back + depth - 0.5 * deep)
                placed.append((which % 4, x + 0.5 * wide, y + 0.024, z, wide, high, deep))
                x += wide + 0.003 + (0.0 if which == 4 else 0.07 * gap**2)
    shelves = of_material(joined([complete(p) for p in parts]), PINE)
    table = np.array(placed)
    tint = things.COLOURS[(shares(7, len(table)) * len(things.COLOURS)).astype(int)]
    tint = tint * between(8, 0.8, 1.1, len(table), 1)
    goods = [
        copies(kind, table[of, 1:4], scales=table[of, 4:7], tints=tint[of])
        for index, kind in enumerate(kinds)
        for of in (table[:, 0] == index,)
    ]
    return [shelves, *of_materials((goods, PAINT))]


def _stairs() -> list[Part]:
    """Return open stairs along the side of -x up to a landing, with an iron railing."""
    count, rise, run, start = 9, 0.2, 0.26, 1.9
    step = beam((-_X + 0.05, -0.04, -0.15), (-_X + 0.95, 0.0, 0.15))
    heights, places = rise * np.arange(1, count + 1), start - run * np.arange(count)
    treads = copies(step, np.column_stack([0.0 * heights, heights, places]))
    landing = box((-_X, rise * count - 0.04, -_Z), (-_X + 0.95, rise * count, places[-1] - 0.14))
    wood = [treads, landing]
    for x in (-_X + 0.08, -_X + 0.9):
        foot, head = (x, 0.0, start + 0.2), (x, heights[-1] - 0.1, places[-1] - 0.05)
        wood.append(pole(foot, head, 0.035, 4))
    post, top = -_X + 0.92, heights[-1]
    iron = [pole((post, y, z), (post, y + 0.9, z), 0.007) for y, z in zip(heights, places, strict=True)]
    iron.append(pole((post, heights[0] + 0.9, places[0] + 0.1), (post, heights[-1] + 0.9, places[-1]), 0.018, 12))
    edge = np.arange(places[-1] - 0.12, -_Z, -0.12)
    iron += [pole((post, top, z), (post, top + 0.9, z), 0.007) for z in edge]
    iron.append(pole((post, top + 0.9, places[-1]), (post, top + 0.9, -_Z), 0.018, 12))
    iron += [pole((post - 0.01, 0.0, z), (post - 0.01, top, z), 0.03, 4) for z in (-1.0, -2.4)]
    return of_materials((wood, PINE), (iron, IRON))


def _wires() -> list[Part]:
    """Return cables that sag between the beams, hanging lamps, and pipes on the back wall."""
    parts = []
    s = np.linspace(0.0, 1.0, 33)[:, None]
    for start, end, sag, radius in (
        ((-1.6, 2.72, -2.2), (2.9, 2.72, -1.3), 0.45, 0.006),
        ((-1.6, 2.72, -1.3), (2.9, 2.72, -2.2), 0.30, 0.004),
        ((-2.0, 2.74, 0.4), (1.2, 2.74, -0.4), 0.22, 0.005),
        ((-2.2, 2.4, 1.3), (-2.2, 2.74, -2.2), 0.5, 0.0015),
    ):
        path = (1.0 - s) * start + s * end - 4.0 * sag * s * (1.0 - s) * [0.0, 1.0, 0.0]
        across = np.cross(np.subtract(end, start), (0.0, 1.0, 0.0))
        parts.append(of_material(tube(path, across / np.linalg.norm(across), radius, 8), things.RUBBER))
    shade = lathe([(0.15, 0.0), (0.13, 0.06), (0.05, 0.12), (0.02, 0.17), (0.0, 0.17),
                   (0.04, 0.115), (0.12, 0.055), (0.145, 0.0)], 40)  # fmt: skip
    for x, z, low in ((-0.6, -0.75, 2.0), (1.1, 0.44, 2.15), (-1.9, 0.44, 2.2)):
        parts.append(of_material(moved(shade, x, low, z), ENAMEL))
        parts.append(of_material(moved(ball(0.045, 20), x, low + 0.03, z), PAINT))
        parts.append(of_material(pole((x, low + 0.16, z), (x, 2.8, z), 0.003, 6), things.RUBBER))
    for y, radius in ((2.34, 0.04), (2.46, 0.022), (2.53, 0.014)):
        z = -_Z + 0.09
        parts.append(of_material(pole((-_X, y, z), (_X, y, z), radius, 16), things.STEEL))
        for x in np.arange(-2.9, 3.0, 0.97):
            parts.append(of_material(pole((x, y, z), (x + 0.03, y, z), radius + 0.012, 16), IRON))
    return parts
