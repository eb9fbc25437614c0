"""Truths on disk that are damaged, or not those that are asked for."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.errors import TruthError
from ssgi_cl.truth.store import stored

from .conftest import same
from .estimates import SIZE, Estimates, Stop, description, kept, stop_at, the_file


def altered(path: Path, **changes: Any) -> None:
    """Replace arrays of a file."""
    with np.load(path) as entries:
        arrays = {**dict(entries), **changes}
    np.savez(path, **arrays)


DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "empty": (lambda path: path.write_bytes(b""), "can't be read"),
    "text": (lambda path: path.write_text("hello"), "can't be read"),
    "cut": (lambda path: os.truncate(path, path.stat().st_size // 2), "can't be read"),
    "folder": (lambda path: (path.unlink(), path.mkdir()), "can't be read"),
    "one array": (lambda path: np.ones(3).dump(path), "can't be read"),
    "no arrays": (lambda path: np.savez(path, about=np.array("{}")), "can't be read"),
    "nothing said": (lambda path: altered(path, about=np.array("[]")), "does not say what it is"),
    "not finite": (lambda path: altered(path, mean=np.full(SIZE, np.nan, np.float32)), "mean holds nan"),
    "error below 0": (lambda path: altered(path, error=np.full(SIZE, -1.0, np.float32)), r"error holds -1\.0"),
    "other type": (lambda path: altered(path, mean=np.ones(SIZE)), "mean is float64.*float32"),
    "other size": (
        lambda path: altered(path, mean=np.ones((4, 5), np.float32)),
        r"mean has shape \(4, 5\): expected 7 rows and 9 columns",
    ),
    "other channels": (lambda path: altered(path, error=np.ones((*SIZE, 3), np.float32)), r"error is float32 \(7"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_file_is_refused_with_its_name_and_the_remedy(tmp_path: Path, name: str) -> None:
    damage, message = DAMAGE[name]
    whole = kept(tmp_path)
    path = the_file(tmp_path)
    damage(path)
    with pytest.raises(TruthError, match=message) as caught:
        kept(tmp_path)
    assert str(path) in str(caught.value)
    assert "delete it, or run ssgi truth --rebuild" in str(caught.value)
    if path.is_file():
        assert same(kept(tmp_path, rebuild=True), whole)
        assert same(kept(tmp_path), whole)


def test_any_flipped_byte_is_noticed_or_harmless(tmp_path: Path) -> None:
    whole = kept(tmp_path)
    path = the_file(tmp_path)
    content = path.read_bytes()
    noticed = 0
    for place in range(0, len(content), 37):  # prime to the 4 bytes of a number
        flipped = bytearray(content)
        flipped[place] ^= 0x55
        path.write_bytes(flipped)
        try:
            truth = kept(tmp_path)
        except TruthError:
            noticed += 1
        else:
            assert same(truth, whole), place  # such as a time in the archive's list
    assert noticed > 0.8 * len(content) / 37


def test_truth_of_another_resolution_is_named_with_both_sizes(tmp_path: Path) -> None:
    kept(tmp_path / "small")
    large = (14, 18)
    kept(tmp_path / "large", Estimates(large), description(large))
    the_file(tmp_path / "large").replace(the_file(tmp_path / "small"))
    with pytest.raises(TruthError, match=r"size is \[14, 18\]: expected \[7, 9\]"):
        kept(tmp_path / "small")


def test_truth_of_another_description_is_named_with_the_difference(tmp_path: Path) -> None:
    kept(tmp_path / "here")
    kept(tmp_path / "there", about=description(more=2))
    the_file(tmp_path / "there").replace(the_file(tmp_path / "here"))
    with pytest.raises(TruthError, match=r"another truth \(its description more is 2: expected"):
        kept(tmp_path / "here")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: os.truncate(path, 100), "can't be read"),
        (lambda path: altered(path, passes=np.array(99)), "counts 99 passes of 5"),
        (lambda path: altered(path, squares=np.full(SIZE, np.nan)), "squares holds nan"),
    ],
)
def test_damaged_sums_are_refused_and_rebuild_starts_anew(
    tmp_path: Path, damage: Callable[[Path], object], message: str
) -> None:
    whole = kept(tmp_path / "whole")
    with pytest.raises(Stop):
        kept(tmp_path / "parts", progress=stop_at(0.6))
    damage(the_file(tmp_path / "parts"))
    with pytest.raises(TruthError, match=rf"partial\.npz.*{message}.*--rebuild"):
        kept(tmp_path / "parts")
    assert same(kept(tmp_path / "parts", rebuild=True), whole)


@pytest.mark.parametrize(
    ("estimate", "message"),
    [
        (np.ones((4, 5)), r"pass 0 has shape \(4, 5\): expected 7 rows and 9 columns"),
        (np.full(SIZE, np.nan), r"pass 0 holds nan at \[0, 0\]: expected finite numbers"),
    ],
)
def test_estimate_that_is_no_image_of_the_camera_is_refused(
    tmp_path: Path, estimate: NDArray[np.float64], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        kept(tmp_path, make=lambda i: estimate)
    assert stored(tmp_path) == []


def test_number_of_passes_is_checked(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="passes is 0: expected an integer >= 1"):
        kept(tmp_path, passes=0)
