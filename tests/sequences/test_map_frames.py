"""Functions over frames in one process: what is done, skipped, failed, and done after a kill."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import SequenceError
from ssgi_cl.io import exr
from ssgi_cl.sequences.keys import described, key_of, stored_key
from ssgi_cl.sequences.map_frames import map_frames

from .work import Halved, doubled, picture, slowly


def values(paths: list[Path]) -> list[float]:
    return [float(exr.read(path)["Z"][0, 0]) for path in paths]


def outputs(folder: Path, count: int = 4) -> list[Path]:
    return [folder / f"out.{number:04d}.exr" for number in range(1, count + 1)]


def test_what_is_done_is_skipped_until_something_changes(frames: list[Path], tmp_path: Path) -> None:
    pattern = tmp_path / "out.####.exr"
    told: list[tuple[int, int]] = []
    found = gi.map_frames(doubled, frames, pattern, progress=lambda done, total, left: told.append((done, total)))
    assert values(outputs(tmp_path)) == [2, 4, 6, 8]
    assert [each.state for each in found.check()] == ["done"] * 4
    assert told == [(n, 4) for n in range(1, 5)]
    assert len(map_frames(doubled, frames, pattern).skipped) == 4
    exr.write(frames[2], {"depth": np.full((6, 8), 50.0)})
    assert [each.state for each in map_frames(doubled, frames, pattern)] == ["skipped", "skipped", "done", "skipped"]
    assert not map_frames(doubled, frames, pattern, arguments={"factor": 3.0}).skipped
    assert values(outputs(tmp_path)) == [3, 6, 150, 12]
    assert not map_frames(doubled, frames, pattern, arguments={"factor": 3.0}, again=True).skipped


def test_two_runs_write_the_same_bytes(frames: list[Path], tmp_path: Path) -> None:
    for name in ("a", "b"):
        map_frames(doubled, frames, tmp_path / f"{name}.####.exr").check()
    for number in range(1, 5):
        one, other = (tmp_path / f"{name}.{number:04d}.exr" for name in ("a", "b"))
        assert one.read_bytes() == other.read_bytes()


def test_a_bad_frame_is_told_and_stops_no_other(frames: list[Path], tmp_path: Path) -> None:
    frames[1].write_bytes(frames[1].read_bytes()[:200])
    frames[3].unlink()
    found = map_frames(doubled, frames, outputs(tmp_path))
    assert [each.state for each in found] == ["done", "failed", "done", "failed"]
    assert not outputs(tmp_path)[1].exists()
    with pytest.raises(SequenceError, match=r"2 of 4 frames failed\n  .*in\.0002\.exr: ValueError: .* damaged or cut"):
        found.check()
    assert repr(found) == "FrameResults of 4 frames: 2 done, 2 failed"


def test_a_place_that_cannot_be_written_is_told(frames: list[Path], tmp_path: Path) -> None:
    found = map_frames(doubled, frames, tmp_path / "nowhere" / "out.####.exr")
    assert len(found.failed) == 4
    assert "nowhere" in found.failed[0].reason


def test_reading_ahead_and_results_without_files(frames: list[Path], tmp_path: Path) -> None:
    found = map_frames(Halved(), frames)
    assert [float(each.value["depth"][0, 0]) for each in found] == [0.5, 1.0, 1.5, 2.0]
    map_frames(Halved(), frames, outputs(tmp_path)).check()
    assert values(outputs(tmp_path)) == [0.5, 1.0, 1.5, 2.0]


def test_pictures_have_keys_too(frames: list[Path], tmp_path: Path) -> None:
    pattern = tmp_path / "out.####.png"
    map_frames(picture, frames, pattern).check()
    assert len(map_frames(picture, frames, pattern).skipped) == 4
    assert stored_key(tmp_path / "out.0002.png") == key_of(described(picture, {}), frames[1])


def test_keys_tell_functions_arguments_and_contents_apart(frames: list[Path]) -> None:
    keys = {
        key_of(described(function, arguments), source)
        for function in (doubled, slowly, Halved())
        for arguments in ({}, {"factor": 1}, {"factor": 1.0}, {"factor": np.ones(2)}, {"factor": "1"})
        for source in (frames[0], frames[1], b"1", b"1" + b"1", np.ones(2), np.ones(2, np.float32))
    }
    assert len(keys) == 3 * 5 * 6


def test_damaged_files_have_no_key(tmp_path: Path) -> None:
    for name in ("a.exr", "a.png", "a.txt"):
        (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n")
        assert stored_key(tmp_path / name) is None
    assert stored_key(tmp_path / "none.exr") is None


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (["a.exr"] * 4, "twice"),
        (["a.exr"], "1 files: expected 4"),
        ("a.exr", "expected #### in the name"),
        ("a.####.jpg", "expected names that end in .exr or .png"),
    ],
)
def test_wrong_outputs_are_refused(frames: list[Path], files: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        map_frames(doubled, frames, files)  # type: ignore[arg-type]


def test_a_killed_run_is_ended_by_the_next(frames: list[Path], tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests.sequences.work import slowly; "
        "from ssgi_cl.sequences.map_frames import map_frames; "
        "map_frames(slowly, [Path(p) for p in sys.argv[2:]], sys.argv[1], arguments={'seconds': 0.2})"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "out.####.exr"), *map(str, frames)]
    process = subprocess.Popen(command, cwd=Path(__file__).parents[2])
    end = time.monotonic() + 60.0
    while not outputs(tmp_path)[0].exists() and time.monotonic() < end:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    there = [path.exists() for path in outputs(tmp_path)]
    assert there[0]
    assert not there[3]
    found = map_frames(slowly, frames, tmp_path / "out.####.exr", arguments={"seconds": 0.0})
    assert not found.skipped  # other arguments
    found = map_frames(slowly, frames, tmp_path / "out.####.exr", arguments={"seconds": 0.0})
    assert len(found.skipped) == 4
    assert values(outputs(tmp_path)) == [2, 4, 6, 8]
