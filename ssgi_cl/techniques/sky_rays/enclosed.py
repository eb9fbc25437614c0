"""Whether a scene is enclosed, so that the sky comes in through openings."""

from __future__ import annotations

import math

import numpy as np

from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles

MOST_TRIANGLES = 1 << 12
"""Of a scene whose sky is found by rays. Among 600 they take 2.6 to 2.8 times as long as depth maps of 128 directions,
and among 20,000 five times."""
RAYS = 1 << 14
"""From points of a scene's box."""
OPEN = 0.1
"""Share of these that leaves a scene that is not enclosed: .03 in rooms with a window, .17 in a box with an open side,
where depth maps err less."""


def sky_by_rays(scene: Scene, runtime: Runtime) -> bool:
    """Return whether the light of environments is found by rays: the scene is enclosed, and has few triangles, which
    rays of bounces meet too.

    Under an open sky depth maps of many directions cost less than as many rays. Computed once for a scene.
    """
    few = len(scene.triangles) <= MOST_TRIANGLES
    return few and rays_meet_triangles(scene) and openness(scene, runtime) < OPEN


def openness(scene: Scene, runtime: Runtime) -> float:
    """Return the share of rays from anywhere in a scene's box, to anywhere, that leaves it."""
    found: _Openness = runtime.prepared((_Openness, scene.key), lambda: _Openness(runtime, scene), of=scene)
    return found.share


class _Openness:
    """See `openness`."""

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        bvh = scene_bvh(scene, runtime)
        low, high = scene.bounds - scene.origin
        points = r_points(0, RAYS, 5)
        height, angle = 2.0 * points[:, 3] - 1.0, 2.0 * math.pi * points[:, 4]
        ring = np.sqrt(1.0 - height**2)
        way = np.stack([ring * np.cos(angle), height, ring * np.sin(angle)], axis=1)
        rays = np.concatenate([low + points[:, :3] * (high - low), 2.0 * np.linalg.norm(high - low) * way], axis=1)
        count = runtime.array(np.zeros(1, np.int32))
        runtime.kernel("sky_rays/sky_openness.cl").run(
            (1, RAYS), rays=runtime.array(rays.astype(np.float32)), nodes=bvh.nodes, triangles=bvh.triangles, open=count
        )
        self.share = float(count.download()[0]) / RAYS
