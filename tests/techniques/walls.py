"""A floor by an infinite wall, seen so that both fill the image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer

from .analytic import Plane, trace


def wall_and_floor(kind: str) -> tuple[GBuffer, NDArray[np.float64]]:
    """Return the planes y = 0 and x = 0, and each floor pixel's distance from the wall.

    Distances are nan on the wall and where a radius of 1 would leave the image sideways; the image
    shows more than 1.2 scene units of both planes.
    """
    eye, target, size = (8.0, 8.0, 0.0), (0.0, 0.0, 0.0), (144, 200)
    if kind == "orthographic":
        made = Camera.orthographic(eye, target, view_height=2.4, width=size[1], height=size[0])
    else:
        made = Camera.look_at(eye, target, yfov=0.22, width=size[1], height=size[0])
    gbuffer = trace(made, [Plane((0, 0, 0), (0, 1, 0)), Plane((0, 0, 0), (1, 0, 0))])
    depth = np.asarray(gbuffer.depth, np.float32)
    point = made.unproject(depth)
    floor = np.abs(point[..., 1]) < np.abs(point[..., 0])
    inside = floor & (np.abs(point[..., 2]) < 0.4)
    return gbuffer, np.where(inside, point[..., 0], np.nan)
