"""Cameras that a scene's file describes: a place and a field of view, without a size in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import LEAST_SCALE, MOST_SCALE, Camera, orthographic_matrix, perspective_matrix
from ssgi_cl.core.immutable import Immutable, frozen


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneCamera(Immutable):
    """A camera of a file; `sized` gives the camera of a picture.

    Attributes:
        view: [4, 4] float64, world to view, a rigid motion.
        kind: "perspective" or "orthographic".
        height: perspective: vertical field of view in radians, in [1e-4, 3.14]; orthographic:
            height of the view in scene units, > 0.
        aspect: width over height of the picture that the file has in mind, or None for any.
        near, far: scene units; `far` may be infinite for a perspective camera.
    """

    view: NDArray[np.float64]
    kind: Literal["perspective", "orthographic"] = "perspective"
    height: float
    aspect: float | None = None
    near: float
    far: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "view", frozen(checks.matrix4("view", self.view)))
        checks.choice("kind", self.kind, ("perspective", "orthographic"))
        if self.kind == "perspective":
            checks.number("height", self.height, low=1e-4, high=3.14, unit="radians")
        else:
            checks.number("height", self.height, low=LEAST_SCALE, high=MOST_SCALE, unit="scene units")
        if self.aspect is not None:
            checks.number("aspect", self.aspect, low=1e-4, high=1e4)
        self.sized(1, 1)  # checks the rest

    def sized(self, width: int, height: int) -> Camera:
        """Return the camera of a picture that shows all of what the file's picture shows.

        A picture that is wider than `aspect` shows more at the sides, a narrower one above and
        below. Without `aspect` the vertical field of view is kept.

        Args:
            width, height: pixels, 1 to 16384.
        """
        wide = width / height if width and height else 1.0  # the camera refuses others
        tall = 1.0 if self.aspect is None else max(1.0, self.aspect / wide)
        if self.kind == "perspective":
            scale = 1.0 / (math.tan(0.5 * self.height) * tall)
            projection = perspective_matrix(scale / wide, scale, 0.0, 0.0, self.near, self.far)
        else:
            scale = 2.0 / (self.height * tall)
            projection = orthographic_matrix(scale / wide, scale, self.near, self.far)
        return Camera(view=self.view, projection=projection, width=width, height=height)
