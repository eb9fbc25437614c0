"""The header of an OpenEXR file, read and held against the file's length before it is decoded.

A damaged or malicious header can claim any size, and the decoder allocates what it claims.
Layout: "OpenEXR File Layout" (openexr.com).
"""

from __future__ import annotations

import math
import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ssgi_cl.core.errors import shown

Window = tuple[int, int, int, int]
"""First column, first row, last column, last row."""

_MAGIC = b"\x76\x2f\x31\x01"
_DEEP, _PARTS = 0x800, 0x1000
_LONGEST_NAME = 255
_MOST_PARTS = 1000
_LARGEST_SIDE = 1 << 24
_FREE_BYTES = 256 << 20
_MOST_RATIO = 2000
_PIXEL_BYTES = {0: 4, 1: 2, 2: 4}  # unsigned, half, float
# By the number of the compression: its name, and the lines of a chunk.
_COMPRESSIONS = (
    ("none", 1), ("RLE", 1), ("ZIPS", 1), ("ZIP", 16), ("PIZ", 32), ("PXR24", 16), ("B44", 32), ("B44A", 32),
    ("DWAA", 32), ("DWAB", 256), ("HTJ2K256", 256), ("HTJ2K32", 32),
)  # fmt: skip


@dataclass(frozen=True)
class Channel:
    """A channel: its name, bytes a value, and sampling rates (columns, rows)."""

    name: str
    bytes: int
    sampling: tuple[int, int]


@dataclass(frozen=True)
class ExrHeader:
    """The header of a part of flat pixels.

    Attributes:
        name: of the part; "" in a file of one part.
        view: such as "left", of a stereo image; "" without.
        data, display: the windows of the pixels in the file and of the image.
        channels: all of them.
        compression: its name.
        pixel_aspect: width of a pixel in the picture over its height.
    """

    name: str
    view: str
    data: Window
    display: Window
    channels: tuple[Channel, ...]
    compression: str
    pixel_aspect: float

    @property
    def names(self) -> dict[str, str]:
        """Name of each channel in the file by the name that it has in this part.

        Files of several parts name layers by parts: "Z" in the part "depth" is "depth.Z".
        """
        found = {}
        for channel in self.channels:
            whole = channel.name
            if self.name and "." not in whole and self.name.lower() not in ("rgba", "rgb", "beauty", "main"):
                whole = f"{self.name}.{whole}"
            if self.view and not whole.startswith(f"{self.view}."):
                whole = f"{self.view}.{whole}"
            found[channel.name] = whole
        return found

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns) of the data window."""
        left, top, right, bottom = self.data
        return bottom - top + 1, right - left + 1


def read_header(path: Path) -> ExrHeader:
    """Return the header of a file of one part.

    Raises:
        FileNotFoundError, OSError, ValueError: as `read_headers`, or the file has several parts.
    """
    first, *others = read_headers(path)
    if others:
        raise ValueError(f"{path} has {1 + len(others)} parts: expected a file with one")
    return first


def read_headers(path: Path) -> tuple[ExrHeader, ...]:
    """Return the headers of all parts of a file that is long enough for what they claim.

    Raises:
        FileNotFoundError, OSError: there is no such file, or it can't be read.
        ValueError: not an OpenEXR file, damaged, cut short, deep, of an unknown compression, or it
            claims far more pixels than can be packed into its length.
    """
    with open(path, "rb") as file:  # says precisely why a file can't be opened
        if file.read(4) != _MAGIC:
            raise ValueError(f"{path} is not an OpenEXR file")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as head:  # manifests take megabytes
            try:
                return _parsed(head, len(head), path)
            except (struct.error, IndexError, KeyError) as error:
                raise ValueError(f"{path} is damaged or cut short: its header can't be read") from error


def read_attributes(path: Path) -> dict[str, bytes]:
    """Return the attributes of a file's first part as they are stored; all as `read_headers`."""
    with open(path, "rb") as file:
        if file.read(4) != _MAGIC:
            raise ValueError(f"{path} is not an OpenEXR file")
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as head:
            try:
                return _attributes(head, 8, path)[0]
            except (struct.error, IndexError) as error:
                raise ValueError(f"{path} is damaged or cut short: its header can't be read") from error


def header_end(file: IO[bytes]) -> int:
    """Return where the attributes of an open file of one part end."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as head:
        return _attributes(head, 8, Path("file"))[1]


def data_window_place(head: bytes | bytearray) -> int:
    """Return where the value of the data window stands in a header, 4 integers of 4 bytes."""
    name = b"dataWindow\0box2i\0"
    return head.index(name) + len(name) + 4


def _parsed(head: mmap.mmap, length: int, path: Path) -> tuple[ExrHeader, ...]:
    (version,) = struct.unpack_from("<I", head, 4)
    attributes, place = _attributes(head, 8, path)
    parts = [attributes]
    if version & _PARTS:
        while head[place]:
            attributes, place = _attributes(head, place, path)
            parts.append(attributes)
            if len(parts) > _MOST_PARTS:
                raise ValueError(f"{path} is damaged: it has more than {_MOST_PARTS} parts")
    return tuple(_header(each, bool(version & _DEEP), length - place, path, several=len(parts) > 1) for each in parts)


def _header(attributes: dict[str, bytes], deep: bool, left: int, path: Path, *, several: bool) -> ExrHeader:
    """Return the header of a part, whose data lies in `left` bytes."""
    kind = attributes.get("type", b"").rstrip(b"\0").decode("ascii", "replace")
    if (deep and not several) or kind not in ("", "scanlineimage", "tiledimage"):
        raise ValueError(f"{path} holds {shown(kind or 'deep pixels')}: expected flat pixels")
    compression = attributes["compression"][0]
    if compression >= len(_COMPRESSIONS):
        raise ValueError(
            f"{path} has the compression number {compression}: expected one of "
            f"{', '.join(name for name, _ in _COMPRESSIONS)} (0 to {len(_COMPRESSIONS) - 1})"
        )
    name, view = (attributes.get(key, b"").decode("utf-8", "replace") for key in ("name", "view"))
    header = ExrHeader(
        name=name if several else "",
        view=view if several else "",
        data=_window(attributes["dataWindow"], path),
        display=_window(attributes["displayWindow"], path),
        channels=_channels(attributes["channels"], path),
        compression=_COMPRESSIONS[compression][0],
        pixel_aspect=_aspect(attributes.get("pixelAspectRatio"), path),
    )
    tiled = "tiles" in attributes and kind != "scanlineimage"
    tile = struct.unpack_from("<2I", attributes["tiles"]) if tiled else None
    _check_size(header, tile, _COMPRESSIONS[compression][1], left, path)
    return header


def _attributes(head: mmap.mmap, place: int, path: Path) -> tuple[dict[str, bytes], int]:
    """Return the attributes that begin at `place`, and where they end."""
    found = {}
    while head[place]:
        name, place = _name(head, place, path)
        _, place = _name(head, place, path)
        (size,) = struct.unpack_from("<i", head, place)
        place += 4
        if not 0 <= size <= len(head) - place:
            raise ValueError(f"{path} is damaged or cut short: {shown(name)} in its header has {size} bytes")
        found[name] = head[place : place + size]
        place += size
    return found, place + 1


def _name(head: mmap.mmap | bytes, place: int, path: Path) -> tuple[str, int]:
    end = head.find(b"\0", place, place + _LONGEST_NAME + 1)
    if end < 0:
        raise ValueError(f"{path} is damaged or cut short: a name in its header has no end")
    return head[place:end].decode("utf-8", "replace"), end + 1


def _window(value: bytes, path: Path) -> Window:
    left, top, right, bottom = struct.unpack("<4i", value)
    if not (0 <= right - left < _LARGEST_SIDE and 0 <= bottom - top < _LARGEST_SIDE):
        raise ValueError(
            f"{path} is damaged: its window runs from column {left} to {right}, from row {top} to {bottom}"
        )
    return left, top, right, bottom


def _aspect(value: bytes | None, path: Path) -> float:
    """Return the pixel aspect ratio of a header; 1 without."""
    (aspect,) = (1.0,) if value is None else struct.unpack("<f", value)
    if not 1e-3 <= aspect <= 1e3:
        raise ValueError(f"{path} has the pixel aspect ratio {aspect:g}: expected a number from .001 to 1000")
    return float(aspect)


def _channels(value: bytes, path: Path) -> tuple[Channel, ...]:
    channels, place = [], 0
    while value[place]:
        name, place = _name(value, place, path)
        kind, _, across, down = struct.unpack_from("<iIii", value, place)
        place += 16
        if across < 1 or down < 1:
            raise ValueError(f"{path} is damaged: channel {shown(name)} is sampled {across} x {down}")
        channels.append(Channel(name, _PIXEL_BYTES[kind], (across, down)))
    return tuple(channels)


def _check_size(header: ExrHeader, tile: tuple[int, ...] | None, lines: int, left: int, path: Path) -> None:
    """Raise unless `left` bytes of data, in chunks of `lines`, may hold the claimed pixels."""
    rows, columns = header.size
    pixel = sum(channel.bytes for channel in header.channels)
    most = _FREE_BYTES + _MOST_RATIO * left
    if tile is None:
        chunks = math.ceil(rows / lines)
    else:
        if not 0 < tile[0] * tile[1] * pixel <= most:
            raise ValueError(f"{path} is damaged: its tiles have {tile[0]} x {tile[1]} pixels")
        chunks = math.ceil(columns / tile[0]) * math.ceil(rows / tile[1])
    # Each chunk has a place of 8 bytes in a table, its number and its size.
    if 16 * chunks > left or columns * rows * pixel > most:
        raise ValueError(
            f"{path} is damaged or cut short: {columns} x {rows} pixels of "
            f"{len(header.channels)} channels can't lie in {left} bytes"
        )
