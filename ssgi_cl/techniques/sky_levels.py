"""Environments as images of ever fewer texels, for lookups over a solid angle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, are_same
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.shade import sky_image

Doubles = NDArray[np.float64]

MOST_ROWS = 256
"""Rows of the largest image: larger ones are averaged first."""


class SkyLevels:
    """The sum of environments in device memory, as kernels/common/sky.clh reads it.

    Attributes:
        count: of images; 0 where no environment shines.
        texels_per_angle: of the first image at the equator, per steradian.
        texels, places: on the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self.count = 0
        self.texels_per_angle = 0.0
        self.texels = runtime.array(np.zeros(3, np.float32))
        self.places = runtime.array(np.zeros(3, np.int32))
        self._environments: tuple[Environment, ...] = ()

    def set(self, environments: Sequence[Environment]) -> None:
        """Set the environments; nothing is done if they are those of the latest call."""
        now = tuple(environments)
        if are_same(now, self._environments):
            return
        self._environments = now
        sky = sky_image(now).astype(np.float64)
        self.count = 0
        if not sky.any():
            return
        images = levels(sky)
        ends = np.cumsum([0, *(image.size for image in images)])
        places = [[end, *image.shape[:2]] for end, image in zip(ends, images, strict=False)]
        self.texels = DeviceArray(self.runtime, np.concatenate([image.ravel() for image in images]).astype(np.float32))
        self.places = DeviceArray(self.runtime, np.array(places, np.int32).ravel())
        self.count = len(images)
        rows, columns = images[0].shape[:2]
        self.texels_per_angle = rows * columns / (2.0 * math.pi**2)


def levels(sky: Doubles) -> list[Doubles]:
    """Return [rows, columns, 3] images, each of half the size of the one before, to a single row.

    A texel is the mean of what it covers, by solid angle.
    """
    while sky.shape[0] > MOST_ROWS:
        sky = _halved(sky)
    images = [sky]
    while images[-1].shape[0] > 1:
        images.append(_halved(images[-1]))
    return images


def _halved(image: Doubles) -> Doubles:
    """Return an image of half the rows and columns, rounded up; an odd last one counts twice."""
    rows, columns = image.shape[:2]
    edges = np.linspace(0.0, math.pi, rows + 1)
    weight = np.broadcast_to((np.cos(edges[:-1]) - np.cos(edges[1:]))[:, None], (rows, columns))
    pad = ((0, rows % 2), (0, columns % 2 if columns > 1 else 0))
    weight = np.pad(weight, pad, mode="edge")
    values = np.pad(image, (*pad, (0, 0)), mode="edge") * weight[..., None]

    def summed(parts: Doubles) -> Doubles:
        parts = parts[0::2] + parts[1::2]
        return parts if columns == 1 else parts[:, 0::2] + parts[:, 1::2]

    mean: Doubles = summed(values) / summed(weight)[..., None]
    return mean
