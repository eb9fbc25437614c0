"""The extent of a scene, and that of the subject of a scene with a large backdrop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene

Vector = NDArray[np.float64]
Vector32 = NDArray[np.float32]

_MOST_TRIANGLES = 50_000

_BACKDROP = 3.0
"""Times that a scene is larger than its subject, at least, if it has one."""

_FINE_BACKDROP = 10.0
"""The same where triangles of the backdrop are as small as those of the subject may be."""


@dataclass(frozen=True, eq=False)
class Extent:
    """Vertices that triangles use, and the box round them.

    Attributes:
        points: [vertices, 3] float32, relative to `origin`.
        origin: [3], world space.
        bounds: [2, 3], world space.
    """

    points: NDArray[np.float32]
    origin: Vector
    bounds: Vector

    @classmethod
    def of(cls, scene: Scene, triangles: NDArray[np.integer] | None = None) -> Extent:
        """Return the extent of a scene, or of some of its triangles [n, 3]."""
        used = np.zeros(len(scene.positions), np.bool_)
        used[(scene.triangles if triangles is None else triangles).ravel()] = True
        points = scene.positions[used]
        corners = np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)
        return cls(points, scene.origin, corners + scene.origin)

    @classmethod
    def of_subject(cls, scene: Scene) -> Extent:
        """Return the extent of a scene without its backdrop: a ground, a wall, a dome.

        With triangles sorted by their size, the longest side of the box round each, the subject is
        the longest list of the smallest ones that holds half of all triangles and whose box is a
        third of the scene's or less, while the next triangle is half as large as that box. A tenth
        of the scene is enough where triangles of the backdrop are smaller.

        Of more than 50,000 triangles every second, third and so on decides how large triangles of
        the subject are.
        """
        most = _largest_of_subject(scene)
        if most is None:
            return cls.of(scene)
        return cls.of(scene, scene.triangles[_boxes(scene, 1)[2] <= most])

    def thinned(self, most: int) -> Extent:
        """Return the extent of at most that many of the points."""
        step = -(-len(self.points) // most)
        return Extent(self.points[::step], self.origin, self.bounds)

    @property
    def size(self) -> Vector:
        """[3], scene units."""
        return np.asarray(self.bounds[1] - self.bounds[0])

    @property
    def diagonal(self) -> float:
        """Scene units; 1 for a single point."""
        return float(np.linalg.norm(self.size)) or 1.0

    def at(self, x: float, y: float, z: float) -> Vector:
        """World position at fractions of the box."""
        return np.asarray(self.bounds[0] + self.size * (x, y, z))

    def holds(self, point: Vector) -> bool:
        """Whether a point is within the box."""
        return bool((point >= self.bounds[0]).all() and (point <= self.bounds[1]).all())


def _boxes(scene: Scene, step: int) -> tuple[Vector32, Vector32, Vector32]:
    """Return least and greatest corner [n, 3] and size [n] of every `step`-th triangle."""
    corners = scene.positions[scene.triangles[::step]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    return low, high, (high - low).max(axis=1)


def _largest_of_subject(scene: Scene) -> float | None:
    """Return the size of the largest triangle of a scene's subject; None if that is all."""
    low, high, size = _boxes(scene, -(-len(scene.triangles) // _MOST_TRIANGLES))
    order = np.argsort(size, kind="stable")
    size, count = size[order], len(order)
    low = np.minimum.accumulate(low[order], axis=0)
    high = np.maximum.accumulate(high[order], axis=0)
    diagonals = np.linalg.norm((high - low).astype(np.float64), axis=1)
    smaller = diagonals[:-1]
    apart = (smaller <= diagonals[-1] / _BACKDROP) & (size[1:] >= 0.5 * smaller)
    apart |= smaller <= diagonals[-1] / _FINE_BACKDROP
    apart &= (np.arange(1, count) >= 0.5 * count) & (size[1:] > size[:-1])
    return float(size[np.flatnonzero(apart)[-1]]) if apart.any() else None
