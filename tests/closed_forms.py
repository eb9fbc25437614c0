"""Scenes of which ambient occlusion is known in closed form, and these forms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene

Doubles = NDArray[np.float64]

FAR = 1e4
"""Extent of walls that stand for infinite ones; they leave out about h / FAR of A."""


def made(corners: ArrayLike, triangles: ArrayLike, normals: ArrayLike | None = None) -> Scene:
    """Return a scene of triangles; without normals, those of the triangles are used."""
    points = np.asarray(corners, np.float64)
    faces = np.asarray(triangles, np.int32)
    middle = points[:4].mean(axis=0)
    return Scene(
        origin=middle,
        positions=(points - middle).astype(np.float32),
        normals=np.asarray(np.zeros(points.shape) if normals is None else normals, np.float32),
        uvs=np.zeros((len(points), 2), np.float32),
        colors=np.ones(points.shape, np.float32),
        triangles=faces,
        material_ids=np.zeros(len(faces), np.int32),
    )


Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]
"""A corner and the two edges that leave it."""


def quads(*parts: Quad, scale: float = 1.0, shift: ArrayLike = 0.0) -> Scene:
    """Return a scene of parallelograms."""
    corners = []
    for part in parts:
        corner, first, second = (np.asarray(p, np.float64) for p in part)
        corners += [corner, corner + first, corner + first + second, corner + second]
    faces = [[4 * i + k for k in t] for i in range(len(parts)) for t in ((0, 1, 2), (0, 2, 3))]
    return made(scale * np.array(corners) + np.asarray(shift), faces)


def with_mesh(scene: Scene, mesh: Any) -> Scene:
    """Return the scene with a trimesh in it (faceted)."""
    corners = np.concatenate([scene.positions + scene.origin, mesh.vertices])
    return made(corners, np.concatenate([scene.triangles, mesh.faces + len(scene.positions)]))


FLOOR: Quad = ((0, 0, -5), (0, 0, 10), (10, 0, 0))
START = 2.0**-20 * 20
"""Height above that floor at which rays start, scene units, at most."""
WALL: Quad = ((0, 0, -FAR), (0, FAR, 0), (0, 0, 2 * FAR))
"""The plane x = 0 above the floor y = 0."""
SIDE: Quad = ((0, 0, 0), (FAR, 0, 0), (0, FAR, 0))
"""The plane z = 0."""


def above(x: float, z: float = 0.0, *, size: int = 24, width: float = 1e-6) -> Camera:
    """Return a camera that sees a spot of the floor at (x, z), as small as a point, from above."""
    eye, target = (x, 0.01, z), (x, 0.0, z)
    return Camera.orthographic(eye, target, (0, 0, 1), view_height=width, width=size, height=size, far=1.0)


def ball(subdivisions: int = 5) -> Any:
    """Return a sphere of radius 1 round the origin, of triangles.

    Facets lie within the sphere; one of equal mean cross-section hides the same on average.
    """
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    mesh.apply_scale(math.sqrt(4.0 * math.pi / mesh.area))
    return mesh


def beside_sphere(lift: float, size: int = 24) -> tuple[Scene, Camera]:
    """Return a floor with a sphere of radius 1, its centre at `lift`, and a view of the floor."""
    mesh = ball()
    mesh.apply_translation((0.0, lift, 0.0))
    floor = quads(((-50, 0, -50), (0, 0, 100), (100, 0, 0)))
    camera = Camera.look_at((9, 4, 5), (1.8, 0, 1.0), yfov=0.12, width=size, height=size)
    return with_mesh(floor, mesh), camera


def hidden_by_wall(c: float, weighting: str, attenuation: str) -> float:
    """Return 1 - A at distance c (in radii) from an infinite wall.

    Directions that reach it fill half a cone round its normal, angle t to the normal, up to
    cos t = c; the distance is c / cos t. The rest is integration over t.
    """
    s, t = math.sqrt(1.0 - c * c), math.acos(c)
    if weighting == "uniform":
        whole = 1.0 - c
        lost = {"none": 0.0, "linear": -c * math.log(c), "quadratic": c - c * c}[attenuation]
        return 0.5 * (whole - lost)
    lost = {"none": 0.0, "linear": c * (math.log((1.0 + s) / c) - s), "quadratic": c * c * (s / c - t)}[attenuation]
    return (t - s * c - 2.0 * lost) / math.pi


def hidden_by_sphere(camera: Camera, lift: float, weighting: str) -> Doubles:
    """Return 1 - A of the floor of `beside_sphere`: the sphere's form factor and its solid angle.

    With d from the point to the centre: cos t / d^2 = lift / d^3 ("cosine"), of a cone with
    sin of its half-angle 1 / d ("uniform").
    """
    point = camera.unproject(np.ones(camera.size, np.float32)) - camera.position
    point = camera.position - point * (camera.position[1] / point[..., 1:2])  # on the floor
    away: Doubles = np.linalg.norm(point - (0.0, lift, 0.0), axis=-1)
    return lift / away**3 if weighting == "cosine" else 1.0 - np.sqrt(1.0 - away**-2)


def lit_by_wall(distance: ArrayLike, left: ArrayLike, right: ArrayLike, height: float) -> Doubles:
    """Return the form factor of a floor element to a rectangle that stands on the floor.

    Two rectangles whose common lower corner is the foot of the element's perpendicular (Siegel and
    Howell, "Thermal Radiation Heat Transfer", configuration of an element and a rectangle in planes
    at 90 degrees).

    Args:
        distance: from the element to the rectangle's plane, > 0.
        left, right: from the perpendicular's foot to the rectangle's ends; negative if the foot
            lies beyond that end.
        height: of the rectangle.
    """
    c = np.asarray(distance, np.float64)
    up = np.hypot(c, height)
    result: Doubles = sum(
        (np.arctan(side / c) - c / up * np.arctan(side / up)) / (2.0 * math.pi)
        for side in (np.asarray(left, np.float64), np.asarray(right, np.float64))
    )
    return result
