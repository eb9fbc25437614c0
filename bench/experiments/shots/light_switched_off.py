"""One of two lights in the Cornell box goes out."""

from __future__ import annotations

from collections.abc import Iterator

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize.scenes import make_scene


def light_that_switches_off(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a still camera in the Cornell box, one of whose two lights goes out halfway."""
    room = make_scene("cornell_box")
    lights = (*room.lights, SpotLight((0.1, 0.3, 0.1), (1.0, -0.6, 0.8), 0.7, (0.05, 0.05, 0.08)))
    camera = camera_at(room.eye, room.target, room.yfov, size)
    for number in range(frames):
        left = lights[number >= frames // 2 :]
        yield Shot(room.scene, camera, room.ao_radius, left, bounce=True, switched=number == frames // 2)
