"""PNG files, written whole or not at all."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core import atomic, checks


def write(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Write `image` as a PNG file, whole or not at all.

    Args:
        path: the file; one that exists is replaced.
        image: [rows, columns] grey or [rows, columns, 3] RGB uint8, encoded for display, row 0 on
            top, at least one pixel.

    Raises:
        TypeError: `image` is not of uint8.
        ValueError: a wrong shape.
        OSError: the file can't be written; the message names it.
    """
    image = checks.as_array("image", image)
    if image.dtype != np.uint8:
        raise TypeError(f"image has dtype {image.dtype}: expected uint8")
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or image.size == 0:
        raise ValueError(f"image has shape {image.shape}: expected (rows, columns) or (rows, columns, 3)")
    picture = Image.fromarray(np.ascontiguousarray(image))
    with atomic.replacement(path) as temporary:
        picture.save(temporary, format="PNG")
