"""A camera that walks through any scene and looks about."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import load_scene
from ssgi_cl.rasterize.raster.default_camera import default_camera
from ssgi_cl.rasterize.scenes import make_scene

STEP = 0.006
"""Of the way to what the camera aims at (of a file: .0015 of the diagonal of its box), in a frame."""
RADIUS = 0.02
"""Of ambient occlusion, of the diagonal of the box of a scene from a file."""


def walk(
    scene: Scene, view: tuple[Any, Any], yfov: float, step: float, radius: float, size: Size, frames: int
) -> Iterator[Shot]:
    """Yield frames of a camera that goes ahead by `step` scene units each, and looks to the sides, up and down."""
    start, target = view
    forward = np.subtract(target, start) / np.linalg.norm(np.subtract(target, start))
    for number in range(frames):
        eye = np.add(start, step * number * forward)
        aim = eye + forward + np.array([0.1 * np.sin(0.15 * number), 0.02 * np.sin(0.4 * number), 0.0])
        yield Shot(scene, camera_at(eye, aim, yfov, size), radius)


def walk_of_scene(name: str, size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a walk through a built-in or generated scene."""
    room = make_scene(name)
    step = STEP * float(np.linalg.norm(np.subtract(room.target, room.eye)))
    return walk(room.scene, (room.eye, room.target), room.yfov, step, room.ao_radius, size, frames)


def walk_of_file(path: str, size: Size, frames: int, runtime: Runtime) -> Iterator[Shot]:
    """Yield frames of a walk through the scene of a file, from its default camera on."""
    scene = load_scene(path)
    first = default_camera(scene, size[1], size[0], runtime=runtime)
    extent = float(np.linalg.norm(np.ptp(scene.positions, axis=0)))
    yfov = 2.0 * float(np.arctan(1.0 / first.projection[1, 1]))
    view = first.position, first.position - first.view[2, :3]
    return walk(scene, view, yfov, STEP / 4.0 * extent, RADIUS * extent, size, frames)
