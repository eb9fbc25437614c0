"""Furniture, tools and clutter of the workshop, and its materials."""

from __future__ import annotations

from itertools import product

import numpy as np

from ssgi_cl.core.scene import Material

from ..parts import Part, complete
from .scatter import between, copies, rotation, shares
from .shapes import (
    ball,
    beam,
    box,
    circle,
    joined,
    lathe,
    moved,
    of_material,
    of_materials,
    pole,
    rounded,
    tube,
    turned,
)

MATERIALS = (
    Material(name="plaster", albedo=(0.74, 0.72, 0.67)),
    Material(name="floor boards", albedo=(0.46, 0.33, 0.22)),
    Material(name="pine", albedo=(0.66, 0.50, 0.32)),
    Material(name="oak", albedo=(0.38, 0.25, 0.15)),
    Material(name="steel", albedo=(0.40, 0.41, 0.43), specular=(0.3, 0.3, 0.3), gloss=50.0),
    Material(name="black iron", albedo=(0.07, 0.07, 0.08), specular=(0.1, 0.1, 0.1), gloss=30.0),
    Material(name="paint", albedo=(0.85, 0.85, 0.85)),
    Material(name="rubber", albedo=(0.05, 0.05, 0.05)),
    Material(name="enamel", albedo=(0.16, 0.36, 0.33), specular=(0.05, 0.05, 0.05), gloss=60.0),
)
PLASTER, BOARDS, PINE, OAK, STEEL, IRON, PAINT, RUBBER, ENAMEL = range(len(MATERIALS))

SIDE, BACK = 3.2, -2.6
"""Positions of the wall of +x and of the back wall, metres."""

COLOURS = np.array(
    [(0.72, 0.16, 0.10), (0.15, 0.33, 0.62), (0.86, 0.62, 0.12), (0.20, 0.46, 0.24),
     (0.80, 0.76, 0.68), (0.62, 0.44, 0.28), (0.35, 0.36, 0.38), (0.78, 0.42, 0.18)]
)  # fmt: skip


def bench() -> list[Part]:
    """Return the bench with tools and blocks on it, a stool and a lamp on a jointed arm."""
    top = 0.88
    wood = [box((-0.8, top - 0.06, -0.35), (0.8, top, 0.35)), box((-0.7, 0.18, -0.3), (0.7, 0.21, 0.3))]
    legs = [(x, z) for x in (-0.7, 0.7) for z in (-0.27, 0.27)]
    wood += [box((x - 0.04, 0.0, z - 0.04), (x + 0.04, top - 0.06, z + 0.04)) for x, z in legs]
    ring = circle(40)[:, [0, 2, 1]]
    rings = [ring * (0.12 - 0.004 * i) + [-0.52, top + 0.012 + 0.021 * i, 0.16] for i in range(4)]
    coil = joined([tube(path, (0, 1, 0), 0.011, 10) for path in rings])
    arm = [(0.62, top, -0.2), (0.62, top + 0.03, -0.2), (0.50, top + 0.42, -0.22), (0.16, top + 0.60, -0.12)]
    shade = lathe([(0.13, 0.0), (0.05, 0.13), (0.03, 0.15), (0.0, 0.15), (0.045, 0.125), (0.122, 0.0)], 32)
    lamp = [
        moved(lathe([(0.0, 0.0), (0.09, 0.0), (0.09, 0.02), (0.0, 0.03)], 32), *arm[0]),
        pole(arm[1], arm[2], 0.006),
        pole(arm[2], arm[3], 0.006),
        moved(ball(0.016, 16), *arm[2]),
        moved(shade, arm[3][0], arm[3][1] - 0.14, arm[3][2]),
    ]
    vice = [
        box((-0.16, top, 0.14), (0.02, top + 0.1, 0.34)),
        box((-0.18, top + 0.1, 0.10), (0.04, top + 0.17, 0.22)),
        box((-0.18, top + 0.1, 0.27), (0.04, top + 0.17, 0.36)),
        pole((-0.07, top + 0.06, 0.1), (-0.07, top + 0.06, 0.5), 0.014),
        pole((-0.19, top + 0.06, 0.47), (0.05, top + 0.06, 0.47), 0.007),
    ]
    rods = [
        pole((x, top + r, -0.32), (x + 0.06, top + r, 0.05), r, 10)
        for x, r in ((-0.7, 0.012), (-0.66, 0.009), (-0.625, 0.006), (-0.60, 0.014))
    ]
    blocks = [
        moved(turned(box((-a, 0, -b), (a, c, b)), t), x, y, z)
        for x, y, z, a, b, c, t in (
            (-0.30, top, -0.14, 0.11, 0.07, 0.08, 0.4),
            (-0.29, top + 0.08, -0.13, 0.08, 0.05, 0.06, 0.9),
            (0.24, top, 0.05, 0.05, 0.14, 0.03, -0.5),
            (0.26, top + 0.03, 0.05, 0.13, 0.035, 0.03, 0.2),
            (0.02, top, -0.2, 0.03, 0.03, 0.16, 0.3),
            (0.1, top, -0.24, 0.04, 0.05, 0.1, 1.1),
            (0.0, 0.21, 0.0, 0.25, 0.18, 0.2, 0.15),
            (-0.45, 0.21, 0.02, 0.12, 0.16, 0.3, -0.2),
        )
    ]
    balls = [
        moved(ball(r, 20), x, top + r, z)
        for x, z, r in (
            (0.40, 0.2, 0.05),
            (0.49, 0.14, 0.035),
            (0.50, 0.23, 0.025),
            (0.44, 0.12, 0.018),
            (0.56, 0.18, 0.045),
            (0.46, 0.29, 0.03),
        )
    ]
    pot = lathe([(0.0, 0.0), (0.05, 0.0), (0.055, 0.12), (0.05, 0.12), (0.045, 0.01), (0.0, 0.01)], 24)
    painted = [moved(pot, 0.40, top, -0.18)]
    for a in np.linspace(0, 5.6, 9):
        foot = (0.40 + 0.02 * np.cos(a), top + 0.01, -0.18 + 0.02 * np.sin(a))
        tip = (0.40 + 0.06 * np.cos(a), top + 0.2 + 0.02 * np.sin(3 * a), -0.18 + 0.06 * np.sin(a))
        painted.append(pole(foot, tip, 0.0035, 6))
    seat = lathe(rounded([(0.0, 0.44), (0.15, 0.44), (0.17, 0.46), (0.15, 0.48), (0.0, 0.475)], 4), 32)
    stool = [moved(seat, 0.55, 0.0, 0.85)]
    for a in np.linspace(0.3, 2.0 * np.pi + 0.3, 4)[:3]:
        hip = (0.55 + 0.1 * np.cos(a), 0.45, 0.85 + 0.1 * np.sin(a))
        stool.append(pole(hip, (0.55 + 0.2 * np.cos(a), 0.0, 0.85 + 0.2 * np.sin(a)), 0.014, 10))
    groups = (wood, OAK), ([coil], RUBBER), (lamp, ENAMEL), ([*vice, *rods], STEEL), (blocks, PINE), (balls, STEEL)
    parts = of_materials(*groups, (painted, PAINT), (stool, PINE))
    return [moved(turned(complete(part), 0.12), -0.45, 0.0, -0.75) for part in parts]


def wheels() -> list[Part]:
    """Return a bicycle wheel that hangs on the wall of +x and one that leans at the stairs."""
    ring = circle(64)
    tyre = of_material(tube(0.33 * ring, (0.0, 0.0, 1.0), 0.018, 10), RUBBER)
    rim = of_material(tube(0.308 * ring, (0.0, 0.0, 1.0), 0.009, 8), STEEL)
    hub = of_material(pole((0.0, 0.0, -0.05), (0.0, 0.0, 0.05), 0.022, 16), STEEL)
    spokes = []
    for a, t in zip(np.arange(32) * np.pi / 16.0, np.tile([-1.0, 1.0], 16), strict=True):
        inner = (0.02 * np.cos(a + t), 0.02 * np.sin(a + t), 0.03 * t)
        spokes.append(pole(inner, (0.305 * np.cos(a), 0.305 * np.sin(a), 0.0), 0.0018, 5))
    wheel = complete(joined([tyre, rim, hub, of_material(joined(spokes), STEEL)]))
    hung = moved(turned(wheel, 0.5 * np.pi), SIDE - 0.07, 1.75, 2.0)
    leaning = rotation((0.0, 1.0, 0.0), 1.2) @ rotation((1.0, 0.0, 0.0), -0.14)
    return [hung, copies(wheel, [(-1.95, 0.345, -1.55)], turns=leaning)]


def grille() -> list[Part]:
    """Return a wire grille on the back wall with rings and rods hung on it."""
    x0, x1, y0, y1, z = -1.95, -0.75, 1.25, 2.15, BACK + 0.05
    wires = [pole((x, y0, z), (x, y1, z), 0.0025, 6) for x in np.arange(x0, x1 + 0.01, 0.06)]
    wires += [pole((x0, y, z + 0.005), (x1, y, z + 0.005), 0.0025, 6) for y in np.arange(y0, y1 + 0.01, 0.06)]
    rings = (-1.7, 1.9, 0.13, 0.012), (-1.66, 1.86, 0.08, 0.008), (-1.35, 1.95, 0.09, 0.02), (-1.0, 1.8, 0.2, 0.006)
    hung = [tube(r * circle(40) + [x, y, z + 0.02 + t], (0.0, 0.0, 1.0), t, 10) for x, y, r, t in rings]
    tools = (-1.6, 0.3, 0.008), (-1.5, 0.36, 0.012), (-1.42, 0.25, 0.006), (-1.34, 0.4, 0.01), (-1.26, 0.2, 0.014)
    hung += [pole((x, 1.72, z + 0.02), (x + 0.01, 1.72 - n, z + 0.03), r, 10) for x, n, r in tools]
    grips = [pole((x, 1.73, z + 0.02), (x, 1.62, z + 0.02), 0.019, 12) for x, _, _ in tools]
    return of_materials((wires, IRON), (hung, STEEL), (grips, PAINT))


def crates() -> list[Part]:
    """Return a stack of slatted crates, one open with balls in it."""
    rows = (0.02, 0.11, 0.20)
    slats = [box((-0.28, y, z - 0.008), (0.28, y + 0.07, z + 0.008)) for y in rows for z in (-0.2, 0.2)]
    slats += [box((x - 0.008, y, -0.19), (x + 0.008, y + 0.07, 0.19)) for y in rows for x in (-0.27, 0.27)]
    posts = [(x, z) for x in (-0.245, 0.245) for z in (-0.17, 0.17)]
    slats += [box((x - 0.02, 0.0, z - 0.02), (x + 0.02, 0.29, z + 0.02)) for x, z in posts]
    slats += [box((-0.26, 0.0, z - 0.035), (0.26, 0.015, z + 0.035)) for z in (-0.14, -0.05, 0.05, 0.14)]
    crate = complete(of_material(joined(slats), PINE))
    stacked = [(1.55, 0.0, -1.3), (1.58, 0.3, -1.32), (1.5, 0.6, -1.28), (2.35, 0.0, -1.1), (2.3, 0.3, -1.12)]
    where = [*stacked, (-1.35, 0.0, 1.1)]
    turns = rotation((0.0, 1.0, 0.0), [0.1, -0.15, 0.3, -0.4, -0.2, 0.8])
    places, grid = product(range(2), range(-2, 3), range(-1, 2)), 0.105
    spots = [(i * grid + 0.03 * level, 0.07 + 0.09 * level, j * grid) for level, i, j in places]
    one = complete(ball(0.05, 18))
    tint = COLOURS[(shares(21, len(spots)) * 4).astype(int)]
    fruit = copies(one, np.array(spots), scales=between(22, 0.8, 1.05, len(spots)), tints=tint)
    fruit = moved(turned(of_material(fruit, PAINT), 0.8), *where[-1])
    return [copies(crate, where, turns=turns), fruit]


def leaning() -> list[Part]:
    """Return a ladder, poles and planks that lean at the walls, and a broom."""
    sides = [pole((x, 0.0, -1.75), (x, 2.25, -2.42), 0.02, 6) for x in (-0.42, -0.06)]
    rungs = [(y, -1.75 - 0.298 * y) for y in np.arange(0.25, 2.2, 0.27)]
    sides += [pole((-0.42, y, z), (-0.06, y, z), 0.011) for y, z in rungs]
    poles = [
        pole((2.95 - 0.3 * a, 0.0, 1.5 + 0.6 * b), (3.12, 1.5 + 0.9 * c, 1.6 + 0.5 * b), 0.006 + 0.018 * a, 10)
        for a, b, c in shares(30, 9, 3)
    ]
    feet = [(2.75 - 0.2 * i, 0.0, -2.1 + 0.05 * i) for i in range(3)]
    turns = rotation((1.0, 0.0, 0.0), [-0.06, -0.09, -0.13])
    planks = copies(beam((-0.07, 0.0, -0.012), (0.07, 2.2, 0.012)), feet, turns=turns)
    return of_materials((sides, PINE), (poles, STEEL), ([planks], OAK))


def clutter() -> Part:
    """Return balls and blocks of all sizes on the floor, each touching it."""
    count = 90
    x, z = between(50, -1.9, 2.6, count), between(51, -0.1, 2.2, count)
    # Small ones abound; the way from the camera to the bench stays clear of large ones.
    size = 0.012 + 0.10 * shares(52, count) ** 3
    height = np.maximum(size, 0.012)
    tint = COLOURS[(shares(53, count) * len(COLOURS)).astype(int)]
    places = np.column_stack([x, height, z])
    of = shares(54, count) < 0.5
    balls = copies(complete(ball(1.0, 20)), places[of], scales=size[of], tints=tint[of])
    of, block = ~of, beam((-1.0, -1.0, -1.6), (1.0, 1.0, 1.6))
    turns = rotation((0.0, 1.0, 0.0), between(55, 0.0, 2.0 * np.pi, count)[of])
    blocks = copies(block, places[of], turns=turns, scales=size[of], tints=tint[of])
    return of_material(joined([balls, blocks]), PAINT)
