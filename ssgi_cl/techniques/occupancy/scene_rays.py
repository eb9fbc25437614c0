"""Rays against the triangles of a scene, from view space."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct, floats
from ssgi_cl.rasterize.raster.scene_bvh import scene_bvh

SCENE_RAYS = Struct("RaysParams", floats("xx", "xy", "xz", "x", "yx", "yy", "yz", "y", "zx", "zy", "zz", "z", "lift"))
LIFT = 2.0**-13
"""Height above their surfaces at which rays begin and end, in diagonals of the scene's box: more than the rounding of
positions that are found from depth."""

MOST_TRIANGLES = 1 << 16
"""Of a scene in whose whole frames virtual point lights carry the first bounce of punctual lights. With more, each ray
to a light takes long, and what rays over hemispheres meet tells of that bounce as well."""


def rays_meet_triangles(scene: Scene) -> bool:
    """Return whether rays of bounces meet the triangles of a scene, and not the cells of the occupancy grid: none has
    holes, which the grid knows."""
    return not scene.has_holes


def rays_carry_first_bounce(scene: Scene) -> bool:
    """Return whether rays over hemispheres find the first bounce of punctual lights, without virtual point lights."""
    return rays_meet_triangles(scene) and len(scene.triangles) > MOST_TRIANGLES


class SceneRays:
    """What kernels that include kernels/rays/ends.clh follow rays through.

    Args:
        runtime: the device.
        scene: whose triangles block rays.
        view: [4, 4] from world space to the space of the kernel.
        unit: scene units of the length in which the kernel counts.

    Attributes:
        bvh: the hierarchy.
        arguments: of such kernels.
    """

    def __init__(self, runtime: Runtime, scene: Scene, view: NDArray[np.float64], unit: float) -> None:
        self.bvh = made = scene_bvh(scene, runtime)
        # In float64: origin and camera may be far from the world's and near each other.
        turn, shift = view[:3, :3].T, -view[:3, :3].T @ view[:3, 3] - scene.origin
        values = np.column_stack([turn * unit, shift]).ravel().tolist()
        lift = LIFT * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) / unit
        params = SCENE_RAYS.pack(dict(zip((name for name, _ in SCENE_RAYS.members), [*values, lift], strict=True)))
        self.arguments: dict[str, Any] = {"nodes": made.nodes, "triangles": made.triangles, "rays": params}
