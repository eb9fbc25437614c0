"""Sequences of frames as test cases for what is reused of earlier ones: cameras, objects and lights that move."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize import moved
from ssgi_cl.rasterize.parts import assemble
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.rasterize.scenes.shapes import box, quad

Doubles = NDArray[np.float64]

STEP = 0.06
"""Scene units that the camera goes in a frame."""
TURN = np.radians(4.0)
"""By which the object turns in a frame."""


@dataclass(frozen=True)
class Shot:
    """A frame of a sequence.

    Attributes:
        scene, camera: what it shows.
        radius: of ambient occlusion, scene units.
        lights: of the frame; a sequence without is one of ambient occlusion.
        switched: whether lights have just changed.
    """

    scene: Scene
    camera: Camera
    radius: float
    lights: tuple[Any, ...] = ()
    switched: bool = False


def path_through_the_hall(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a camera that walks through the hall and looks about."""
    hall = make_scene("hall")
    forward = np.subtract(hall.target, hall.eye) / np.linalg.norm(np.subtract(hall.target, hall.eye))
    for number in range(frames):
        eye = np.add(hall.eye, STEP * number * forward)
        aim = eye + forward + np.array([0.1 * np.sin(0.15 * number), 0.02 * np.sin(0.4 * number), 0.0])
        yield Shot(hall.scene, _camera(eye, aim, hall.yfov, size), hall.ao_radius)


def still_camera(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of the hall, in which nothing moves."""
    hall = make_scene("hall")
    for _ in range(frames):
        yield Shot(hall.scene, _camera(hall.eye, hall.target, hall.yfov, size), hall.ao_radius)


def turning_object(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a slab that turns before a wall and on a floor, which stand still."""
    wall = quad([(-3, 0, -1), (3, 0, -1), (3, 3, -1), (-3, 3, -1)])
    floor = quad([(-3, 0, 2), (3, 0, 2), (3, 0, -1), (-3, 0, -1)])
    slab = box((-0.7, 0.0, -0.15), (0.7, 1.4, 0.15))
    start = assemble([wall, floor, slab], [Material()])
    own = np.arange(len(start.positions)) >= len(assemble([wall, floor], [Material()]).positions)
    camera = _camera((0.6, 1.7, 3.0), (0.0, 0.7, -0.5), 0.9, size)
    for number in range(frames):
        c, s = np.cos(TURN * number), np.sin(TURN * number)
        turn = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])
        yield Shot(moved(start, turn, vertices=own), camera, 0.5)


def light_that_switches_off(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a still camera in the Cornell box, one of whose two lights goes out halfway."""
    room = make_scene("cornell_box")
    lights = (*room.lights, SpotLight((0.1, 0.3, 0.1), (1.0, -0.6, 0.8), 0.7, (0.05, 0.05, 0.08)))
    camera = _camera(room.eye, room.target, room.yfov, size)
    for number in range(frames):
        left = lights[number >= frames // 2 :]
        yield Shot(room.scene, camera, room.ao_radius, left, switched=number == frames // 2)


def hard_cut(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of one still camera in the hall, then of another, which the technique is not told of."""
    hall = make_scene("hall")
    views = ((hall.eye, hall.target), (np.add(hall.eye, (-2.5, 0.3, -3.0)), np.add(hall.target, (3.0, -1.0, 1.0))))
    for number in range(frames):
        eye, target = views[number >= frames // 2]
        yield Shot(hall.scene, _camera(eye, target, hall.yfov, size), hall.ao_radius)


SHOTS: Mapping[str, Callable[[Size, int], Iterator[Shot]]] = {
    "still camera": still_camera,
    "path through the hall": path_through_the_hall,
    "turning object": turning_object,
    "light switched off": light_that_switches_off,
    "hard cut": hard_cut,
}
"""By name."""


def _camera(eye: Any, target: Any, yfov: float, size: Size) -> Camera:
    return Camera.look_at(eye, target, yfov=yfov, width=size[1], height=size[0])
