"""A door that opens into a dark room, from one in which a lamp shines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.core.scene import Material
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize import moved
from ssgi_cl.rasterize.parts import assemble
from ssgi_cl.rasterize.scenes.shapes import box

TURN = np.radians(3.0)
"""By which it turns in a frame, up to a right angle."""
HINGE = (-0.45, 0.0, 0.0)


def door_that_opens(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of two rooms, and of a door between them that opens towards a still camera."""
    walls = (
        box((-2.0, -0.1, -2.0), (2.0, 0.0, 2.6)),
        box((-2.0, 2.4, -2.0), (2.0, 2.5, 2.6)),
        box((-2.1, 0.0, -2.0), (-2.0, 2.4, 2.6)),
        box((2.0, 0.0, -2.0), (2.1, 2.4, 2.6)),
        box((-2.1, 0.0, -2.1), (2.1, 2.4, -2.0)),
        box((-2.1, 0.0, 2.6), (2.1, 2.4, 2.7)),
        box((-2.0, 0.0, -0.1), (-0.45, 2.4, 0.0)),
        box((0.45, 0.0, -0.1), (2.0, 2.4, 0.0)),
        box((-0.45, 2.0, -0.1), (0.45, 2.4, 0.0)),
    )
    leaf = box((-0.45, 0.0, -0.05), (0.45, 2.0, 0.0))
    start = assemble([*walls, leaf], [Material()])
    own = np.arange(len(start.positions)) >= len(assemble(list(walls), [Material()]).positions)
    camera = camera_at((0.7, 1.5, 2.4), (-0.1, 0.9, 0.0), 0.9, size)
    lamp = SpotLight((0.3, 2.0, -1.7), (-0.1, -0.6, 1.0), 1.2, (8.0, 7.0, 6.0))
    dim = SpotLight((1.2, 2.2, 2.2), (-0.6, -1.0, -0.8), 1.2, (0.6, 0.6, 0.8))
    for number in range(frames):
        angle = -min(TURN * number, np.pi / 2.0)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
        turn[:3, 3] = np.subtract(HINGE, turn[:3, :3] @ HINGE)
        yield Shot(moved(start, turn, vertices=own), camera, 0.4, (lamp, dim))
