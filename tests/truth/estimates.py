"""A truth of noise that costs nothing, where and how often its passes are made."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.truth.digests import camera_description
from ssgi_cl.truth.store import Truth, accumulated

SIZE = (7, 9)
PASSES = 5


def view(size: tuple[int, int] = SIZE) -> Camera:
    return Camera.look_at((0, 0, 3), (0, 0, 0), width=size[1], height=size[0])


def description(size: tuple[int, int] = SIZE, **other: Any) -> dict[str, Any]:
    return {"kind": "test", "camera": camera_description(view(size)), "radius": math.inf, **other}


class Estimates:
    """Passes of noise round 0.5, and how often each was made."""

    def __init__(self, size: tuple[int, ...] = SIZE) -> None:
        self.size = size
        self.made: list[int] = []

    def __call__(self, number: int) -> NDArray[np.float64]:
        self.made.append(number)
        return np.random.default_rng(number).normal(0.5, 0.1, self.size)


def kept(
    folder: Path | None,
    make: Callable[[int], NDArray[np.float64]] | None = None,
    about: dict[str, Any] | None = None,
    passes: int = PASSES,
    **options: Any,
) -> Truth:
    """Return a truth of those estimates, or of what `make` gives, kept in a folder."""
    return accumulated(about or description(), passes, make or Estimates(), folder=folder, **options)


def the_file(folder: Path) -> Path:
    (path,) = folder.glob("*.npz")
    return path


class Stop(Exception):
    """Ends a run in the middle."""


def stop_at(share: float, error: type[BaseException] = Stop) -> Callable[[float], None]:
    """Return a progress callback that raises from `share` on."""

    def report(done: float) -> None:
        if done >= share:
            raise error

    return report
