"""Trees, bushes, ferns and grass: leaves are open sheets, wood is closed; metres."""

from __future__ import annotations

import numpy as np

from ...parts import Part, complete
from ..scatter import Doubles, about_y, rotation
from ..shapes import mesh
from .chance import Chance
from .model import LEAF, WOOD, Model, upright_to


def leaf() -> Part:
    """Return a leaf 1 long along +z, folded along its middle: four triangles, facing up."""
    points = [(0, 0, 0), (0.28, 0.07, 0.4), (0, 0.0, 0.45), (-0.28, 0.07, 0.4), (0, -0.1, 1.0)]
    part = mesh(points, [(0, 2, 1), (2, 4, 1), (0, 3, 2), (2, 3, 4)], name="leaf")
    return complete(part)


def blade() -> Part:
    """Return a blade of grass 1 high that bends to +z: five triangles."""
    s = np.array([0.0, 0.4, 0.75, 1.0])
    half = 0.03 * np.array([1.0, 0.85, 0.5, 0.0])
    y, z = s - 0.12 * s**2, 0.35 * s**2
    left, right = np.stack([-half, y, z], axis=1), np.stack([half, y, z], axis=1)
    points = np.concatenate([left[:3], right[:3], left[3:]])
    triangles = [(0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2), (2, 5, 6)]
    return complete(mesh(points, triangles, name="blade"))


def turned_anyhow(chance: Chance, count: int, tilt: float) -> Doubles:
    """Return [count, 3, 3] turns about y after tilts of up to `tilt` radians."""
    spin = rotation((0.0, 1.0, 0.0), chance.uniforms(0.0, 2.0 * np.pi, count))
    lean = rotation((1.0, 0.0, 0.0), chance.uniforms(-tilt, tilt, count))
    roll = rotation((0.0, 0.0, 1.0), chance.uniforms(-tilt, tilt, count))
    turns: Doubles = spin @ lean @ roll
    return turns


def shades(chance: Chance, count: int, tint: Doubles) -> Doubles:
    """Return [count, 3] tints round one."""
    result: Doubles = chance.uniforms(0.75, 1.2, count, 1) * tint
    return result


def tree(model: Model, chance: Chance, high: float, leaves: int) -> None:
    """Add a tree: a trunk that forks into thinner and thinner branches, with leaves at the tips."""
    tips: list[Doubles] = []
    thick = high * chance.uniform(0.018, 0.03)

    def grow(start: Doubles, way: Doubles, length: float, radius: float, depth: int) -> None:
        bend = chance.uniforms(-0.12, 0.12, 3)
        middle = start + 0.55 * length * (way + 0.5 * bend)
        end = start + length * (way + bend)
        sides = 8 if depth > 1 else 5
        model.bar(start, middle, radius, WOOD, sides=sides)
        model.bar(middle, end, 0.85 * radius, WOOD, sides=sides)
        if depth <= 1:
            tips.extend((middle, end))
        if depth == 0:
            return
        frame = upright_to(end - middle)
        forks = chance.whole(2, 3) + (depth == 1)
        first = chance.uniform(0.0, 6.28)
        for i in range(forks):
            angle, lean = first + i * 6.28 / forks, chance.uniform(0.4, 0.85)
            side = np.array((np.sin(lean) * np.cos(angle), np.cos(lean), np.sin(lean) * np.sin(angle)))
            grow(end, frame @ side, length * chance.uniform(0.6, 0.8), 0.62 * radius, depth - 1)

    grow(np.zeros(3), np.array((0.0, 1.0, 0.0)), 0.36 * high, thick, 4)
    at = np.array(tips)[(chance.uniforms(0.0, len(tips), leaves)).astype(int)]
    spread = 0.07 * high
    at = at + chance.uniforms(-spread, spread, leaves, 3)
    size = chance.uniforms(0.7, 1.3, leaves) * high * 0.035
    tint = chance.uniforms(0.8, 1.3, 3)
    turns, tints = turned_anyhow(chance, leaves, 0.9), shades(chance, leaves, tint)
    model.scatter(leaf(), LEAF, at, turns=turns, scales=size, tints=tints, closed=False)


def bush(model: Model, chance: Chance, radius: float, leaves: int) -> None:
    """Add a bush: twigs from one root, and leaves within a flattened ball."""
    for _ in range(9):
        way = chance.uniforms(-1.0, 1.0, 3) * [1, 0, 1] + [0, 1.1, 0]
        model.bar((0, 0, 0), 0.9 * radius * way / np.linalg.norm(way), 0.02 * radius, WOOD, sides=5)
    direction = chance.uniforms(-1.0, 1.0, leaves, 3)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    away = radius * chance.uniforms(0.15, 1.0, leaves, 1) ** (1.0 / 2.0)
    at = direction * away * [1.0, 0.75, 1.0] + [0.0, 0.75 * radius, 0.0]
    size = radius * chance.uniforms(0.12, 0.24, leaves)
    turns = turned_anyhow(chance, leaves, 0.8)
    tints = shades(chance, leaves, chance.uniforms(0.7, 1.2, 3))
    model.scatter(leaf(), LEAF, at, turns=turns, scales=size, tints=tints, closed=False)


def fern(model: Model, chance: Chance, size: float) -> None:
    """Add a fern: fronds that arch outwards with leaflets on both sides."""
    fronds, pairs = chance.whole(6, 10), 11
    share = (np.arange(pairs) + 1.0) / pairs
    for i in range(fronds):
        spin = about_y(6.28 * i / fronds + chance.uniform(-0.3, 0.3))
        long = size * chance.uniform(0.7, 1.1)
        path = np.stack([0 * share, 0.9 * share - 0.75 * share**2, 0.85 * share], axis=1) * long
        model.rope(np.concatenate([[[0, 0, 0]], path])[::3] @ spin.T, 0.006 * long, LEAF)
        sides = np.concatenate([np.full(pairs, 1.35), np.full(pairs, -1.35)])
        turns = spin @ rotation((0, 1, 0), sides)
        at = np.concatenate([path, path]) @ spin.T
        width = long * 0.3 * np.sin(np.pi * np.clip(np.tile(share, 2), 0.12, 0.97)) ** 0.8
        tints = shades(chance, 2 * pairs, np.array((0.8, 1.1, 0.7)))
        model.scatter(leaf(), LEAF, at, turns=turns, scales=width, tints=tints, closed=False)


def grass(model: Model, chance: Chance, at: Doubles, high: float) -> None:
    """Add a blade of grass at each of `at` [n, 3], about as high as said."""
    count = len(at)
    size = high * chance.uniforms(0.5, 1.2, count)
    turns, tints = turned_anyhow(chance, count, 0.25), shades(chance, count, np.array((1.1, 1.1, 0.8)))
    model.scatter(blade(), LEAF, at, turns=turns, scales=size, tints=tints, closed=False)
