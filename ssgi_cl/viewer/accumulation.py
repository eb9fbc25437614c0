"""Refinement of a still picture: the mean of frames whose pixel centres move within the pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.sampling import r2_points
from ssgi_cl.viewer.pose import jittered

MOST_FRAMES = 16
"""Of which a still picture is the mean: edges are then steps of 1/16."""


class Accumulation:
    """The mean of frames of one look.

    Frame 0 has its samples at the pixels' centres, so that the first still picture is that of `gi.render`.
    """

    def __init__(self) -> None:
        self.count = 0
        self._sum: NDArray[np.float64] | None = None

    @property
    def done(self) -> bool:
        """Whether more frames would not be seen."""
        return self.count >= MOST_FRAMES

    def camera(self, camera: Camera) -> Camera:
        """Return the camera of the next frame."""
        if self.count == 0:
            return camera
        across, down = r2_points(self.count, self.count + 1)[0] - 0.5
        return jittered(camera, float(across), float(down))

    def add(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        """Add a frame [rows, columns, 3]; return the mean of all so far."""
        self._sum = radiance.astype(np.float64) if self._sum is None else self._sum + radiance
        self.count += 1
        mean: NDArray[np.float32] = (self._sum / self.count).astype(np.float32)
        return mean
