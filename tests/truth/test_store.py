"""The store of truths: what it keeps, what it takes for the same, and what it refuses."""

from __future__ import annotations

import json
import math
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl.truth.store as module
from ssgi_cl.truth.digests import camera_description
from ssgi_cl.truth.store import clear, stored

from .conftest import same
from .estimates import PASSES, SIZE, Estimates, Stop, description, kept, stop_at, the_file, view


@pytest.fixture(autouse=True)
def folder() -> None:
    """The usual folder: these tests say where they keep what."""


# ---- mean, error, one making


@pytest.mark.parametrize("size", [SIZE, (*SIZE, 3)], ids=str)
def test_mean_and_standard_error_are_those_of_the_passes(tmp_path: Path, size: tuple[int, ...]) -> None:
    truth = kept(tmp_path, make=Estimates(size))
    passes = np.stack([Estimates(size)(i) for i in range(PASSES)])
    assert truth.mean.dtype == truth.error.dtype == np.float32
    assert truth.passes == PASSES
    # One rounding to float32, 6e-8, and some of float64.
    np.testing.assert_allclose(truth.mean, passes.mean(axis=0), rtol=1e-7)
    expected = passes.std(axis=0, ddof=1) / math.sqrt(PASSES)
    np.testing.assert_allclose(truth.error, expected, rtol=1e-6)


def test_single_pass_knows_no_error_unless_it_is_exact(tmp_path: Path) -> None:
    for exact, error in ((False, math.inf), (True, 0.0)):
        for _ in range(2):  # made, then kept
            truth = kept(tmp_path, passes=1, exact=exact)
            np.testing.assert_array_equal(truth.error, error)


def test_second_call_makes_nothing_and_gives_the_same(tmp_path: Path) -> None:
    told: list[float] = []
    first = kept(tmp_path, progress=told.append)
    assert told == [0.2, 0.4, 0.6, 0.8, 1.0]
    again = Estimates()
    second = kept(tmp_path, make=again, progress=told.append)
    assert again.made == []
    assert same(first, second)
    assert told[5:] == [1.0]


def test_a_bar_may_be_asked_for_and_prints_nothing_where_nobody_looks(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert same(kept(tmp_path / "bar", progress=True), kept(tmp_path / "none"))
    assert capfd.readouterr() == ("", "")
    with pytest.raises(TypeError, match="progress is 'yes': expected True for a bar"):
        kept(tmp_path, progress="yes")


@pytest.mark.parametrize(
    "change", [{"radius": 1.0}, {"camera": camera_description(view((9, 7)))}, {"more": 0}], ids=str
)
def test_another_description_is_another_truth(tmp_path: Path, change: dict[str, Any]) -> None:
    about = {**description(), **change}
    make = Estimates(tuple(about["camera"]["size"]))
    keys = {kept(tmp_path).key, kept(tmp_path, make, about).key}
    assert len(keys) == len(stored(tmp_path)) == 2


def test_another_number_of_passes_is_another_truth(tmp_path: Path) -> None:
    kept(tmp_path)
    again = Estimates()
    kept(tmp_path, again, passes=PASSES + 1)
    assert again.made == list(range(PASSES + 1))


def test_order_of_a_description_does_not_matter(tmp_path: Path) -> None:
    first = kept(tmp_path)
    assert same(first, kept(tmp_path, about=dict(reversed(description().items()))))


def test_rebuild_makes_it_anew_and_replaces_it(tmp_path: Path) -> None:
    kept(tmp_path, make=lambda i: np.zeros(SIZE))
    again = Estimates()
    truth = kept(tmp_path, make=again, rebuild=True)
    assert again.made == list(range(PASSES))
    assert same(kept(tmp_path, make=Estimates()), truth)


def test_it_is_kept_in_the_cache_folder_unless_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    kept(None)
    assert [entry.path.parent for entry in stored()] == [tmp_path / "truth"]


def test_file_says_what_it_is(tmp_path: Path) -> None:
    truth = kept(tmp_path)
    path = the_file(tmp_path)
    assert path.name == f"test-{truth.key[:16]}.npz"
    with np.load(path) as entries:
        about = json.loads(str(entries["about"]))
        np.testing.assert_array_equal(entries["mean"], truth.mean)
    assert about["description"] == description()
    assert about["passes"] == PASSES


def test_stored_lists_and_clear_deletes_all_files(tmp_path: Path) -> None:
    assert stored(tmp_path / "none") == []
    kept(tmp_path)
    with pytest.raises(Stop):
        kept(tmp_path, about=description(more=1), passes=3, progress=stop_at(0.3))
    (tmp_path / "broken.npz").write_bytes(b"no truth")
    (tmp_path / ".ssgi-0.tmp").write_bytes(b"left by a process that was killed")
    (tmp_path / "notes.txt").write_bytes(b"somebody's")
    found = stored(tmp_path)
    assert [entry.description and entry.description["kind"] for entry in found] == [None, "test", "test"]
    assert clear(tmp_path) == sum(entry.bytes for entry in found) + 33
    assert os.listdir(tmp_path) == ["notes.txt"]


# ---- interrupted


@pytest.mark.parametrize("error", [KeyboardInterrupt, Stop])
@pytest.mark.parametrize("share", [0.2, 0.6, 1.0])
def test_interrupted_run_goes_on_and_gives_bit_identical_results(
    tmp_path: Path, error: type[BaseException], share: float
) -> None:
    whole = kept(tmp_path / "whole")
    with pytest.raises(error):
        kept(tmp_path / "parts", progress=stop_at(share, error))
    assert the_file(tmp_path / "parts").name.endswith(".partial.npz")
    rest = Estimates()
    truth = kept(tmp_path / "parts", make=rest)
    assert rest.made == list(range(round(share * PASSES), PASSES))
    assert same(truth, whole)
    assert not the_file(tmp_path / "parts").name.endswith(".partial.npz")


def test_failure_of_a_pass_keeps_those_before(tmp_path: Path) -> None:
    def fails(number: int) -> NDArray[np.float64]:
        if number == 3:
            raise MemoryError
        return Estimates()(number)

    with pytest.raises(MemoryError):
        kept(tmp_path, make=fails)
    rest = Estimates()
    kept(tmp_path, make=rest)
    assert rest.made == [3, 4]


def test_sums_are_on_disk_while_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SAVE_SECONDS", 0.0)
    found: list[int] = []

    def looks(number: int) -> NDArray[np.float64]:
        for path in tmp_path.glob("*.partial.npz"):  # what a process killed now would leave
            with np.load(path) as entries:
                found.append(int(entries["passes"]))
        return Estimates()(number)

    kept(tmp_path, make=looks)
    assert found == [1, 2, 3, 4]


def test_rebuild_starts_from_the_first_pass(tmp_path: Path) -> None:
    with pytest.raises(Stop):
        kept(tmp_path, progress=stop_at(0.6))
    again = Estimates()
    kept(tmp_path, make=again, rebuild=True)
    assert again.made == list(range(PASSES))


def test_two_that_make_the_same_truth_do_not_disturb_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SAVE_SECONDS", 0.0)
    whole = kept(tmp_path / "whole")
    for _ in range(3):
        with ThreadPoolExecutor(4) as pool:
            made = list(pool.map(lambda _: kept(tmp_path / "shared"), range(4)))
        assert all(same(truth, whole) for truth in made)
        assert same(kept(tmp_path / "shared"), whole)
        clear(tmp_path / "shared")


def test_truth_that_cannot_be_written_is_made_with_a_warning(tmp_path: Path) -> None:
    whole = kept(tmp_path / "whole")
    (tmp_path / "file").write_bytes(b"")
    with pytest.warns(RuntimeWarning, match="the truth is not kept.*file") as warned:
        truth = kept(tmp_path / "file" / "folder")
    assert same(truth, whole)
    assert len(warned) == 1
