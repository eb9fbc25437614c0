"""The model of a generated scene: its parts, and many copies of few unit shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core.scene import Material, Scene

from ...parts import Part, assemble, complete
from ..scatter import Doubles, about_y, copies
from ..shapes import box, of_material
from . import solids

MATERIALS = (
    Material(name="plaster", albedo=(0.76, 0.74, 0.70)),
    Material(name="wood", albedo=(0.50, 0.35, 0.22)),
    Material(name="stone", albedo=(0.58, 0.55, 0.50)),
    Material(name="steel", albedo=(0.42, 0.43, 0.45), specular=(0.25, 0.25, 0.25), gloss=40.0),
    Material(name="iron", albedo=(0.09, 0.09, 0.10), specular=(0.1, 0.1, 0.1), gloss=30.0),
    Material(name="paint", albedo=(0.85, 0.85, 0.85)),
    Material(name="cloth", albedo=(0.62, 0.58, 0.55)),
    Material(name="leaf", albedo=(0.22, 0.38, 0.11)),
    Material(name="soil", albedo=(0.36, 0.30, 0.21)),
    Material(name="asphalt", albedo=(0.16, 0.16, 0.17)),
    Material(name="brick", albedo=(0.52, 0.26, 0.19)),
    Material(name="glass", albedo=(0.12, 0.15, 0.18), specular=(0.2, 0.2, 0.2), gloss=120.0),
)
(PLASTER, WOOD, STONE, STEEL, IRON, PAINT, CLOTH, LEAF, SOIL, ASPHALT, BRICK, GLASS) = range(len(MATERIALS))
COLOURS: tuple[Doubles, ...] = tuple(np.array(
    [(0.74, 0.18, 0.12), (0.16, 0.34, 0.62), (0.86, 0.64, 0.16), (0.22, 0.48, 0.26),
     (0.82, 0.78, 0.70), (0.60, 0.43, 0.28), (0.36, 0.37, 0.40), (0.80, 0.44, 0.20),
     (0.55, 0.30, 0.50), (0.30, 0.60, 0.62)]
))  # fmt: skip
"""Colours of painted surfaces, as factors of `PAINT`."""

_UNITS: dict[str, Callable[[], Part]] = {
    "box": lambda: box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)),
    "bar5": lambda: solids.cylinder(5),
    "bar8": lambda: solids.cylinder(8),
    "bar16": lambda: solids.cylinder(16),
    "bar28": lambda: solids.cylinder(28),
    "cone": lambda: solids.cone(14),
    "ball": lambda: solids.sphere(16),
    "cushion": solids.cushion,
    "octahedron": lambda: solids.sphere(4),
}


@cache
def unit(name: str) -> Part:
    """Return a unit shape with its normals."""
    return complete(_UNITS[name]())


class Model:
    """Parts of a scene; positions are in the frame of the innermost `at`.

    `materials`: what the numbers of parts' materials stand for.
    """

    def __init__(self, materials: tuple[Material, ...] = MATERIALS) -> None:
        self._materials = materials
        self._placed: dict[str, list[tuple[Doubles, Doubles, Doubles, int, Doubles]]] = {}
        self._parts: list[tuple[Part, bool]] = []
        self._turn = np.eye(3)
        self._place = np.zeros(3)

    @contextmanager
    def at(self, place: ArrayLike, turn: float = 0.0, tilt: Doubles | None = None) -> Iterator[None]:
        """Place what is added inside at `place`, turned about y by `turn` radians (+z to +x)."""
        before = self._turn, self._place
        spin = about_y(turn)
        self._place = self._place + self._turn @ np.asarray(place, np.float64)
        self._turn = self._turn @ (spin if tilt is None else spin @ tilt)
        try:
            yield
        finally:
            self._turn, self._place = before

    def put(
        self,
        shape: str,
        place: ArrayLike,
        size: ArrayLike,
        material: int,
        *,
        turn: Doubles | None = None,
        tint: ArrayLike = 1.0,
    ) -> None:
        """Add a copy of a unit shape, scaled by `size` along its own axes, then turned."""
        at = self._place + self._turn @ np.asarray(place, np.float64)
        turned = self._turn @ (np.eye(3) if turn is None else turn)
        scale, color = (np.broadcast_to(np.asarray(values, np.float64), 3) for values in (size, tint))
        self._placed.setdefault(shape, []).append((at, turned, scale, material, color))

    def box(self, least: ArrayLike, greatest: ArrayLike, material: int, tint: ArrayLike = 1.0) -> None:
        """Add the box between two corners."""
        low, high = np.asarray(least, np.float64), np.asarray(greatest, np.float64)
        self.put("box", 0.5 * (low + high), high - low, material, tint=tint)

    def bar(
        self, start: ArrayLike, end: ArrayLike, radius: float, material: int, *, sides: int = 8, tint: ArrayLike = 1.0
    ) -> None:
        """Add a round bar with caps; `sides` is 5, 8, 16 or 28."""
        low, high = np.asarray(start, np.float64), np.asarray(end, np.float64)
        length = float(np.linalg.norm(high - low))
        self.put(f"bar{sides}", low, (radius, length, radius), material, turn=upright_to(high - low), tint=tint)

    def rope(self, points: ArrayLike, radius: float, material: int) -> None:
        """Add bars from each of `points` [n, 3] to the next."""
        path = np.asarray(points, np.float64)
        for start, end in pairwise(path):
            self.bar(start, end, radius, material, sides=5)

    def sag(
        self, start: ArrayLike, end: ArrayLike, drop: float, radius: float, material: int, pieces: int = 12
    ) -> None:
        """Add a wire that hangs `drop` below the middle of the line from start to end."""
        share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
        low, high = np.asarray(start, np.float64), np.asarray(end, np.float64)
        path = low + share * (high - low) - 4.0 * drop * share * (1 - share) * [0.0, 1.0, 0.0]
        self.rope(path, radius, material)

    def add(
        self,
        part: Part,
        material: int,
        place: ArrayLike = 0.0,
        *,
        turn: Doubles | None = None,
        scale: ArrayLike = 1.0,
        tint: ArrayLike = 1.0,
        closed: bool = True,
    ) -> None:
        """Add a part; `closed` tells whether it bounds a volume."""
        places, scales, tints = (np.broadcast_to(np.asarray(v, np.float64), (1, 3)) for v in (place, scale, tint))
        turns = None if turn is None else turn[None]
        self.scatter(part, material, places, turns=turns, scales=scales, tints=tints, closed=closed)

    def scatter(
        self,
        part: Part,
        material: int,
        places: Doubles,
        *,
        turns: Doubles | None = None,
        scales: ArrayLike = 1.0,
        tints: Doubles | None = None,
        closed: bool = True,
    ) -> None:
        """Add copies of a part; the arguments are those of `scatter.copies`."""
        done = part if part.normals is not None else complete(part)
        count = len(places)
        own = np.broadcast_to(np.eye(3), (count, 3, 3)) if turns is None else turns
        made = copies(done, self._place + places @ self._turn.T, turns=self._turn @ own, scales=scales, tints=tints)
        self._parts.append((of_material(made, material), closed))

    def parts(self) -> list[tuple[Part, bool]]:
        """Return all parts, each with whether it is closed."""
        made = []
        for shape, placed in self._placed.items():
            places, turns, scales, materials, tints = zip(*placed, strict=True)
            part = unit(shape)
            joined = copies(
                part, np.stack(places), turns=np.stack(turns), scales=np.stack(scales), tints=np.stack(tints)
            )
            ids = np.repeat(np.array(materials, np.int64), len(part.triangles))
            made.append((replace(joined, material_ids=ids), True))
        return made + self._parts

    def scene(self) -> Scene:
        """Return the scene of all parts."""
        return assemble([part for part, _ in self.parts()], self._materials)


def upright_to(way: ArrayLike) -> Doubles:
    """Return the [3, 3] rotation that takes +y to the direction `way`."""
    y = np.asarray(way, np.float64) / np.linalg.norm(np.asarray(way, np.float64))
    x = np.cross(y, np.eye(3)[np.abs(y).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)], axis=1)
