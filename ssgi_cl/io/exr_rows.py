"""OpenEXR files by bands of rows: images that are larger than memory."""

from __future__ import annotations

import os
import struct
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import IO, Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from ssgi_cl.core import atomic
from ssgi_cl.io.exr_header import ExrHeader, data_window_place, header_end

CHUNK = 16
"""Rows that ZIP compresses together."""


def read_rows(
    name: str, headers: Sequence[ExrHeader], channels: Mapping[str, str], rows: tuple[int, int]
) -> dict[str, NDArray[np.float32]]:
    """Return rows of some channels, [rows, columns] float32 each.

    Args:
        name: a file of one part, of scan lines or tiles.
        headers: its headers.
        channels: their names in the file, and in what is returned.
        rows: the first row of the data window, and the one behind the last.

    Raises:
        ValueError: the file has several parts, or is damaged.
    """
    if len(headers) > 1:
        raise ValueError(f"{name} has {len(headers)} parts: expected a file with one to read it by rows")
    (first, end), columns, top = rows, headers[0].size[1], headers[0].data[1]
    floats = SimpleNamespace(v=2)  # what the library takes for the type FLOAT of the package Imath
    arrays = {}
    try:
        with utf8(name, os.O_RDONLY) as readable:
            file = OpenEXR.InputFile(readable)
            try:
                for key, whole in channels.items():
                    pixels = file.channel(key, floats, top + first, top + end - 1)
                    arrays[whole] = np.frombuffer(pixels, np.float32).reshape(end - first, columns)
            finally:
                file.close()
    except (RuntimeError, OSError, ValueError, TypeError) as error:
        raise ValueError(f"{name} is damaged or cut short: rows {first} to {end - 1} can't be decoded") from error
    return arrays


def write_rows(
    path: str | os.PathLike[str],
    header: Mapping[str, Any],
    size: tuple[int, int],
    bands: Iterable[tuple[int, Mapping[str, NDArray[np.float32]]]],
) -> None:
    """Write a file of scan lines (ZIP), whole or not at all.

    The library writes each band to a file of its own, whose chunks are then those of the file: the format puts
    chunks of rows one after the other, behind a table of their places.

    Args:
        path: the file; one that exists is replaced.
        header: attributes, "dataWindow" among them.
        size: (rows, columns) of the data window.
        bands: first row and channels of each, from the top; bands but the last are multiples of `CHUNK` rows high.

    Raises:
        ValueError: a band that does not follow the one before, or rows that are missing at the end.
        OSError: the file can't be written.
    """
    rows, columns = size
    (left, top), _ = (np.asarray(corner).tolist() for corner in header["dataWindow"])
    places: list[int] = []
    expected = 0
    with atomic.replacement(path) as temporary, open(temporary, "wb") as whole:
        for first, channels in bands:
            height, width = next(iter(channels.values())).shape
            if first != expected or width != columns or first % CHUNK:
                raise ValueError(f"a band has row {first} and {width} columns: expected {expected} and {columns}")
            expected = first + height
            window = (left, top + first), (left + columns - 1, top + expected - 1)
            own = {**header, "dataWindow": tuple(np.array(corner, np.int32) for corner in window)}
            with tempfile.TemporaryFile() as part:
                _write(part, own, channels, os.fspath(path))
                if first == 0:
                    _begin(part, whole, (left, top, left + columns - 1, top + rows - 1), -(-rows // CHUNK))
                places += _append(part, whole, -(-height // CHUNK))
        if expected != rows:
            raise ValueError(f"the last band ends at row {expected}: expected {rows}")
        whole.seek(places[0] - 8 * len(places))
        whole.write(struct.pack(f"<{len(places)}Q", *places))


def _write(part: IO[bytes], header: dict[str, Any], channels: Mapping[str, Any], path: str) -> None:
    """Write a file to one that is open and has no name."""
    own = {**header, "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        OpenEXR.File(own, dict(channels)).write(f"/dev/fd/{part.fileno()}")
    except RuntimeError as error:
        raise OSError(f"cannot write {path}: {error}") from error


def _begin(part: IO[bytes], whole: IO[bytes], window: tuple[int, ...], chunks: int) -> None:
    """Write the header of a band, with the data window of the whole, and room for the places of its chunks."""
    part.seek(0)
    head = bytearray(part.read(header_end(part)))
    place = data_window_place(head)
    head[place : place + 16] = struct.pack("<4i", *window)
    whole.write(head)
    whole.write(bytes(8 * chunks))


def _append(part: IO[bytes], whole: IO[bytes], chunks: int) -> list[int]:
    """Copy the chunks of a band; return their places."""
    part.seek(header_end(part))
    own = struct.unpack(f"<{chunks}Q", part.read(8 * chunks))
    part.seek(own[0])
    start = whole.tell()
    while block := part.read(1 << 24):
        whole.write(block)
    return [start + place - own[0] for place in own]


@contextmanager
def utf8(name: str, flags: int) -> Iterator[str]:
    """Give another name of a file if its own is not UTF-8, which OpenEXR does not take."""
    try:
        name.encode()
    except UnicodeEncodeError:
        opened = os.open(name, flags)
        try:
            yield f"/dev/fd/{opened}"
        finally:
            os.close(opened)
    else:
        yield name
