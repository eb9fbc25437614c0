"""Sequences on the command line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.cli.frames import report_frames
from ssgi_cl.io import exr

from .commands import fails, process, succeeds


@pytest.fixture
def shot(depth_file: Path) -> Path:
    """Frames 1 to 4 of a shot; the pattern of their names."""
    depth = exr.read(depth_file)["Z"]
    for number in range(1, 5):
        exr.write(depth_file.with_name(f"shot.{number:04d}.exr"), {"depth": depth * np.float32(1.0 + 0.1 * number)})
    return depth_file.with_name("shot.####.exr")


def lines(text: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def test_a_sequence_is_that_of_its_frames(shot: Path, tmp_path: Path) -> None:
    out = tmp_path / "ao.####.exr"
    said = succeeds("apply", "gtao", shot, "-o", out, "--set", "radius=.4").output
    assert "4 frames: 4 done, 0 skipped, 0 failed" in said
    succeeds("apply", "gtao", tmp_path / "shot.0003.exr", "-o", tmp_path / "one.exr", "--set", "radius=.4")
    one, other = exr.read(tmp_path / "one.exr"), exr.read(tmp_path / "ao.0003.exr")
    assert one.keys() == other.keys()
    np.testing.assert_array_equal(one["ao"], other["ao"])
    assert "4 frames: 0 done, 4 skipped" in succeeds("apply", "gtao", shot, "-o", out, "--set", "radius=.4").output
    again = succeeds("apply", "gtao", shot, "-o", out, "--set", "radius=.4", "--frames", "2-3", "--again").output
    assert "2 frames: 2 done" in again


class Quiet:
    """A function whose reading, in another thread, keeps what is printed meanwhile from standard output."""

    def read(self, number: int) -> int:
        with redirect_stdout(StringIO()):
            time.sleep(0.02)
        return number

    def __call__(self, number: int) -> np.ndarray[Any, Any]:
        return np.full((2, 2), number, np.uint8)


def test_no_line_is_lost_while_frames_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = list(range(12))
    files = [tmp_path / f"{number}.png" for number in numbers]
    report_frames(Quiet(), numbers, files, again=False, scheduler=None, as_json=True)
    told = lines(capsys.readouterr().out)
    assert [line.get("state") for line in told] == ["done"] * 12 + [None]


def test_bad_frames_and_gaps_are_told(shot: Path, tmp_path: Path) -> None:
    (tmp_path / "shot.0002.exr").write_bytes(b"no file")
    (tmp_path / "shot.0003.exr").unlink()
    done = process("apply", "ssao", shot, "-o", tmp_path / "ao.####.exr")
    assert done.returncode == 1
    assert "3 frames: 2 done, 0 skipped, 1 failed" in done.stdout
    assert "frames that are not there: 3" in done.stderr
    assert "shot.0002.exr is not an OpenEXR file" in done.stderr
    done = process("apply", "ssao", shot, "-o", tmp_path / "ao.####.exr", "--frames", "1-4", "--json")
    told = lines(done.stdout)
    assert done.returncode == 1
    assert [line.get("state") for line in told] == ["skipped", "failed", "failed", "skipped", None]
    assert told[-1] == {"frames": 4, "done": 0, "skipped": 2, "failed": 2}
    assert "No such file" in str(told[2]["reason"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("-o", "ao.exr"), "expected #### for the numbers of frames in its name"),
        (("-o", "ao.####.exr", "--frames", "1-"), "expected parts such as 7, 1-240"),
        (("-o", "ao.####.png", "--frames", "1"), "expected a name that ends in .exr"),
        (("-o", "nowhere/ao.####.exr"), "there is no folder"),
        (("-o", "shot.####.exr"), "those are the inputs"),
    ],
)
def test_a_wrong_call_is_told(shot: Path, tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    output = tmp_path / options[1]
    assert message in fails(tmp_path, "apply", "gtao", shot, "-o", output, *options[2:])


def test_numbers_need_a_place(depth_file: Path, tmp_path: Path) -> None:
    assert "expected #### in its name with --frames" in fails(
        tmp_path, "apply", "gtao", depth_file, "-o", tmp_path / "ao.exr", "--frames", "1-2"
    )
    assert "there is no such frame" in fails(
        tmp_path, "apply", "gtao", tmp_path / "none.####.exr", "-o", tmp_path / "ao.####.exr"
    )


@pytest.mark.slow
def test_two_runs_at_once_on_one_output_and_cache(shot: Path, tmp_path: Path) -> None:
    """Caches are new, so that both compile and keep the same kernels at the same time."""
    folders = {"SSGI_CL_CACHE": str(tmp_path / "cache"), "POCL_CACHE_DIR": str(tmp_path / "pocl")}
    command = [sys.executable, "-m", "ssgi_cl.cli.command", "apply", "gtao", str(shot), "--set", "radius=.4", "-o"]
    both = [*command, str(tmp_path / "ao.####.exr")]
    runs = [subprocess.Popen(both, env=os.environ | folders, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    for run in runs:
        told = run.communicate(timeout=300)[1]
        assert run.returncode == 0, told
    subprocess.run([*command, str(tmp_path / "one.####.exr")], check=True, timeout=300)
    for number in range(1, 5):
        one, other = (tmp_path / f"{name}.{number:04d}.exr" for name in ("ao", "one"))
        assert one.read_bytes() == other.read_bytes()
    assert not list(tmp_path.glob(".ssgi-*"))
    again = subprocess.run([*both, "--json"], check=True, timeout=300, capture_output=True, text=True)
    assert lines(again.stdout)[-1] == {"frames": 4, "done": 0, "skipped": 4, "failed": 0}
