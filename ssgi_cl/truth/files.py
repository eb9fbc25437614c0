"""The files of a truth: written whole or not at all, checked when read."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import TruthError
from ssgi_cl.truth.digests import canonical

REMEDY = "delete it, or run ssgi truth --rebuild with the options that it was made with"


@dataclass
class TruthFiles:
    """The files of one truth.

    Attributes:
        path: of the finished truth.
        about: what its hash is of.
    """

    path: Path
    about: Mapping[str, Any]
    writable: bool = field(default=True, init=False)

    @property
    def partial(self) -> Path:
        """File of the sums so far."""
        return self.path.with_suffix(".partial.npz")

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns) of the camera."""
        rows, columns = self.about["description"]["camera"]["size"]
        return rows, columns

    def forget(self) -> None:
        """Delete both."""
        for path in (self.path, self.partial):
            with suppress(OSError):  # what can't be deleted can't be replaced either: save warns
                path.unlink()

    def save(self, path: Path, **arrays: Any) -> None:
        """Write a file whole or not at all; warn once where that is not possible."""
        if not self.writable:
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacement(path) as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(canonical(self.about)), **arrays)
        except OSError as error:
            self.writable = False
            warnings.warn(f"the truth is not kept, and is made anew next time: {error}", RuntimeWarning, stacklevel=2)

    def load(self, path: Path, *names: str) -> dict[str, NDArray[Any]] | None:
        """Return arrays of a file after checking it, or None if there is none."""
        try:
            about, arrays = read(path, *names)
        except (FileNotFoundError, NotADirectoryError):
            return None
        if about != self.about:
            raise _wrong(path, f"it holds another truth ({_first_difference(about, self.about)})")
        passes = int(arrays.get("passes", np.array(self.about["passes"])))
        if not 1 <= passes <= self.about["passes"]:
            raise _wrong(path, f"it counts {passes} passes of {self.about['passes']}")
        shape = arrays["mean"].shape
        for name in names:
            array = arrays[name]
            if name == "passes":
                continue
            wanted = np.float64 if path == self.partial else np.float32
            if array.shape[:2] != self.size or array.shape[2:] not in ((), (3,)):
                raise _wrong(
                    path, f"its {name} has shape {array.shape}: expected {self.size[0]} rows and {self.size[1]} columns"
                )
            if array.dtype != wanted or array.shape != shape:
                raise _wrong(path, f"its {name} is {array.dtype} {array.shape}: expected {np.dtype(wanted)} {shape}")
            usable = np.isfinite(array) if name == "mean" else array >= 0.0
            if not usable.all():
                raise _wrong(path, f"its {name} holds {array[~usable][0]}")
        return arrays


def read(path: Path, *names: str) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return what a file says that it is, and its arrays called `names`.

    Raises:
        TruthError: it can't be read.
        FileNotFoundError, NotADirectoryError: there is none.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as entries:
            about = json.loads(str(entries["about"]))
            arrays = {name: entries[name] for name in names}
    except (FileNotFoundError, NotADirectoryError):
        raise
    except Exception as error:  # a damaged file makes the readers of zip and npy raise anything
        raise _wrong(path, f"it can't be read ({error})") from error
    if not isinstance(about, dict):
        raise _wrong(path, "it does not say what it is")
    return about, arrays


def _wrong(path: Path, what: str) -> TruthError:
    return TruthError(f"the kept truth {path} can't be used: {what}; {REMEDY}")


def _first_difference(found: Any, asked: Any, name: str = "") -> str:
    """Say in which entry two descriptions differ; sizes first."""
    if isinstance(found, dict) and isinstance(asked, dict):
        for key in sorted(found.keys() | asked.keys(), key=lambda key: (key != "size", key)):
            if found.get(key) != asked.get(key):
                return _first_difference(found.get(key), asked.get(key), f"{name} {key}".strip())
    return f"its {name} is {found}: expected {asked}"
