"""The surfels of a sequence of frames, which follow the triangles that they lie on."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import PARTS
from ssgi_cl.techniques.radiosity.surfels import Surfels
from ssgi_cl.techniques.vpl.kept_order import KeptOrder

Doubles = NDArray[np.float64]

GROWTH = 1.25
"""Half size of the cube of a scene that left the one before, over that of its box."""
MOST_KEPT = 1.25
"""Surfels that see a surface and light, over those of the first scene or those over these, up to which no others are
placed: beyond, light has entered other spaces or left some."""

STEADY_LIGHTS = 6
"""Surfels for each that is asked for, up to which all are lights of a scene that moves, so that none changes its place
among them when another begins to shine."""


class SurfelHistory:
    """What radiosity keeps from frame to frame of a sequence in which parts of the scene move.

    Surfels are placed once, and follow their triangles then: light from other ones differs by noise, which flickers.
    So do the cube of the light volume, and the numbers by which parts have their rays. Light begins with that of the
    frame before, which takes few bounces to correct.

    Args:
        follows: whether scenes may follow in which parts have moved; surfels where no light comes to are left out else.

    Attributes:
        follows: as given.
        surfels: those placed, before any was left out; None before the first frame.
        received: [numbers, 3] float64 irradiance of the frame before by part's number, W/m^2; None: nothing is known.
        middle, half: of the cube round the scene, world space and scene units.
        order: of lights in the tree of the gather.
        sky: which parts of the sky the first scene sees, see `sample_environments`: directions then stay.
        moves: whether surfels have followed a scene.
    """

    def __init__(self, *, follows: bool = True) -> None:
        self.follows = follows
        self.order = KeptOrder()
        self.sky: Doubles | None = None
        self.moves = False
        self.surfels: Surfels | None = None
        self.received: Doubles | None = None
        self.middle: Doubles = np.zeros(3)
        self.half = 0.0
        self._scene: Scene | None = None
        self._latest: object = None  # key of the scene of `received`
        self._there = 0
        self._chosen = np.zeros(0, np.intp)

    def begin(self, scene: Scene, surfels: Surfels, there: NDArray[np.intp]) -> Surfels:
        """Take the surfels placed in a scene, and return those of them that see a surface and light, [n] `there`.

        Their parts are numbered anew, these first.
        """
        first = np.concatenate([there, np.setdiff1d(np.arange(len(surfels)), there)])
        number = np.empty(len(surfels.part_area), np.intp)
        number[surfels.part_number.reshape(-1, PARTS)[first].ravel()] = np.arange(len(number))
        self._scene, self._there, self._chosen, self.received = scene, len(there), there, None
        self.surfels, self.moves = surfels.renumbered(number), False
        self.order.forget()
        return self.surfels.chosen(there)

    def enter(self, scene: Scene) -> None:
        """Set the cube to one that holds a scene: that of the frame before, if it does and the triangles are the same;
        else surfels are placed anew."""
        low, high = scene.bounds
        middle, half = 0.5 * (low + high), max(0.5 * float((high - low).max()), 1e-30)
        if self._scene is not None and _same_surfaces(self._scene, scene):
            if (np.maximum(np.abs(low - self.middle), np.abs(high - self.middle)) <= self.half).all():
                return
            half *= GROWTH
        self.surfels = self.received = self._scene = None
        self.middle, self.half = middle, half

    def moved(self, scene: Scene) -> Surfels | None:
        """Return the surfels where their triangles are in a scene that `enter` took; None if there are none yet."""
        if self.surfels is None or self._scene is None:
            return None
        self.moves = self.moves or scene is not self._scene
        return self.surfels.following(self._scene, scene)

    def suits(self, there: NDArray[np.intp]) -> bool:
        """Return whether those that see a surface and light are about as many as at first."""
        return self._there <= MOST_KEPT * len(there) and len(there) <= MOST_KEPT * self._there

    def joined(self, there: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the numbers of those that have seen a surface and light, in the order in which they came."""
        self._chosen = np.concatenate([self._chosen, np.setdiff1d(there, self._chosen)])
        return self._chosen

    def known(self, surfels: Surfels, key: object) -> Doubles | None:
        """Return irradiance [parts, 3] of the frame before; None if it is not known, or the scene is that of it.

        `key` is the scene's.
        """
        if self.received is None or key is self._latest:
            return None
        return self.received[surfels.part_number]

    def keep(self, surfels: Surfels, key: object, received: Doubles) -> None:
        """Keep the irradiance [parts, 3] of surfels of a scene with this key for the next frame."""
        assert self.surfels is not None  # noqa: S101  they are some of these
        if self.received is None:
            self.received = np.zeros((len(self.surfels.part_area), 3))
        self._latest = key
        self.received[surfels.part_number] = received


def _same_surfaces(before: Scene, now: Scene) -> bool:
    """Return whether a scene has the triangles of another with their materials, wherever they are."""
    names = "triangles", "material_ids", "colors", "uvs"
    return before is now or (
        len(before.materials) == len(now.materials)
        and all(a is b or astuple(a) == astuple(b) for a, b in zip(before.materials, now.materials, strict=True))
        and len(before.textures) == len(now.textures)
        and all(a is b for a, b in zip(before.textures, now.textures, strict=True))
        and all(_equal(getattr(before, name), getattr(now, name)) for name in names)
    )


def _equal(a: NDArray[np.generic], b: NDArray[np.generic]) -> bool:
    return a is b or np.array_equal(a, b)
