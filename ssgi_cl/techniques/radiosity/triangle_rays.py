"""Rays against the triangles of a scene, one from each of many places, for what is made once a scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import LIFT

Doubles = NDArray[np.float64]
Flags = NDArray[np.bool_]

REACH = 1.01
"""Length of rays, in diagonals of the scene's box."""
ROW = 64
"""Points in whose multiples rows lie."""
LEAST_COSINE = 0.25
"""Of rays that begin as high above their surfaces as others."""


def diagonal_of(scene: Scene) -> float:
    """Return that of a scene's box, more than 0."""
    return max(float(np.linalg.norm(np.ptp(scene.bounds, axis=0))), 1e-30)


def scattered(normal: Doubles, places: Doubles) -> Doubles:
    """Return directions in proportion to the cosine about normals [n, 3], for places [n, 2] of a unit square: to a
    point of a sphere on the surface."""
    z, turn = 2.0 * places[:, 0] - 1.0, 2.0 * math.pi * places[:, 1]
    ring = np.sqrt(1.0 - z * z)
    way: Doubles = normal * (1.0 + 1e-6) + np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return way


def row_length(count: int) -> int:
    """Return how many places rows of so many points have: a multiple of `ROW`, more than 0."""
    return max(-(-count // ROW) * ROW, ROW)


def point_rows(position: Doubles, direction: Doubles) -> NDArray[np.float32]:
    """Return points [n, 3] with normals or other directions as in kernels/radiosity/points.clh, [9, n or more]."""
    count = len(position)
    rows = np.zeros((9, row_length(count)), np.float32)
    rows[5] = 1.0
    rows[:3, :count], rows[3:6, :count] = position.T, direction.T
    return rows


class TriangleRays:
    """Rays from places relative to the scene's origin. Each call waits for the device.

    Args:
        runtime: the device.
        scene: without holes.

    Attributes:
        runtime, scene: as given.
        bvh: of its triangles.
        reach: length of rays that meet what there is, scene units.
        lift: height above their surfaces at which rays begin.
    """

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        self.runtime, self.scene = runtime, scene
        diagonal = diagonal_of(scene)
        self.reach, self.lift = REACH * diagonal, LIFT * diagonal
        self.bvh = scene_bvh(scene, runtime)

    def met(self, position: Doubles, way: Doubles) -> tuple[NDArray[np.int32], Doubles, Doubles]:
        """Return the triangles that rays meet first, -1 for none, where, and their normals on that side."""
        out: dict[str, tuple[int, type]] = {"met": (1, np.int32), "where": (1, np.float32), "facing": (3, np.float32)}
        met, where, facing = self._run("radiosity/radiosity_met.cl", position, way, out, reach=self.reach)
        return met[0], position + way * (where.T * self.reach), facing.T.astype(np.float64)

    def start(self, position: Doubles, normal: Doubles, way: Doubles) -> Doubles:
        """Return places a little along ways from surfaces; lifted ones would narrow what is in front."""
        cosine = np.einsum("nc,nc->n", normal, way)[:, None]
        begun: Doubles = position + way * (self.lift / np.maximum(cosine, LEAST_COSINE))
        return begun

    def blocked(self, position: Doubles, normal: Doubles, reach: float, lift: float | None = None) -> Flags:
        """Return whether a triangle is in front of places, by default of surfaces, within a reach."""
        more = {"lift": self.lift if lift is None else lift, "reach": reach}
        (found,) = self._run("radiosity/radiosity_blocked.cl", position, normal, {"blocked": (1, np.float32)}, **more)
        blocked: Flags = found[0] != 0.0
        return blocked

    def _run(
        self, name: str, position: Doubles, way: Doubles, out: dict[str, tuple[int, type]], **more: Any
    ) -> list[Any]:
        """Return what a kernel finds along ways: by name so many rows of a kind."""
        rows = point_rows(position, way)
        stride = rows.shape[1]
        arrays: dict[str, Any] = {key: self.runtime.empty(n * stride, kind) for key, (n, kind) in out.items()}
        self.runtime.kernel(name).run(
            (1, stride),
            points=self.runtime.array(rows),
            nodes=self.bvh.nodes,
            triangles=self.bvh.triangles,
            **arrays,
            **more,
        )
        return [array.download().reshape(-1, stride)[:, : len(position)] for array in arrays.values()]
