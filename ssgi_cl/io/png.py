"""PNG files, written whole or not at all."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from ssgi_cl.core import atomic, checks

COMPRESSION = 1
"""Level of zlib: 9 makes files of pictures a tenth smaller in many times the time."""


def write(
    path: str | os.PathLike[str], image: NDArray[np.uint8 | np.uint16], *, texts: Mapping[str, str] | None = None
) -> None:
    """Write `image` as a PNG file, whole or not at all.

    Args:
        path: the file; one that exists is replaced.
        image: [rows, columns] grey or [rows, columns, 3] RGB, uint8 or uint16, encoded for display, row 0
            on top, at least one pixel.
        texts: by their names, up to 79 letters of Latin-1, to be kept in the file.

    Raises:
        TypeError: `image` is of another dtype.
        ValueError: a wrong shape.
        OSError: the file can't be written; the message names it.
    """
    image = checks.as_array("image", image)
    if image.dtype not in (np.uint8, np.uint16):
        raise TypeError(f"image has dtype {image.dtype}: expected uint8 or uint16")
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or image.size == 0:
        raise ValueError(f"image has shape {image.shape}: expected (rows, columns) or (rows, columns, 3)")
    with atomic.replacement(path) as temporary:
        if image.dtype == np.uint16 and image.ndim == 3:
            temporary.write_bytes(_deep(image, texts or {}))
        else:
            info = PngInfo()
            for name, text in (texts or {}).items():
                info.add_text(name, text)
            picture = Image.fromarray(np.ascontiguousarray(image))
            picture.save(temporary, format="PNG", compress_level=COMPRESSION, pnginfo=info)


def _deep(image: NDArray[np.uint8 | np.uint16], texts: Mapping[str, str]) -> bytes:
    """Return a file of 16 bits a channel, which Pillow does not write (PNG specification, third edition)."""
    rows, columns = image.shape[:2]
    lines = np.ascontiguousarray(image, ">u2").view(np.uint8).reshape(rows, -1)
    lines = np.diff(lines, axis=0, prepend=np.zeros_like(lines[:1]))  # filter 2: less the line above, byte by byte
    filtered = np.concatenate([np.full((rows, 1), 2, np.uint8), lines], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 16, 2, 0, 0, 0)  # RGB
    said = [(b"tEXt", name.encode("latin-1") + b"\0" + text.encode("latin-1")) for name, text in texts.items()]
    chunks = ((b"IHDR", header), *said, (b"IDAT", zlib.compress(filtered.tobytes(), COMPRESSION)), (b"IEND", b""))
    packed = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)
