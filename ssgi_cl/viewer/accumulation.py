"""Refinement of a still picture: the samples of `render`, one after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import LARGEST_SIZE, Camera
from ssgi_cl.frame.history import PAD
from ssgi_cl.frame.samples import shifts

MOST_FRAMES = 16
"""Of which a still picture is the mean."""


class Accumulation:
    """The mean of frames of one look.

    The first frame is that of `gi.render`, and no part of the mean: that is of the frames of
    `gi.render(samples=16)`, which lie at other places within the pixels and have other patterns.

    Attributes:
        count: frames in the mean.
    """

    def __init__(self) -> None:
        self.count = 0
        self._begun = False
        self._sum: NDArray[np.float64] | None = None

    @property
    def begun(self) -> bool:
        """Whether the first frame is there."""
        return self._begun

    @property
    def done(self) -> bool:
        """Whether more frames would not be seen."""
        return self.count >= MOST_FRAMES

    def camera(self, camera: Camera) -> Camera:
        """Return the camera of the next frame, whose image exceeds the picture of `camera` but for the first."""
        if not self._begun or max(camera.size) > LARGEST_SIZE - PAD:
            return camera
        right, down, before, above = shifts(MOST_FRAMES)[self.count]
        rows, columns = camera.size
        return camera.cropped(right - before, down - above, columns + PAD, rows + PAD)

    def add(self, radiance: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
        """Add a frame of the picture of `camera` [rows, columns, 3]; return the mean of all so far, or the first."""
        if not self._begun:
            self._begun = True
            return radiance
        _, _, before, above = shifts(MOST_FRAMES)[self.count]
        rows, columns = camera.size
        if radiance.shape[:2] != camera.size:
            radiance = radiance[above : above + rows, before : before + columns]
        self._sum = radiance.astype(np.float64) if self._sum is None else self._sum + radiance
        self.count += 1
        mean: NDArray[np.float32] = (self._sum / self.count).astype(np.float32)
        return mean
