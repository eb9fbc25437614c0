"""Radiance picture files (.hdr, .pic): RGBE texels, flat or run-length encoded.

Format: G. Ward, "Real Pixels", Graphics Gems II (1991), and "Radiance File Formats", which also
gives the two run-length encodings. A header can claim any size, so it is compared with the file's
length before memory is allocated.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import shown

Bytes = NDArray[np.uint8]

_SIGNATURES = (b"#?RADIANCE", b"#?RGBE")
_SIZE = re.compile(r"([-+])([XY]) +(\d{1,9}) +([-+])([XY]) +(\d{1,9})")
MOST_TEXELS = 1 << 27
"""Of a picture: 2 GB while it is read."""

_MOST_HEADER = 1 << 16  # bytes
_LEAST_RUN_LENGTH, _MOST_RUN_LENGTH = 8, 32767  # texels of a line that runs per channel may have
_BIAS = 128 + 8  # of the exponent, with the mantissa's 8 bits


def read(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Return the radiance of a Radiance picture.

    A channel is mantissa * 2^(exponent - 136), and 0 where the exponent is 0, as in most readers.
    What lines EXPOSURE= in the header multiplied by is divided out again.

    Args:
        path: a file of RGBE texels with lines in any of the eight directions.

    Returns:
        [rows, columns, 3] float32 RGB, W m^-2 sr^-1, row 0 on top.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: no Radiance picture, XYZE texels, damaged, cut short, or too large.
        OSError: the file cannot be read.
    """
    name = os.fspath(path)
    data = Path(path).read_bytes()
    exposure, found, start = _header(name, data)
    lines, length = int(found[3]), int(found[6])
    if lines * length > MOST_TEXELS:
        raise ValueError(f"{name} has {lines} lines of {length} texels: expected at most {MOST_TEXELS} in all")
    if lines * length == 0 or lines * _least_bytes(length) > len(data) - start:
        raise ValueError(
            f"{name} is damaged or cut short: {lines} lines of {length} texels do not fit into "
            f"{len(data) - start} bytes"
        )
    texels = np.empty((lines, length, 4), np.uint8)
    for line in range(lines):
        try:
            texels[line], start = _line(data, start, length)
        except (IndexError, ValueError) as error:
            raise ValueError(f"{name} is damaged or cut short in line {line} of {lines}") from error
    with np.errstate(over="ignore"):  # the caller's limits apply
        scale = np.ldexp(1.0 / exposure, texels[..., 3].astype(np.int32) - _BIAS)
        scale[texels[..., 3] == 0] = 0.0
        radiance = (texels[..., :3] * scale[..., None]).astype(np.float32)
    return np.ascontiguousarray(_upright(radiance, found))


def _header(name: str, data: bytes) -> tuple[float, re.Match[str], int]:
    """Return the exposure, the matched line of sizes, and where the texels start."""
    if not data.startswith(_SIGNATURES):
        raise ValueError(f"{name} is no Radiance picture: expected '#?RADIANCE' at its start")
    end = data.find(b"\n\n", 0, _MOST_HEADER)
    after = data.find(b"\n", end + 2, end + 2 + 80)
    if end < 0 or after < 0:
        raise ValueError(f"{name} is damaged or cut short: its header does not end")
    exposure = 1.0
    for line in data[:end].decode("latin-1").splitlines():
        key, _, value = line.partition("=")
        if key == "FORMAT" and value.strip() != "32-bit_rle_rgbe":
            raise ValueError(f"{name} has FORMAT={shown(value)}: expected 32-bit_rle_rgbe")
        if key == "EXPOSURE":
            try:
                exposure *= float(value)
            except ValueError:
                exposure = 0.0
    if not 1e-30 < exposure < 1e30:
        raise ValueError(f"{name} has an EXPOSURE of {exposure:g}: expected 1e-30 to 1e30")
    size = data[end + 2 : after].decode("latin-1")
    found = _SIZE.fullmatch(size.strip())
    if found is None or found[2] == found[5]:
        raise ValueError(f"{name} has the size {shown(size)}: expected such as '-Y 512 +X 1024'")
    return exposure, found, after + 1


def _least_bytes(length: int) -> int:
    """Return the fewest bytes that a line of that many texels can have."""
    if _LEAST_RUN_LENGTH <= length <= _MOST_RUN_LENGTH:
        return min(4 + 4 * 2 * -(-length // 127), 4 * length)
    return 8 if length > 1 else 4  # one texel and its repetitions


def _upright(image: NDArray[np.float32], found: re.Match[str]) -> NDArray[np.float32]:
    """Return an image whose lines run as the header says with rows downward, columns rightward."""
    if found[1] == ("+" if found[2] == "Y" else "-"):
        image = image[::-1]
    if found[4] == ("+" if found[5] == "Y" else "-"):
        image = image[:, ::-1]
    return image if found[2] == "Y" else image.transpose(1, 0, 2)


def _line(data: bytes, start: int, length: int) -> tuple[Bytes, int]:
    """Return the texels [length, 4] of the line at `start`, and where it ends."""
    head = data[start : start + 4]
    if _LEAST_RUN_LENGTH <= length <= _MOST_RUN_LENGTH and head[:2] == b"\x02\x02" and head[2] < 128:
        if head[2] << 8 | head[3] != length:
            raise ValueError("a line of another length")
        return _runs_per_channel(data, start + 4, length)
    return _repeated_texels(data, start, length)


def _runs_per_channel(data: bytes, start: int, length: int) -> tuple[Bytes, int]:
    """Return a line of four channels, each of runs (128 + count, value) and copies (count, ...)."""
    places, counts = [], []
    position = start
    for _ in range(4):
        filled = 0
        while filled < length:
            count = data[position]
            places.append(position)
            counts.append(count)
            if count > 128:
                position += 2
                filled += count - 128
            else:
                position += 1 + count
                filled += count
            if filled > length or count == 0:
                raise ValueError("a run beyond the line's end, or of no texel")
    if position > len(data):
        raise IndexError("the file ends within a run")
    code, place = np.array(counts), np.array(places)
    size = np.where(code > 128, code - 128, code)
    first = np.repeat(np.cumsum(size) - size, size)
    step = np.repeat(code <= 128, size)
    source = np.repeat(place + 1, size) + step * (np.arange(4 * length) - first)
    return np.frombuffer(data, np.uint8)[source].reshape(4, length).T, position


def _repeated_texels(data: bytes, start: int, length: int) -> tuple[Bytes, int]:
    """Return a line of texels, of which (1, 1, 1, n) repeats the one before n times.

    Of such codes in a row, each counts 256 times as much as the one before it.
    """
    count = min(length, (len(data) - start) // 4)
    texels = np.frombuffer(data, np.uint8, 4 * count, start).reshape(-1, 4)
    repeats = (texels[:, :3] == 1).all(axis=1)
    index = np.arange(count)
    own = np.maximum.accumulate(np.where(repeats, -1, index))  # the texel that is repeated
    shift = np.minimum(8 * (index - own - 1), 32)
    size = np.where(repeats, texels[:, 3].astype(np.int64) << np.maximum(shift, 0), 1)
    ends = np.cumsum(size)
    used = int(np.searchsorted(ends, length)) + 1
    if used > count or ends[used - 1] != length or own[0] < 0:
        raise ValueError("texels that do not fill the line")
    return texels[np.repeat(own[:used], size[:used])], start + 4 * used
