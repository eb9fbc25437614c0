"""Points on the triangles of a scene, with what surfels are made of."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene, wrapped
from ssgi_cl.core.srgb import BYTES

Doubles = NDArray[np.float64]
Triangles = slice | NDArray[np.intp] | NDArray[np.int32]


class SurfacePoints(NamedTuple):
    """Points on the front of triangles.

    Attributes:
        position: [n, 3] scene units, relative to the scene's origin.
        normal: [n, 3] unit vectors; 0 of a triangle without area.
        albedo: [n, 3] in [0, 1], of all that is reflected.
        emission: [n, 3] W m^-2 sr^-1.
        triangle: [n] their triangles.
        weights: [n, 3] of the vertices in their positions.
    """

    position: Doubles
    normal: Doubles
    albedo: Doubles
    emission: Doubles
    triangle: NDArray[np.intp]
    weights: Doubles

    def chosen(self, which: NDArray[np.intp]) -> SurfacePoints:
        """Return those of these numbers."""
        chosen: Any = (values.take(which, axis=0) for values in self)
        return SurfacePoints(*chosen)


def surface_points(
    scene: Scene, triangle: NDArray[np.intp], weights: Doubles
) -> tuple[SurfacePoints, NDArray[np.bool_]]:
    """Return the points of triangles [n] at weights [n, 3] of their vertices, and which lie in no hole, [n]."""
    albedo, emission, solid = coats_of(scene, triangle, weights)
    return SurfacePoints(*places_of(scene, triangle, weights), albedo, emission, triangle, weights), solid


def places_of(scene: Scene, triangle: NDArray[np.intp], weights: Doubles) -> tuple[Doubles, Doubles]:
    """Return positions and normals of `surface_points` alone."""
    corners = scene.positions[scene.triangles[triangle]].astype(np.float64)
    position: Doubles = np.einsum("nk,nkc->nc", weights, corners)
    normal = np.stack(_cross(*(corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)), axis=1)
    normal /= np.maximum(np.sqrt(np.einsum("nc,nc->n", normal, normal)), 1e-300)[:, None]
    return position, normal


def coats_of(scene: Scene, triangle: NDArray[np.intp], weights: Doubles) -> tuple[Doubles, Doubles, NDArray[np.bool_]]:
    """Return albedo and emission of `surface_points` alone, and which lie in no hole."""
    corners = scene.triangles[triangle]

    def mixed(values: NDArray[np.float32]) -> Doubles:
        result: Doubles = np.einsum("nk,nkc->nc", weights, values[corners].astype(np.float64))
        return result

    ids = scene.material_ids[triangle]
    albedo = np.array([m.albedo for m in scene.materials])[ids]
    if (scene.colors != 1.0).any():
        albedo *= np.clip(mixed(scene.colors), 0.0, None)
    emission = np.array([m.emission for m in scene.materials])[ids]
    solid = np.ones(len(triangle), np.bool_)
    textured = [index for index, m in enumerate(scene.materials) if max(m.texture, m.emission_texture) >= 0]
    uvs = mixed(scene.uvs) if textured else np.zeros((len(triangle), 2))
    for index in textured:
        material, own = scene.materials[index], ids == index
        if material.texture >= 0:
            texels = _nearest(scene, material.texture, uvs[own])
            albedo[own] *= BYTES[texels[:, :3]]
            if material.has_holes:
                solid[own] = texels[:, 3] / 255.0 * material.alpha >= material.alpha_cutoff
        if material.emits and material.emission_texture >= 0:
            emission[own] *= BYTES[_nearest(scene, material.emission_texture, uvs[own])[:, :3]]
    # What lobes reflect goes every way.
    albedo += np.array([m.spread for m in scene.materials])[ids]
    return np.clip(albedo, 0.0, 1.0), emission, solid


def weights_at(scene: Scene, triangle: NDArray[np.intp], position: Doubles) -> Doubles:
    """Return the weights [n, 3] of the vertices of triangles [n] in positions [n, 3] on them, relative to the scene's
    origin; of the nearest place that edges allow, about, for others."""
    a, b, c = scene.positions[scene.triangles[triangle]].astype(np.float64).transpose(1, 0, 2)
    first, second, way = b - a, c - a, position - a
    normal = np.cross(first, second)
    squared = np.maximum(np.einsum("nc,nc->n", normal, normal), 1e-300)
    of_b = np.einsum("nc,nc->n", np.cross(way, second), normal) / squared
    of_c = np.einsum("nc,nc->n", np.cross(first, way), normal) / squared
    weights = np.clip(np.stack([1.0 - of_b - of_c, of_b, of_c], axis=1), 0.0, 1.0)
    found: Doubles = weights / weights.sum(axis=1, keepdims=True)
    return found


def triangle_cross(scene: Scene, chosen: Triangles) -> tuple[Doubles, Doubles, Doubles]:
    """Return x, y and z of the normals of triangles, as long as twice their areas."""
    vertices = scene.triangles[chosen].T.astype(np.intp, order="C")  # what is gathered lies in its order
    places = [column.astype(np.float64)[vertices] for column in scene.positions.T]
    first, second = ([of[i] - of[0] for of in places] for i in (1, 2))
    return _cross(first, second)


def _cross(u: Iterable[Doubles], v: Iterable[Doubles]) -> tuple[Doubles, Doubles, Doubles]:
    """Return x, y and z of cross products, from those of vectors."""
    (ux, uy, uz), (vx, vy, vz) = u, v
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def _nearest(scene: Scene, texture: int, uvs: Doubles) -> NDArray[np.uint8]:
    """Return [n, 4] the texels of a texture at [n, 2] coordinates, v = 0 at the bottom."""
    texels = scene.textures[texture]
    across, down = (wrapped(uvs[:, i], kind) for i, kind in enumerate(scene.wraps[texture]))
    rows, columns = texels.shape[:2]
    column = np.minimum((across * columns).astype(np.intp), columns - 1)
    row = np.minimum(((1.0 - down) * rows).astype(np.intp), rows - 1)
    found: NDArray[np.uint8] = texels[row, column]
    return found
