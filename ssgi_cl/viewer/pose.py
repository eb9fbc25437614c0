"""Where a tab's camera is: a pose without a size in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.camera import Camera

Vector = tuple[float, float, float]

_LEVEL = 0.02
"""Of the y component of a camera's axes: one that stands level turns about y."""


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A perspective camera without a size.

    Attributes:
        eye, target: world space, scene units.
        up: world space.
        yfov: vertical field of view in radians.
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    yfov: float = 0.9

    @classmethod
    def of(cls, camera: Camera, distance: float) -> Pose:
        """Return the pose of a camera that turns about the point `distance` scene units ahead of it.

        An orthographic camera becomes a perspective one that shows as much at that distance.
        """
        eye, ahead = camera.position, -camera.view[2, :3]
        scale = 1.0 / float(camera.projection[1, 1])
        slope = scale / distance if camera.is_orthographic else scale
        return cls(
            eye=_vector(eye),
            target=_vector(eye + distance * ahead),
            up=(0.0, 1.0, 0.0) if abs(camera.view[0, 1]) < _LEVEL < camera.view[1, 1] else _vector(camera.view[1, :3]),
            yfov=2.0 * math.atan(slope),
        )

    def camera(self, width: int, height: int) -> Camera:
        """Return the camera of a picture of `width` x `height` pixels."""
        return Camera.look_at(self.eye, self.target, self.up, yfov=self.yfov, width=width, height=height)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
