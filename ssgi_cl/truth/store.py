"""Truths on disk: each made once, pass by pass, under a hash of everything that determines it.

A truth is one file, `KIND-HASH.npz` in the folder `truth` of the cache folder: mean, standard
error, and the description that the hash is of. While it is being made, the sums so far are in
`KIND-HASH.partial.npz`, from which the next call goes on.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.errors import TruthError
from ssgi_cl.device.drivers.caches import cache_folder
from ssgi_cl.device.progress import Progress, Told, told
from ssgi_cl.truth.digests import canonical, digest
from ssgi_cl.truth.files import TruthFiles, read

Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]

FORMAT = 1
"""Of the files; another number makes other hashes."""

MOST_PASSES = 1 << 20

SAVE_SECONDS = 2.0
"""Between two saves of the sums so far, at least."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A reference image and how far it may be off.

    Attributes:
        mean: [rows, columns] or [rows, columns, 3] float32.
        error: the same shape, float32: standard error of the mean, from the spread of the passes;
            0 where the truth is exact, infinite where a single pass can't tell.
        passes: independent estimates that the mean is of.
        key: hash of everything that determines it.
    """

    mean: Floats
    error: Floats
    passes: int
    key: str


class Stored(NamedTuple):
    """A file of the store; without a description where it can't be read."""

    path: Path
    description: Mapping[str, Any] | None
    bytes: int


def truth_folder() -> Path:
    """Return the folder that truths are kept in."""
    return cache_folder() / "truth"


def accumulated(
    description: Mapping[str, Any],
    passes: int,
    make: Callable[[int], NDArray[Any]],
    *,
    exact: bool = False,
    rebuild: bool = False,
    progress: Progress = None,
    folder: Path | None = None,
) -> Truth:
    """Return the mean of independent estimates: the kept one, or it is made now and kept.

    An interrupted call leaves its sums behind; the next one goes on from there and gives the same
    bits. Where nothing can be written the truth is made all the same, with a warning.

    Args:
        description: everything that determines an estimate, as JSON can hold it (see
            `ssgi_cl.truth.digests`). "kind" is a word that the file's name begins with, "camera"
            what `camera_description` returns.
        passes: number of estimates, >= 1.
        make: returns the estimate of a pass from its number, [rows, columns] or
            [rows, columns, 3]; all equally good, independent, and the same whenever it is called.
        exact: an estimate has no noise, so that the standard error is 0.
        rebuild: forget what is kept, and make it anew.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.
        folder: where to keep it, by default `truth_folder()`.

    Raises:
        TruthError: what is kept is damaged, or is another truth; the message names the file, what
            is wrong with it, and the remedy.
        ValueError: an estimate has another size than the camera, or is not finite.
    """
    passes = checks.integer("passes", passes, low=1, high=MOST_PASSES)
    # As it comes back from a file: tuples are lists there.
    about = json.loads(
        canonical({"format": FORMAT, "passes": passes, "exact": exact, "description": dict(description)})
    )
    key = digest(about)
    kept = TruthFiles((folder or truth_folder()) / f"{description['kind']}-{key[:16]}.npz", about)
    if rebuild:
        kept.forget()
    found = kept.load(kept.path, "mean", "error")
    with told(progress, str(description["kind"])) as tell:
        if found is None:
            found = _made(kept, passes, make, exact, tell)
        elif tell is not None:
            tell(1.0)
    return Truth(found["mean"], found["error"], passes, key)


def stored(folder: Path | None = None) -> list[Stored]:
    """Return what the store holds, finished or not, by name."""
    result = []
    for path in sorted((folder or truth_folder()).glob("*.npz")):
        with suppress(FileNotFoundError):  # another process has just finished it
            try:
                description = read(path)[0].get("description")
            except TruthError:
                description = None
            result.append(Stored(path, description, path.stat().st_size))
    return result


def clear(folder: Path | None = None) -> int:
    """Delete what the store holds; return how many bytes that frees."""
    freed = 0
    for pattern in ("*.npz", ".ssgi-*.tmp"):  # the latter where a process was killed
        for path in (folder or truth_folder()).glob(pattern):
            with suppress(FileNotFoundError):
                freed += path.stat().st_size
                path.unlink()
    return freed


@dataclass(frozen=True)
class _Sums:
    """Running mean and deviations of passes (Welford 1962). Never changed, so that it is whole at any moment."""

    passes: int
    mean: Doubles
    squares: Doubles
    """Sum of the squared deviations from the mean."""

    def plus(self, estimate: Doubles) -> _Sums:
        passes = self.passes + 1
        off = estimate - self.mean
        mean = self.mean + off / passes
        return _Sums(passes, mean, self.squares + off * (estimate - mean))

    def error(self) -> Doubles:
        if self.passes == 1:
            return np.full_like(self.mean, np.inf)
        deviation: Doubles = np.sqrt(self.squares / (self.passes - 1) / self.passes)
        return deviation


def _made(
    kept: TruthFiles, passes: int, make: Callable[[int], NDArray[Any]], exact: bool, tell: Told | None
) -> dict[str, NDArray[Any]]:
    begun = kept.load(kept.partial, "passes", "mean", "squares")
    sums = _Sums(0, np.zeros(()), np.zeros(()))
    if begun is not None:
        sums = _Sums(int(begun["passes"]), begun["mean"], begun["squares"])
    saved, saved_at = sums.passes, time.monotonic()
    try:
        while sums.passes < passes:
            number = sums.passes
            sums = sums.plus(_checked(make(number), number, kept.size))
            if sums.passes < passes and time.monotonic() - saved_at >= SAVE_SECONDS:
                kept.save(kept.partial, **vars(sums))
                saved, saved_at = sums.passes, time.monotonic()
            if tell is not None:
                tell(sums.passes / passes)
    except BaseException:
        if sums.passes > saved:
            kept.save(kept.partial, **vars(sums))
        raise
    error = np.zeros_like(sums.mean) if exact else sums.error()
    result = {"mean": sums.mean.astype(np.float32), "error": error.astype(np.float32)}
    kept.save(kept.path, **result)
    with suppress(OSError):
        kept.partial.unlink()
    return result


def _checked(estimate: NDArray[Any], number: int, size: tuple[int, int]) -> Doubles:
    """Return the estimate of a pass in float64; it must have the camera's size (rows, columns)."""
    if estimate.shape[:2] != size:
        raise ValueError(f"pass {number} has shape {estimate.shape}: expected {size[0]} rows and {size[1]} columns")
    usable = np.isfinite(estimate)
    if not usable.all():
        place = np.argwhere(~usable)[0].tolist()
        raise ValueError(f"pass {number} holds {estimate[tuple(place)]} at {place}: expected finite numbers")
    return estimate.astype(np.float64)
