"""Images beside or inside a scene file: finding them safely, decoding them, telling them apart."""

from __future__ import annotations

import hashlib
import io
import warnings
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from ssgi_cl.errors import SceneError

MOST_TEXTURE_PIXELS = 8192 * 8192
"""Pixels of the largest texture; a file of a few kilobytes can claim far more."""

# Without EPS and others that start foreign programs or describe several pages.
_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "GIF", "TIFF")


def srgb_to_linear(encoded: ArrayLike) -> NDArray[np.float64]:
    """Return the linear value of sRGB-encoded numbers in [0, 1] (IEC 61966-2-1)."""
    value = np.asarray(encoded, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.abs(value) + 0.055) / 1.055) ** 2.4)


def mean_color(texture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return [3] float64: the mean linear colour of an sRGB-encoded texture."""
    linear = srgb_to_linear(np.arange(256) / 255.0)
    counts = [np.bincount(texture[..., channel].ravel(), minlength=256) for channel in range(3)]
    return np.array([linear @ count / count.sum() for count in counts])


def read_beside(folder: Path, name: str, what: str, *, within: Path | None = None) -> bytes:
    """Return the bytes of the file `name`, relative to `folder`.

    Args:
        folder: of the file that refers to it.
        name: as it refers to it.
        what: for messages.
        within: the folder that the path must not leave; `folder` by default.

    Raises:
        SceneError: the path is absolute or leaves the folder, or there is no such file.
    """
    within = folder if within is None else within
    name = name.strip().replace("\\", "/")
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive or "://" in name
    if absolute or not name or "\0" in name:
        raise SceneError(f"{what} is {name!r}: expected a path relative to the scene file")
    path = (folder / name).resolve()
    if not path.is_relative_to(within.resolve()):
        raise SceneError(f"{what} is {name!r}: it leaves the folder of the scene file, {within}")
    if not path.is_file():
        raise SceneError(f"{what} is {name!r}: no such file in {folder}")
    return path.read_bytes()


def decode_image(data: bytes, what: str) -> NDArray[np.uint8]:
    """Return the image in `data` as [rows, columns, 4] uint8 RGBA, row 0 on top.

    Raises:
        SceneError: it is damaged, of another format or larger than MOST_TEXTURE_PIXELS.
    """
    try:
        with warnings.catch_warnings():
            # Pillow only warns of an image that unpacks to hundreds of megabytes.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                return rgba_of(image, what)
    except SceneError:
        raise
    except Exception as error:
        raise SceneError(f"{what} can't be read as an image: {error}") from error


def rgba_of(image: Image.Image, what: str) -> NDArray[np.uint8]:
    """Return a Pillow image as [rows, columns, 4] uint8; 16-bit grey keeps its upper 8 bits."""
    columns, rows = image.size
    if columns * rows > MOST_TEXTURE_PIXELS:
        raise SceneError(
            f"{what} has {columns} x {rows} pixels: expected at most {MOST_TEXTURE_PIXELS}"
        )
    if image.mode.startswith("I"):
        grey = (np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8)
        image = Image.fromarray(grey)
    return np.array(image.convert("RGBA"), dtype=np.uint8)


class TextureSet:
    """Textures in the order in which they were added, each only once."""

    def __init__(self) -> None:
        self.textures: list[NDArray[np.uint8]] = []
        self._index: dict[tuple[tuple[int, ...], bytes], int] = {}

    def add(self, texture: NDArray[np.uint8]) -> int:
        """Return the index of `texture` [rows, columns, 4] uint8; equal pixels share one."""
        key = (texture.shape, hashlib.sha256(texture.tobytes()).digest())
        if key not in self._index:
            self._index[key] = len(self.textures)
            self.textures.append(texture)
        return self._index[key]
