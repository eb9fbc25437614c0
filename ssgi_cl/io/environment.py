"""Environments from image files."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import AssumedWarning
from ssgi_cl.core.lights import MOST_RADIANCE, Environment
from ssgi_cl.io import exr, radiance_hdr
from ssgi_cl.io.exr_header import read_header

Image = NDArray[np.float32]

_LARGEST_SIDE = 131072
"""Texels."""

LARGEST_HALF = 65504.0
"""Of half floats, which most environments are stored in: what overflowed was more."""

RINGING = 1e-3
"""How far below 0 a filter may put texels, as a share of the brightest."""


def read_environment(path: str | os.PathLike[str]) -> Environment:
    """Read a latitude-longitude image: .exr with channels R, G, B or Y, or Radiance's .hdr.

    Args:
        path: the file; its texels are radiance in W m^-2 sr^-1, laid out as `Environment.radiance`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: of another kind, damaged or cut short; a texel is NaN, negative by more than a
            filter's ringing, or above 1e38; a side has more than 131072 texels; the message names the
            file. A texel of half floats that overflowed counts as 65504, or the largest there is, one
            that is a little below 0 as 0; both are warned of (`AssumedWarning`).
        OSError: the file cannot be read.
    """
    file = Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise ValueError(f"the environment {file} ends in {file.suffix!r}: expected {', '.join(_READERS)}")
    if not file.exists():
        raise FileNotFoundError(f"the environment {file}: there is no such file")
    image = reader(file)
    rows, columns = image.shape[:2]
    if max(rows, columns) > _LARGEST_SIDE or rows * columns > radiance_hdr.MOST_TEXELS:
        raise ValueError(
            f"the environment {file} has {rows} x {columns} texels: expected at most "
            f"{_LARGEST_SIDE} along a side and {radiance_hdr.MOST_TEXELS} in all"
        )
    image = _clamped(file, image)
    _check_texels(file, image)
    return Environment(image)


def _clamped(file: Path, image: Image) -> Image:
    """Return an image whose overflows and ringing are taken out, and warn of them."""
    with np.errstate(invalid="ignore"):
        finite = np.isfinite(image)
        brightest = float(image[finite].max()) if finite.any() else 0.0
        most = max(brightest, LARGEST_HALF)
        over, below = np.isposinf(image), (image < 0.0) & (image >= -RINGING * brightest)
        usable = finite.any() and most <= MOST_RADIANCE
    if not usable or not (over | below).any():
        return image
    parts = []
    for wrong, text in ((over, f"infinite, and taken for {most:g}"), (below, "a little below 0, and taken for 0")):
        if wrong.any():
            row, column, _ = (int(i) for i in np.argwhere(wrong)[0])
            parts.append(f"{int(wrong.any(axis=-1).sum())} texel(s), first in row {row}, column {column}, {text}")
    text = f"the environment {file} has {' and '.join(parts)} (W m^-2 sr^-1)"
    warnings.warn(text, AssumedWarning, stacklevel=4)
    return np.where(over, np.float32(most), np.where(below, np.float32(0.0), image))


def _check_texels(file: Path, image: Image) -> None:
    """Raise ValueError with the place and the number of texels that are no radiance."""
    with np.errstate(invalid="ignore"):
        usable = (image >= 0.0) & (image <= MOST_RADIANCE)  # false for NaN
    if usable.all():
        return
    wrong = ~usable.all(axis=-1)
    row, column = (int(i) for i in np.argwhere(wrong)[0])
    raise ValueError(
        f"the environment {file} has the radiance {image[row, column].tolist()} in row {row}, "
        f"column {column} ({int(wrong.sum())} such texels in all): expected numbers >= 0 and <= "
        f"{MOST_RADIANCE:g} (W m^-2 sr^-1)"
    )


def _read_exr(file: Path) -> Image:
    header = read_header(file)
    if header.data != header.display:
        raise ValueError(
            f"the environment {file} has the data window {header.data} and the display window "
            f"{header.display}: expected the same window, an image of the whole sphere"
        )
    present = exr.read(file)
    names = ("R", "G", "B") if "R" in present else ("Y", "Y", "Y")
    missing = [name for name in names if name not in present]
    if missing:
        raise ValueError(
            f"the environment {file} has no channel {missing[0]!r}: expected R, G, B or Y; it has "
            f"{', '.join(sorted(present))}"
        )
    return np.stack([present[name].astype(np.float32, copy=False) for name in names], axis=-1)


_READERS: dict[str, Callable[[Path], Image]] = {".exr": _read_exr, ".hdr": radiance_hdr.read, ".pic": radiance_hdr.read}
