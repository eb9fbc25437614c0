"""Ambient occlusion by Embree's rays against the mesh, asked for in one batch through embreex.

Origins, directions and reaches are made before and lie contiguous in memory, so that a run is the
queries and the mean of their answers. `mitsuba_rays` casts the same rays through wider packets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.truth.bent_normals import cosine_rays
from ssgi_cl.truth.ray_ao import MOST_RAYS, Settings
from ssgi_cl.truth.raycast import RayCaster
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from .extras import missing_package

Floats = NDArray[np.float32]

SEED = 1 << 32
"""Of random numbers: none that a pass of the reference has, whose rays these would otherwise be."""


class Tree(RayCaster):
    """Triangles whose search tree can be built again."""

    def bring(self) -> None:
        """Copy the triangles to a new tree, which is not built yet.

        A program of its own would share its arrays with Embree, so this is not counted.
        """
        from embreex import mesh_construction, rtcore_scene

        self._rays = rtcore_scene.EmbreeScene(robust=True)
        mesh_construction.TriangleMesh(self._rays, self._positions, self._triangles)

    def build(self) -> None:
        """Build the tree of the triangles that were brought: the first query does."""
        self._rays.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))


class Rays:
    """Rays from the points that a context's camera sees, made before they are cast."""

    def __init__(self, context: Context, rays: int) -> None:
        self._tree = context.shared("embreex's rays", lambda: Tree(context.view.scene))
        self._size = context.size
        self._rays = rays
        self._curve = Settings.of(context.radius, rays, "cosine", context.truths.attenuation, None, SEED, False).curve
        every = slice(0, context.size[0])
        spots = self._tree.spots(context.camera, every, context.host_gbuffer)
        self._pixel = spots.pixel
        way, below = cosine_rays(spots, 0, rays, SEED)
        reach = np.float32(context.radius * self._tree.scale)
        self._start = np.ascontiguousarray(np.tile(spots.start, (rays, 1)), np.float32)
        self._way = np.ascontiguousarray(way.reshape(-1, 3), np.float32)
        self._below = below.ravel()
        self._reach = np.where(self._below, np.float32(-1.0), reach)  # negative: not traced

    def cast(self) -> Floats:
        """Return A [rows, columns] float32."""
        image = np.ones(self._size, np.float32)
        if not len(self._pixel):
            return image
        if self._curve is None:
            met = self._tree.blocked(self._start, self._way, self._reach)
            weight: NDArray[np.floating] = (met | self._below).astype(np.float32)
        else:
            # A copy, since embreex writes distances over the reaches.
            distance = self._tree.distance(self._start, self._way, self._reach.copy())
            share = np.where(self._below, np.float32(0.0), distance / self._reach)
            weight = self._curve(np.clip(share, 0.0, 1.0))
            weight = np.where(~self._below & (distance >= self._reach), 0.0, weight)
        hidden = weight.reshape(self._rays, -1).mean(axis=0, dtype=np.float32)
        image.ravel()[self._pixel] = np.float32(1.0) - hidden
        return np.clip(image, 0.0, 1.0)


def rays(context: Context, setting: str) -> Subject:
    """Make rays as the reference casts them ready, but fewer; the setting is their number a pixel.

    Builds the search tree and finds the points that they start from.
    """
    number = count_of(setting, "rays per pixel", 1, MOST_RAYS)
    return Subject.of_image(
        Rays(context, number).cast,
        on_device=False,
        quantity="occlusion",
        samples=float(number) * context.surface_pixels,
        truths={"world": context.occlusion},
        counted="queries in one batch; rays made before",
    )


FAMILIES = {"embree": Family(rays, ("1", "4", "16"), missing=lambda: missing_package("embreex", "truth"))}
