"""Images beside or inside a scene file: finding them safely, decoding them, telling them apart."""

from __future__ import annotations

import base64
import hashlib
import io
import warnings
from pathlib import Path, PurePosixPath, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Wrap

UTF8_MARK = b"\xef\xbb\xbf"
"""Byte order mark, which editors put before a text."""

MOST_TEXTURE_PIXELS = 8192 * 8192
"""Pixels of the largest texture; a file of a few kilobytes can claim far more."""

MOST_PIXELS_IN_ALL = 4 * MOST_TEXTURE_PIXELS
"""Pixels of all textures of a scene together, 4 bytes each."""

# Without EPS and others that start foreign programs or describe several pages.
_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "GIF", "TIFF")


def lets_through(alpha: float, texture: NDArray[np.uint8] | None) -> bool:
    """Return whether anything of a surface of that opacity and texture [..., 4] is seen through."""
    return alpha < 1.0 or (texture is not None and bool(texture[..., 3].min() < 255))


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
        raise SceneError(f"{what} is {shown(name)}: expected a path relative to the scene file")
    path = (folder / name).resolve()
    if not path.is_relative_to(within.resolve()):
        raise SceneError(f"{what} is {shown(name)}: it leaves the folder of the scene file, {within}")
    if not is_file(path):
        raise SceneError(f"{what} is {shown(name)}: no such file in {folder}")
    return path.read_bytes()


def found_beside(folder: Path, name: str, *, within: Path | None = None) -> Path | None:
    """Return the file that a scene names, as far as it can be found; None if not.

    A backslash is a slash, and case does not matter where no file is written alike. A path that is
    absolute, that leaves `within` or that leads nowhere stands for a file of its base name in the
    folder, or in `within`.

    Args:
        folder, name, within: as in `read_beside`.
    """
    within = folder if within is None else within
    parts = [part for part in name.strip().replace("\\", "/").split("/") if part not in ("", ".")]
    if not parts or "\0" in name:
        return None
    places = [(folder, parts), (folder, parts[-1:]), (within, parts[-1:])]
    for start, way in places:
        path: Path | None = start
        for part in way:
            path = None if path is None else path.parent if part == ".." else _entry(path, part)
        if path is not None and path.resolve().is_relative_to(within.resolve()) and is_file(path):
            return path
    return None


def _entry(folder: Path, name: str) -> Path | None:
    """Return the entry of a folder of this name, or of one that differs in case alone."""
    try:
        names = [each.name for each in folder.iterdir()]
    except OSError:
        return None
    same = name if name in names else next((each for each in sorted(names) if each.lower() == name.lower()), None)
    return None if same is None else folder / same


def is_file(path: Path) -> bool:
    """Return whether `path` is a file; False too for what no path can be."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long a name, a null character, half a surrogate pair
        return False


def read_uri(uri: str, folder: Path, what: str) -> bytes:
    """Return what a data URI holds, or the contents of a file in `folder` or below.

    Raises:
        SceneError: as `read_beside`, or the data URI is not one.
    """
    if not uri.startswith("data:"):
        return read_beside(folder, unquote(uri), what)
    head, _, payload = uri.partition(",")
    try:
        return base64.b64decode(payload) if head.endswith(";base64") else unquote_to_bytes(payload)
    except ValueError as error:
        raise SceneError(f"{what} is {shown(uri)}: no base64 ({error})") from None


def decode_image(data: bytes, what: str, *, most: int = MOST_TEXTURE_PIXELS) -> NDArray[np.uint8]:
    """Return the image in `data` as [rows, columns, 4] uint8 RGBA, row 0 on top.

    Raises:
        SceneError: it is damaged, of another format or of more than `most` pixels.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of damage that it gets over
            # Pillow only warns of an image that unpacks to hundreds of megabytes.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                return rgba_of(image, what, most=most)
    except SceneError:
        raise
    except UnidentifiedImageError:
        raise SceneError(f"{what} is not an image of the kinds {', '.join(_FORMATS)}") from None
    except Exception as error:
        reason = str(error)[:200]
        raise SceneError(f"{what} can't be read as an image: {reason}") from error


def rgba_of(image: Image.Image, what: str, *, most: int = MOST_TEXTURE_PIXELS) -> NDArray[np.uint8]:
    """Return a Pillow image as [rows, columns, 4] uint8; 16-bit grey keeps its upper 8 bits.

    Raises:
        SceneError: it has more than `most` pixels; it is not decoded then.
    """
    columns, rows = image.size
    if columns * rows > most:
        raise SceneError(f"{what} has {columns} x {rows} pixels: expected at most {most}")
    if image.mode.startswith("I"):
        grey = (np.asarray(image).astype(np.int64) >> 8).clip(0, 255).astype(np.uint8)
        image = Image.fromarray(grey)
    return np.array(image.convert("RGBA"), dtype=np.uint8)


class TextureSet:
    """Textures in the order in which they were added, each only once.

    Args:
        drawn: whether there are any; if not, materials have their factors alone.

    Attributes:
        wraps: of each texture, see `Scene`.
        notes: what was not found or not drawn, in words.
    """

    def __init__(self, *, drawn: bool = True) -> None:
        self.textures: list[NDArray[np.uint8]] = []
        self.wraps: list[Wrap] = []
        self.drawn = drawn
        self.notes: list[str] = []
        self._index: dict[tuple[tuple[int, ...], bytes, Wrap], int] = {}
        self._left = MOST_PIXELS_IN_ALL

    def note(self, text: str) -> None:
        """Keep a note, once."""
        if text not in self.notes:
            self.notes.append(text)

    def read(self, folder: Path, name: str, what: str, *, within: Path | None = None) -> NDArray[np.uint8] | None:
        """Return the image of a file that a scene names, see `found_beside`; None, and a note, if there is none.

        Raises:
            SceneError: as `decode`.
        """
        if not self.drawn:
            return None
        path = found_beside(folder, name, within=within)
        if path is None:
            self.note(f"{what} is {shown(name)}, which is not found: its material is drawn without")
            return None
        return self.decode(path.read_bytes(), f"{what} ({shown(name)})")

    def decode(self, data: bytes, what: str) -> NDArray[np.uint8]:
        """Return the image in `data`, as `decode_image`, which may be added then.

        Raises:
            SceneError: as `decode_image`, or all images together are larger than a scene's may be;
                the message says how to do without.
        """
        try:
            texture = decode_image(data, what, most=min(self._left, MOST_TEXTURE_PIXELS))
        except SceneError as error:
            raise SceneError(
                f"{error}; load_scene(..., textures=False) or --no-textures draws the scene without"
            ) from None
        self._left -= texture.shape[0] * texture.shape[1]
        return texture

    def add(self, texture: NDArray[np.uint8], wrap: Wrap = ("repeat", "repeat")) -> int:
        """Return the index of `texture` [rows, columns, 4] uint8; equal pixels that wrap alike share one."""
        key = (texture.shape, hashlib.sha256(np.ascontiguousarray(texture).data).digest(), wrap)
        if key not in self._index:
            self._index[key] = len(self.textures)
            self.textures.append(texture)
            self.wraps.append(wrap)
        return self._index[key]
