"""PNG files, written whole or not at all."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core import atomic, checks

COMPRESSION = 1
"""Level of zlib: 9 makes files of pictures a tenth smaller in many times the time."""


def write(path: str | os.PathLike[str], image: NDArray[np.uint8 | np.uint16]) -> None:
    """Write `image` as a PNG file, whole or not at all.

    Args:
        path: the file; one that exists is replaced.
        image: [rows, columns] grey, uint8 or uint16, or [rows, columns, 3] RGB uint8, encoded for
            display, row 0 on top, at least one pixel.

    Raises:
        TypeError: `image` is of another dtype.
        ValueError: a wrong shape.
        OSError: the file can't be written; the message names it.
    """
    image = checks.as_array("image", image)
    if image.dtype != np.uint8 and not (image.dtype == np.uint16 and image.ndim == 2):
        raise TypeError(f"image has dtype {image.dtype}: expected uint8, or uint16 of one channel")
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or image.size == 0:
        raise ValueError(f"image has shape {image.shape}: expected (rows, columns) or (rows, columns, 3)")
    picture = Image.fromarray(np.ascontiguousarray(image))
    with atomic.replacement(path) as temporary:
        picture.save(temporary, format="PNG", compress_level=COMPRESSION)
