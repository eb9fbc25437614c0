"""Frames that are damaged, disks that are full, folders that can't be written: told, and nothing else is lost."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ssgi_cl.core.errors import SequenceError
from ssgi_cl.io import exr
from ssgi_cl.sequences import cluster
from ssgi_cl.sequences.map_frames import map_frames
from tests.cli.commands import fails, process

from .work import doubled, noise


def test_damaged_frames_of_every_kind_are_told_and_others_done(frames: list[Path], tmp_path: Path) -> None:
    whole = frames[0].read_bytes()
    kinds = {
        "empty": b"",
        "text": b"P6\n",
        "header": whole[:150],
        "table": whole[: whole.index(b"screenWindowWidth") + 60],
        "pixels": whole[:-9],
    }
    bad = []
    for name, content in kinds.items():
        bad.append(tmp_path / f"{name}.exr")
        bad[-1].write_bytes(content)
    bad += [tmp_path / "link.exr", tmp_path / "folder.exr"]
    bad[-2].symlink_to(tmp_path / "gone")
    bad[-1].mkdir()
    found = map_frames(doubled, [*bad, *frames], tmp_path / "out.####.exr")
    assert [each.state for each in found] == ["failed"] * 7 + ["done"] * 4
    for path, result in zip(bad, found, strict=False):
        assert path.name in result.reason
        assert not result.output or not result.output.exists()
    assert not list(tmp_path.glob(".ssgi-*"))


def test_frames_of_mixed_sizes_each_keep_theirs(tmp_path: Path) -> None:
    paths = [tmp_path / f"in.{number}.exr" for number in range(4)]
    sizes = [(6, 8), (3, 5), (6, 8), (40, 2)]
    for path, size in zip(paths, sizes, strict=True):
        exr.write(path, {"depth": np.ones(size, np.float32)})
    map_frames(doubled, paths, tmp_path / "out.####.exr").check()
    assert [exr.read(tmp_path / f"out.000{n}.exr")["Z"].shape for n in range(1, 5)] == sizes


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 KiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if shutil.which("mount") is None or os.geteuid() != 0:
        pytest.skip("only root mounts a file system")
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", folder], capture_output=True, check=False)
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize("suffix", ["exr", "png"])
def test_a_full_disk_keeps_what_is_done(small_disk: Path, suffix: str) -> None:
    """Of results of 48 KiB that can't be compressed five fit."""
    out = small_disk / f"out.####.{suffix}"
    found = map_frames(noise, list(range(8)), out, arguments={"kind": suffix})
    states = [each.state for each in found]
    assert states[0] == "done"
    assert states[-1] == "failed"
    assert 2 <= len(found.failed) <= 5
    for each in found.failed:
        assert "No space left on device" in each.reason
        assert str(each.output) in each.reason
        assert each.output is not None
        assert not each.output.exists()
    assert not list(small_disk.glob(".ssgi-*"))
    done = {each.output: each.output.read_bytes() for each in found if each.state == "done" and each.output}
    subprocess.run(["mount", "-o", "remount,size=4m", small_disk], check=True)
    found = map_frames(noise, list(range(8)), out, arguments={"kind": suffix}).check()
    assert len(found.skipped) == len(done)
    assert all(path.read_bytes() == content for path, content in done.items())


def test_a_limit_of_file_sizes_keeps_what_is_done(tmp_path: Path) -> None:
    """As above where nothing can be mounted: the third result is larger than the limit."""
    code = (
        "import resource, sys; from pathlib import Path; from tests.sequences.work import noise; "
        "from ssgi_cl.sequences.map_frames import map_frames; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)); "
        "print([(e.state, e.reason) for e in map_frames(noise, [1, 2, 40, 4], sys.argv[1], arguments={'kind': 'exr'})])"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "out.####.exr")]
    done = subprocess.run(
        command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert re.findall("'(done|failed)'", done.stdout) == ["done", "done", "failed", "done"]
    assert "out.0003.exr" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.0001.exr", "out.0002.exr", "out.0004.exr"]


def test_a_folder_that_cannot_be_written_is_told_first(
    frames: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    source, output = tmp_path / "in.####.exr", tmp_path / "out.####.exr"
    assert "no file can be made in the folder" in fails(tmp_path, "apply", "ssao", source, "-o", output)


def test_a_read_only_file_system_is_told_first(frames: list[Path], small_disk: Path, tmp_path: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    done = process("apply", "ssao", tmp_path / "in.####.exr", "-o", small_disk / "out.####.exr")
    assert done.returncode == 1
    assert f"no file can be made in the folder {small_disk}" in done.stderr
    found = map_frames(doubled, frames, small_disk / "out.####.exr")
    assert len(found.failed) == 4
    assert "Read-only file system" in found.failed[0].reason


def test_a_scheduler_that_does_not_answer_is_told_in_time(
    frames: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="Dask distributed is not installed (extra 'cluster')")
    monkeypatch.setattr(cluster, "ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        with pytest.raises(SequenceError, match=f"the scheduler at tcp://127.0.0.1:{port} does not answer"):
            cluster.connected(f"tcp://127.0.0.1:{port}")
    source, output = tmp_path / "in.####.exr", tmp_path / "out.####.exr"
    arguments = ("apply", "ssao", source, "-o", output, "--scheduler")
    assert "does not answer" in fails(tmp_path, *arguments, "tcp://127.0.0.1:1")
    assert "does not answer" in fails(tmp_path, *arguments, "nonsense")


def test_a_worker_of_another_version_that_comes_late_is_refused(frames: list[Path]) -> None:
    with pytest.raises(SequenceError, match=r"a worker has version .* of ssgi_cl, and not 0\.0\.0: install the same"):
        cluster._on_worker("0.0.0", doubled, frames[0], None)  # type: ignore[arg-type]
