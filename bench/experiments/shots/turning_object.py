"""A slab that turns before a wall and on a floor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.core.scene import Material
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize import moved
from ssgi_cl.rasterize.parts import assemble
from ssgi_cl.rasterize.scenes.shapes import box, quad

TURN = np.radians(4.0)
"""By which it turns in a frame."""


def turning_object(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a slab that turns before a wall and on a floor, which stand still."""
    wall = quad([(-3, 0, -1), (3, 0, -1), (3, 3, -1), (-3, 3, -1)])
    floor = quad([(-3, 0, 2), (3, 0, 2), (3, 0, -1), (-3, 0, -1)])
    slab = box((-0.7, 0.0, -0.15), (0.7, 1.4, 0.15))
    start = assemble([wall, floor, slab], [Material()])
    own = np.arange(len(start.positions)) >= len(assemble([wall, floor], [Material()]).positions)
    camera = camera_at((0.6, 1.7, 3.0), (0.0, 0.7, -0.5), 0.9, size)
    for number in range(frames):
        c, s = np.cos(TURN * number), np.sin(TURN * number)
        turn = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
        yield Shot(moved(start, turn, vertices=own), camera, 0.5)
