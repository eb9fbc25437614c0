"""A history over frames in device memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.history import History
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.runtime import Runtime


class DeviceHistory:
    """A `History` in device memory.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        channels: values of a pixel.

    Attributes:
        mean, fast, square: an image for each channel.
        count, reasons: one image.
    """

    def __init__(self, runtime: Runtime, size: Size, channels: int) -> None:
        self.size, self.channels = size, channels
        self.mean, self.fast, self.square = (runtime.plane(channels, size) for _ in range(3))
        self.count, self.reasons = runtime.plane(1, size), runtime.plane(1, size)

    def upload(self, history: History) -> None:
        """Replace the contents."""
        for name in ("mean", "fast", "square"):
            array = np.asarray(getattr(history, name), np.float32)
            getattr(self, name).upload(array[None] if array.ndim == 2 else np.moveaxis(array, -1, 0))
        self.count.upload(np.asarray(history.count, np.float32)[None])
        self.reasons.upload(history.reasons[None].astype(np.float32))

    def download(self) -> History:
        """Return the contents as arrays."""
        reasons = self.reasons.download()[0].astype(np.uint8)
        return History(_image(self.mean), _image(self.fast), _image(self.square), self.count.download()[0], reasons)


def _image(plane: Plane) -> NDArray[np.float32]:
    """Return [rows, columns] of one image, [rows, columns, channels] of several."""
    images = plane.download()
    return images[0] if len(images) == 1 else np.ascontiguousarray(np.moveaxis(images, 0, -1))
