"""Whether a scene is enclosed, so that the sky comes in through openings."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.environment_samples import map_directions
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh
from ssgi_cl.techniques.occupancy.scene_rays import rays_meet_triangles

MOST_TRIANGLES = 1 << 12
"""Of a scene whose sky is found by rays. Among 600 they take 2.6 to 2.8 times as long as depth maps of 128 directions,
and among 20,000 five times."""
RAYS = 1 << 16
"""From points of a scene's box."""
PARTS = 16
"""Rows and columns of parts of the sphere."""
UNSEEN = 0.02
"""What a part counts that no ray finds open: all light counts somewhere."""
OPEN = 0.1
"""Share of these that leaves a scene that is not enclosed: .03 in rooms with a window, .17 in a box with an open side,
where depth maps err less."""


def sky_by_rays(scene: Scene, runtime: Runtime) -> bool:
    """Return whether the light of environments is found by rays: the scene is enclosed, and has few triangles, which
    rays of bounces meet too.

    Under an open sky depth maps of many directions cost less than as many rays. Computed once for a scene.
    """
    few = len(scene.triangles) <= MOST_TRIANGLES
    return few and rays_meet_triangles(scene) and openness(scene, runtime).share < OPEN


def openness(scene: Scene, runtime: Runtime) -> Openness:
    """Return which rays from anywhere in a scene's box leave it. Computed once for a scene."""
    found: Openness = runtime.prepared((Openness, scene.key), lambda: Openness(scene, runtime), of=scene)
    return found


class Openness:
    """Where the sky is seen from within a scene.

    Args:
        scene: any; holes block.
        runtime: the device.

    Attributes:
        share: of rays from anywhere in the scene's box, to anywhere, those that leave it.
        seen: [PARTS, PARTS] that of each part of the map of `sample_environments`, and `UNSEEN`.
    """

    def __init__(self, scene: Scene, runtime: Runtime) -> None:
        bvh = scene_bvh(scene, runtime)
        low, high = scene.bounds - scene.origin
        points = r_points(0, RAYS, 5)
        way = map_directions(*(2.0 * points[:, 3:] - 1.0).T)
        rays = np.concatenate([low + points[:, :3] * (high - low), 2.0 * np.linalg.norm(high - low) * way], axis=1)
        left = runtime.empty(RAYS, np.float32)
        runtime.kernel("sky_rays/sky_openness.cl").run(
            (1, RAYS), rays=runtime.array(rays.astype(np.float32)), nodes=bvh.nodes, triangles=bvh.triangles, open=left
        )
        open_ = left.download()
        self.share = float(open_.mean())
        row, column = (points[:, 3:] * PARTS).astype(np.intp).T
        part = row * PARTS + column
        shares = np.bincount(part, open_, PARTS**2) / np.maximum(np.bincount(part, minlength=PARTS**2), 1)
        self.seen = (shares + UNSEEN).reshape(PARTS, PARTS)
