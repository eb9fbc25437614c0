"""The hall, seen by a camera that walks, stands still, or is cut to another place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.bench.experiments.shots.walk import walk
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize.scenes import make_scene

STEP = 0.06
"""Scene units that the camera goes in a frame."""


def path_through_the_hall(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a camera that walks through the hall and looks about."""
    hall = make_scene("hall")
    return walk(hall.scene, (hall.eye, hall.target), hall.yfov, STEP, hall.ao_radius, size, frames)


def still_camera(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of the hall, in which nothing moves."""
    hall = make_scene("hall")
    for _ in range(frames):
        yield Shot(hall.scene, camera_at(hall.eye, hall.target, hall.yfov, size), hall.ao_radius)


def hard_cut(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of one still camera in the hall, then of another, which the technique is not told of."""
    hall = make_scene("hall")
    views = ((hall.eye, hall.target), (np.add(hall.eye, (-2.5, 0.3, -3.0)), np.add(hall.target, (3.0, -1.0, 1.0))))
    for number in range(frames):
        eye, target = views[number >= frames // 2]
        yield Shot(hall.scene, camera_at(eye, target, hall.yfov, size), hall.ao_radius)
