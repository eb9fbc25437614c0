"""Pictures as the bytes of files, for a download; nothing is written on the machine that draws."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from ssgi_cl.io import exr
from ssgi_cl.viewer.outputs import Drawn

NAMES = {"light": "image", "share": "ao", "depth": "depth", "normal": "normal", "albedo": "albedo"}
"""Of arrays in EXR files, by the kind of what was drawn."""


def png_bytes(picture: np.ndarray) -> bytes:
    """Return a picture [rows, columns, 3] uint8 as a PNG file."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, format="PNG", compress_level=1)
    return file.getvalue()


def exr_bytes(drawn: Drawn) -> bytes:
    """Return the numbers behind a picture as an OpenEXR file.

    Raises:
        ValueError: there are none yet, as while something moves.
    """
    if drawn.values is None:
        raise ValueError("there is only a moving picture so far: expected a still one")
    with tempfile.TemporaryDirectory(prefix="ssgi-") as folder:  # OpenEXR writes to files alone
        path = Path(folder) / "picture.exr"
        exr.write(path, {NAMES[drawn.kind]: drawn.values})
        return path.read_bytes()
