"""First compilations: recorded, and announced once with the command that does them beforehand."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from pathlib import Path

import pytest

from ssgi_cl.device import compiled, programs
from ssgi_cl.device.compiled import CompiledRecord
from ssgi_cl.device.runtime import Runtime


def text(number: int) -> str:
    return f"__kernel void nothing(__global float *out) {{ out[0] = {number}.0f; }}"


def digest(number: int) -> str:
    return f"{number:064x}"[::-1]


def test_what_was_compiled_is_known_to_later_processes(tmp_path: Path) -> None:
    record = CompiledRecord(tmp_path / "new folder")
    for number in (1, 2, 1):
        record.add(digest(number))
    assert record.new == 2
    later = CompiledRecord(tmp_path / "new folder")
    assert [later.has(digest(number)) for number in (1, 2, 3)] == [True, True, False]
    later.add(digest(2))
    assert later.new == 0


def test_a_damaged_record_and_a_folder_that_cannot_be_written_do_no_harm(tmp_path: Path) -> None:
    (tmp_path / "compiled.txt").write_bytes(b"\xff\x00 half a li")
    record = CompiledRecord(tmp_path)
    assert not record.has(digest(1))
    record.add(digest(1))
    file = tmp_path / "file"
    file.write_text("")
    lost = CompiledRecord(file)
    lost.add(digest(1))
    assert lost.has(digest(1))
    assert not CompiledRecord(file).has(digest(1))


def test_a_long_record_is_begun_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "MOST_BYTES", 100)
    for number in range(20):
        CompiledRecord(tmp_path).add(digest(number))
    assert (tmp_path / "compiled.txt").stat().st_size < 100 + 2 * (compiled.KEY + 1)
    assert CompiledRecord(tmp_path).has(digest(19))


def test_many_first_compilations_are_announced_once(
    runtime: Runtime, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    caplog.set_level("INFO", logger="ssgi_cl")
    monkeypatch.setattr(programs, "MANY", 6)

    def built(numbers: Iterable[int]) -> list[str]:
        caplog.clear()
        made = programs.Programs(runtime, short_header=runtime.programs.short_header)
        for number in numbers:
            made.kernel_from_text("nothing", text(number))
        return [record.getMessage() for record in caplog.records if record.levelno == logging.INFO]

    few = programs.MANY - 1
    assert built(range(few)) == []
    # These are known now: as many more may follow, and be followed by known ones.
    assert built(range(2 * few)) == []
    assert built([*range(2 * few, 3 * few), *range(2 * few)]) == []
    (line,) = built(range(6 * few))
    assert line.startswith(f"compiling kernels for {runtime.info.label}")
    assert "`ssgi warmup`" in line
    assert "\n" not in line
    assert built(range(6 * few)) == []


def test_a_watcher_is_called_after_each_program_while_it_watches(runtime: Runtime) -> None:
    made = programs.Programs(runtime, short_header=runtime.programs.short_header)
    counted: list[int] = []
    with made.watched(lambda: counted.append(made.builds)):
        for number in (1, 2, 1):
            made.kernel_from_text("nothing", text(number))
    made.kernel_from_text("nothing", text(3))
    assert counted == [1, 2]
