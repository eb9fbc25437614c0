"""Functions that the tests of sequences map over frames; in a module of their own, which workers import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.io import exr


def doubled(path: Path, *, factor: float = 2.0) -> dict[str, NDArray[np.float32]]:
    """Return the depth of a file times a factor."""
    return {"depth": exr.read(path)["Z"] * np.float32(factor)}


def slowly(path: Path, *, seconds: float) -> dict[str, NDArray[np.float32]]:
    """Return the same after a while."""
    time.sleep(seconds)
    return doubled(path)


def once_deadly(path: Path, *, marks: str) -> dict[str, NDArray[np.float32]]:
    """Kill the process with the second frame, the first time."""
    mark = Path(marks) / Path(path).name
    if path.name.endswith("2.exr") and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return doubled(path)


class Halved:
    """A function that reads ahead."""

    def read(self, path: Path) -> NDArray[Any]:
        return exr.read(path)["Z"]

    def __call__(self, depth: NDArray[Any]) -> dict[str, NDArray[Any]]:
        return {"depth": depth / 2}


def picture(path: Path) -> NDArray[np.uint8]:
    """Return a grey image."""
    return np.full((4, 5, 3), int(exr.read(path)["Z"][0, 0]), np.uint8)


def noise(number: int, *, kind: str) -> Any:
    """Return random numbers that no file makes smaller: of 48 KiB, or of that many KiB where it is above 9."""
    size = 1024 * (48 if number < 10 else 10 * number)
    values = np.random.default_rng(number).integers(0, 256, size, np.uint8)
    if kind == "png":
        return values.reshape(-1, 64)
    # Bits of float32 from 1 to 2, but for their exponents.
    return {"depth": (values.view(np.uint32) & 0x7FFFFF | 0x3F800000).view(np.float32).reshape(-1, 64)}
