"""A frame of a sequence, and its camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size


@dataclass(frozen=True)
class Shot:
    """A frame of a sequence.

    Attributes:
        scene, camera: what it shows.
        radius: of ambient occlusion, scene units.
        lights: of the frame; empty where the scene's own do.
        bounce: whether one bounce of light is what the sequence tests, in place of ambient occlusion.
        switched: whether lights have just changed.
    """

    scene: Scene
    camera: Camera
    radius: float
    lights: tuple[Any, ...] = ()
    bounce: bool = False
    switched: bool = False


def camera_at(eye: Any, target: Any, yfov: float, size: Size) -> Camera:
    """Return a camera that looks from a point at another one."""
    return Camera.look_at(eye, target, yfov=yfov, width=size[1], height=size[0])
