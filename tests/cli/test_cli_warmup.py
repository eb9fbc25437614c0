"""The command `ssgi warmup`, and the line that names it where a command compiles much for the first time."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.cli import warmup
from ssgi_cl.device import programs
from ssgi_cl.device.compiled import CompiledRecord
from ssgi_cl.device.runtime import Runtime

from .commands import answer, fails, process, succeeds


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of the steps."""
    steps = warmup._steps
    monkeypatch.setattr(warmup, "SCENES", ("cornell_box",))
    monkeypatch.setattr(warmup, "_steps", lambda runtime: steps(runtime)[:2])


@pytest.mark.usefixtures("few")
def test_it_tells_programs_and_time_and_leaves_nothing_to_compile(tmp_path: Path, runtime: Runtime) -> None:
    told = answer("warmup")
    assert told["device"] == runtime.info.label
    assert told["variant"] == str(runtime.variant)
    assert told["programs"] == runtime.builds >= 40
    assert told["seconds"] > 0.0
    lines = succeeds("warmup").stdout.splitlines()
    assert lines[0] == f"{runtime.info.label}, {runtime.variant}"
    assert lines[1].startswith(f"{runtime.builds} programs, ")
    succeeds("render", "cornell_box", "--width", 320, "--height", 200, "-o", tmp_path / "a.png")
    assert runtime.builds == told["programs"]


def test_an_unknown_device_is_named(tmp_path: Path) -> None:
    assert "no such device" in fails(tmp_path, "warmup", "--device", "no such device").replace("'", "")


def test_a_command_that_compiles_much_says_so_on_standard_error(
    tmp_path: Path, runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run as on a machine that has compiled nothing, without a terminal."""
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(programs, "MANY", 2)
    monkeypatch.setattr(runtime.programs, "record", CompiledRecord())
    monkeypatch.setattr(runtime.programs, "announced", False)
    monkeypatch.setattr(runtime.programs, "kernels", {})
    monkeypatch.setattr(runtime.programs, "_programs", {})
    runtime.forget()
    command: Any = ("render", "cornell_box", "--width", 64, "--height", 48, "--bounces", 0, "--json", "-o")
    first = succeeds(*command, tmp_path / "a.png")
    assert json.loads(first.stdout)["scene"] == "cornell_box"
    (line,) = first.stderr.splitlines()
    assert line.startswith("compiling kernels for ")
    assert "`ssgi warmup`" in line
    assert succeeds(*command, tmp_path / "a.png").stderr == ""


@pytest.mark.slow
def test_after_it_a_new_process_compiles_nothing_and_the_driver_has_printed_nothing(tmp_path: Path) -> None:
    """With caches of their own; kernels of PoCL are finished when they first run, into files of its cache."""
    folders = {"XDG_CACHE_HOME": "user", "POCL_CACHE_DIR": "pocl", "SSGI_CL_CACHE": "own"}
    environment = {**os.environ, **{name: str(tmp_path / folder) for name, folder in folders.items()}}
    warmed = process("warmup", env=environment)
    assert warmed.returncode == 0
    assert warmed.stderr == ""  # compilers count their warnings there unless they are told not to

    def finished() -> set[Path]:
        return set((tmp_path / "pocl").rglob("*.so"))

    before = finished()
    for scene in ("hall", "street-3"):
        done = process("render", scene, "-o", tmp_path / "a.png", env=environment)
        assert done.returncode == 0
        assert done.stderr == ""
        assert finished() == before
