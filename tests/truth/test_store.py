"""The store of truths: what it keeps, what it takes for the same, and what it refuses."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl.truth.store as module
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import TruthError
from ssgi_cl.core.lights import Environment, PointLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.truth.digests import camera_description, digest, light_description, scene_digest
from ssgi_cl.truth.store import Truth, accumulated, clear, stored

from .conftest import same

SIZE = (7, 9)
PASSES = 5


def view(size: tuple[int, int] = SIZE) -> Camera:
    return Camera.look_at((0, 0, 3), (0, 0, 0), width=size[1], height=size[0])


def description(size: tuple[int, int] = SIZE, **other: Any) -> dict[str, Any]:
    return {"kind": "test", "camera": camera_description(view(size)), "radius": math.inf, **other}


@pytest.fixture(autouse=True)
def folder() -> None:
    """The usual folder: these tests say where they keep what."""


class Estimates:
    """Passes of noise round 0.5, and how often each was made."""

    def __init__(self, size: tuple[int, ...] = SIZE) -> None:
        self.size = size
        self.made: list[int] = []

    def __call__(self, number: int) -> NDArray[np.float64]:
        self.made.append(number)
        return np.random.default_rng(number).normal(0.5, 0.1, self.size)


def kept(tmp_path: Path, **arguments: Any) -> Truth:
    """Return a truth of those estimates, kept in `tmp_path`."""
    make = arguments.pop("make", None) or Estimates()
    return accumulated(description(), PASSES, make, folder=tmp_path, **arguments)


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
            truth = accumulated(description(), 1, Estimates(), exact=exact, folder=tmp_path)
            np.testing.assert_array_equal(truth.error, error)


def test_second_call_makes_nothing_and_gives_the_same(tmp_path: Path) -> None:
    first, told = kept(tmp_path), []
    again = Estimates()
    second = kept(tmp_path, make=again, progress=told.append)
    assert again.made == []
    assert same(first, second)
    assert told == [1.0]


def test_progress_grows_to_one(tmp_path: Path) -> None:
    told: list[float] = []
    kept(tmp_path, progress=told.append)
    assert told == [0.2, 0.4, 0.6, 0.8, 1.0]


@pytest.mark.parametrize(
    "change", [{"radius": 1.0}, {"camera": camera_description(view((9, 7)))}, {"more": 0}], ids=str
)
def test_another_description_is_another_truth(tmp_path: Path, change: dict[str, Any]) -> None:
    about = {**description(), **change}
    make = Estimates(tuple(about["camera"]["size"]))
    keys = {kept(tmp_path).key, accumulated(about, PASSES, make, folder=tmp_path).key}
    assert len(keys) == len(stored(tmp_path)) == 2


def test_another_number_of_passes_is_another_truth(tmp_path: Path) -> None:
    kept(tmp_path)
    again = Estimates()
    accumulated(description(), PASSES + 1, again, folder=tmp_path)
    assert again.made == list(range(PASSES + 1))


def test_order_of_a_description_does_not_matter(tmp_path: Path) -> None:
    first = kept(tmp_path)
    turned = dict(reversed(description().items()))
    assert same(first, accumulated(turned, PASSES, Estimates(), folder=tmp_path))


def test_rebuild_makes_it_anew_and_replaces_it(tmp_path: Path) -> None:
    kept(tmp_path, make=lambda i: np.zeros(SIZE))
    again = Estimates()
    truth = kept(tmp_path, make=again, rebuild=True)
    assert again.made == list(range(PASSES))
    assert same(kept(tmp_path, make=Estimates()), truth)


def test_it_is_kept_in_the_cache_folder_unless_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    accumulated(description(), PASSES, Estimates())
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
        accumulated(description(more=1), 3, Estimates(), folder=tmp_path, progress=stop_at(0.3))
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
    for _ in range(10):
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


# ---- damaged


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
    kept(tmp_path)
    path = the_file(tmp_path)
    damage(path)
    with pytest.raises(TruthError, match=message) as caught:
        kept(tmp_path)
    assert str(path) in str(caught.value)
    assert "delete it, or run ssgi truth --rebuild" in str(caught.value)


@pytest.mark.parametrize("name", ["empty", "cut", "not finite", "other size"])
def test_rebuild_mends_a_damaged_file(tmp_path: Path, name: str) -> None:
    whole = kept(tmp_path)
    DAMAGE[name][0](the_file(tmp_path))
    assert same(kept(tmp_path, rebuild=True), whole)
    assert same(kept(tmp_path), whole)


def test_any_flipped_byte_is_noticed_or_harmless(tmp_path: Path) -> None:
    whole = kept(tmp_path)
    path = the_file(tmp_path)
    content = path.read_bytes()
    noticed = 0
    for place in range(0, len(content), 13):  # prime to the 4 bytes of a number
        flipped = bytearray(content)
        flipped[place] ^= 0x55
        path.write_bytes(flipped)
        try:
            truth = kept(tmp_path)
        except TruthError:
            noticed += 1
        else:
            assert same(truth, whole), place  # such as a time in the archive's list
    assert noticed > 0.8 * len(content) / 13


def test_truth_of_another_resolution_is_named_with_both_sizes(tmp_path: Path) -> None:
    kept(tmp_path / "small")
    large = (14, 18)
    accumulated(description(large), PASSES, Estimates(large), folder=tmp_path / "large")
    the_file(tmp_path / "large").replace(the_file(tmp_path / "small"))
    with pytest.raises(TruthError, match=r"size is \[14, 18\]: expected \[7, 9\]"):
        kept(tmp_path / "small")


def test_truth_of_another_description_is_named_with_the_difference(tmp_path: Path) -> None:
    kept(tmp_path / "here")
    accumulated(description(more=2), PASSES, Estimates(), folder=tmp_path / "there")
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
        accumulated(description(), 0, Estimates(), folder=tmp_path)


# ---- hashes of what determines a truth


def triangle(**changes: Any) -> Scene:
    arrays: dict[str, Any] = {
        "positions": np.eye(3, dtype=np.float32),
        "normals": np.ones((3, 3), np.float32),
        "uvs": np.zeros((3, 2), np.float32),
        "colors": np.ones((3, 3), np.float32),
        "triangles": np.array([[0, 1, 2]], np.int32),
        "material_ids": np.zeros(1, np.int32),
        "textures": (np.zeros((2, 2, 4), np.uint8),),
    }
    return Scene(**{**arrays, **changes})


SCENE_CHANGES: tuple[dict[str, Any], ...] = (
    {"origin": np.array((1.0, 0.0, 0.0))},
    {"positions": np.nextafter(np.eye(3, dtype=np.float32), np.float32(2.0))},
    {"normals": -np.ones((3, 3), np.float32)},
    {"uvs": np.ones((3, 2), np.float32)},
    {"colors": np.zeros((3, 3), np.float32)},
    {"triangles": np.array([[1, 2, 0]], np.int32)},
    {"materials": (Material(), Material())},
    {"materials": (Material(gloss=2.0),)},
    {"materials": (Material(texture=0),)},
    {"textures": (np.ones((2, 2, 4), np.uint8),)},
    {"textures": (np.zeros((4, 1, 4), np.uint8),)},
    {"textures": ()},
)


def test_scene_digest_tells_every_change_apart() -> None:
    found = [scene_digest(triangle(**change)) for change in ({}, *SCENE_CHANGES)]
    assert len(set(found)) == len(found)
    assert scene_digest(triangle()) == found[0]


def test_camera_and_light_descriptions_tell_changes_apart_and_fit_json() -> None:
    cameras = [view(), replace(view(), width=8), replace(view(), view=np.eye(4))]
    sky = np.ones((8, 16, 3))
    lights = [
        PointLight((0, 1, 0), 1.0),
        PointLight((0, 1, 0), 2.0),
        SpotLight((0, 1, 0), (0, -1, 0), 0.5, 1.0),
        SpotLight((0, 1, 0), (0, -1, 0), 0.6, 1.0),
        Environment(1.0),
        Environment(sky),
        Environment(2.0 * sky),
    ]
    texts = [json.dumps(camera_description(camera)) for camera in cameras]
    texts += [json.dumps(light_description(light)) for light in lights]
    assert len(set(texts)) == len(texts)
    assert max(map(len, texts)) < 2000  # a sky is told by its hash


def test_digest_knows_types_shapes_and_the_division_into_parts() -> None:
    zeros = np.zeros(4, np.float32)
    found = [
        digest(zeros),
        digest(zeros.astype(np.int32)),
        digest(zeros.reshape(2, 2)),
        digest(zeros, zeros),
        digest(np.zeros(8, np.float32)),
        digest("a", "b"),
        digest("ab"),
        digest(["a", "b"]),
        digest(None),
        digest(),
    ]
    assert len(set(found)) == len(found)
    assert digest(zeros[::2]) == digest(np.zeros(2, np.float32))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scene_digest("room.glb"), "scene is str: expected a Scene"),  # type: ignore[arg-type]
        (lambda: camera_description(None), "camera is None"),  # type: ignore[arg-type]
    ],
)
def test_something_else_than_a_scene_or_camera_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        call()
