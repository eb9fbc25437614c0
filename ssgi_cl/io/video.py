"""Pictures in a row as an .mp4 file, by ffmpeg."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from importlib import import_module
from itertools import chain
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core import checks
from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import MissingExtraError

SUFFIX = ".mp4"
QUALITY = "16"
"""Constant rate factor of H.264: below it differences are not seen."""


def encoder() -> str:
    """Return the program ffmpeg. MissingExtraError: it is not installed."""
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError) as error:
        raise MissingExtraError(
            f"videos need ffmpeg, which is not installed ({error}): pip install 'ssgi-cl[video]'"
        ) from error


def write(path: str | os.PathLike[str], pictures: Iterable[Path], fps: float) -> int:
    """Write pictures as a video, H.264 in 4:2:0; whole or not at all. Return how many there are.

    A picture of an odd width or height gets a column or row more, a copy of its last.

    Args:
        path: the file, .mp4.
        pictures: files of 8 bits a channel that have one size, in order; at least one.
        fps: frames a second, > 0.

    Raises:
        ValueError: the name does not end in .mp4, there is no picture, or one has another size than the first.
        MissingExtraError: ffmpeg is not installed.
        OSError: a file can't be read or written.
    """
    fps = checks.number("fps", fps, low=0.0, high=1e3, above=True, unit="frames a second")
    if Path(path).suffix.lower() != SUFFIX:
        raise ValueError(f"path is {os.fspath(path)!r}: expected a name that ends in {SUFFIX}")
    frames = _frames(pictures)
    first = next(frames, None)
    if first is None:
        raise ValueError("pictures is empty: expected at least one")
    rows, columns = first.shape[:2]
    program = encoder()
    form = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}", "-r", repr(fps), "-i", "-")
    coded = ("-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", QUALITY, "-f", "mp4")
    with replacement(path) as temporary, TemporaryFile() as said:
        line = [program, "-y", "-loglevel", "error", *form, *coded, os.fspath(temporary)]
        with Popen(line, stdin=PIPE, stdout=DEVNULL, stderr=said) as process:
            assert process.stdin is not None  # noqa: S101  it is a pipe
            count = 0
            try:
                for picture in chain([first], frames):
                    if picture.shape != first.shape:
                        raise ValueError(
                            f"picture {count + 1} has another size than the first: expected {columns} x {rows} pixels"
                        )
                    process.stdin.write(picture.tobytes())
                    count += 1
            except BrokenPipeError:
                pass  # it ended, and says why
            except BaseException:
                process.kill()
                raise
        if process.returncode:
            said.seek(0)
            why = said.read().decode(errors="replace").strip().splitlines()[-1:]
            raise OSError(f"ffmpeg failed to write {os.fspath(path)}: {why[0] if why else process.returncode}")
    return count


def _frames(pictures: Iterable[Path]) -> Iterator[NDArray[np.uint8]]:
    """Give the pixels of pictures, [rows, columns, 3], of even numbers of rows and columns."""
    for path in pictures:
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
        yield np.ascontiguousarray(np.pad(pixels, ((0, pixels.shape[0] % 2), (0, pixels.shape[1] % 2), (0, 0)), "edge"))
