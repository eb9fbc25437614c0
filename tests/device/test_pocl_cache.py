"""Damaged files in PoCL's cache: found, removed, and looked for after a process died."""

from __future__ import annotations

import fcntl
import os
import shutil
import struct
import time
import warnings
from itertools import islice
from pathlib import Path

import pytest

from ssgi_cl.device.drivers import pocl_cache
from ssgi_cl.device.drivers.caches import cache_folder
from ssgi_cl.device.drivers.pocl_cache import clear_damaged, damaged_files, guard, whole_bitcode, whole_library
from ssgi_cl.device.runtime import Runtime

BITCODE = b"BC\xc0\xde" + struct.pack("<II8x", 0b01, 2) + struct.pack("<II4x", 0b01, 1)
"""Two blocks of 2 words and of 1 word."""
LIBRARY = b"\x7fELF\x02" + bytes(0x28 - 5) + struct.pack("<Q10xHH2x", 64, 16, 3) + bytes(48)
"""A header of 64 bytes that tells of 3 sections of 16 bytes behind it."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of PoCL's with a program and two of its kernels; our caches are beside it."""
    folder = tmp_path / "pocl"
    program = folder / "AB" / "CDEF"
    for variant in ("32-1-1", "16-1-1"):
        (program / "ssao" / variant).mkdir(parents=True)
        (program / "ssao" / variant / "ssao.so").write_bytes(LIBRARY)
    (program / "program.bc").write_bytes(BITCODE)
    (program / "last_accessed").touch()
    (folder / "tempfile_x").write_bytes(b"")
    monkeypatch.setenv("POCL_CACHE_DIR", str(folder))
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "ssgi"))
    monkeypatch.setattr(pocl_cache, "_held", {})
    monkeypatch.setattr(pocl_cache, "LOOK_SECONDS", 0.0)  # as if it were large
    return folder


@pytest.mark.parametrize(("whole", "text"), [(whole_bitcode, BITCODE), (whole_library, LIBRARY)])
def test_only_what_reaches_its_end_is_whole(tmp_path: Path, whole, text: bytes) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "a"
    path.write_bytes(text)
    assert whole(path)
    for length in range(len(text)):
        # The two blocks of bitcode are whole files each; a compiler's has three and needs all.
        path.write_bytes(text[:length])
        assert not whole(path) or (whole is whole_bitcode and length == 4 + 16), length
    path.write_bytes(bytes(len(text)))  # what a power cut leaves of a file that was not written yet
    assert not whole(path)


def test_files_of_a_real_cache_are_whole(runtime: Runtime) -> None:
    if "PoCL" not in runtime.info.label:
        pytest.skip("the device under test is not PoCL's")
    runtime.kernel("probe/probe_gather.cl")
    programs = list(islice(pocl_cache.pocl_folder().glob("*/*/program.bc"), 50))
    kernels = [path for program in programs for path in program.parent.glob("*/*/*.so")]
    assert programs
    assert all(map(whole_bitcode, programs))
    assert all(map(whole_library, kernels))


def test_damaged_kernels_and_programs_are_removed_and_said(folder: Path) -> None:
    assert clear_damaged() == []
    kernel = folder / "AB" / "CDEF" / "ssao" / "32-1-1" / "ssao.so"
    kernel.write_bytes(LIBRARY[:70])
    with pytest.warns(RuntimeWarning, match=r"1 truncated file.*removed: AB/CDEF/ssao/32-1-1/ssa"):
        assert clear_damaged() == [kernel]
    assert not kernel.exists()
    assert (folder / "AB" / "CDEF" / "ssao" / "16-1-1" / "ssao.so").exists()
    program = folder / "AB" / "CDEF" / "program.bc"
    program.write_bytes(b"")
    with pytest.warns(RuntimeWarning, match="truncated"):
        assert clear_damaged() == [program]
    assert not program.parent.exists()  # what was made of it goes too
    assert clear_damaged() == []
    assert (folder / "tempfile_x").exists()


def test_kernels_that_were_not_used_since_are_not_looked_at(folder: Path) -> None:
    (folder / "AB" / "CDEF" / "ssao" / "32-1-1" / "ssao.so").write_bytes(b"")
    now = time.time()
    os.utime(folder / "AB" / "CDEF" / "last_accessed", (now - 60, now - 60))
    assert list(damaged_files(folder, since=now - 30)) == []
    assert len(list(damaged_files(folder, since=now - 90))) == 1
    assert clear_damaged(since=now - 30) == []
    (folder / "AB" / "CDEF" / "program.bc").write_bytes(b"")  # something is wrong: all is looked at
    (folder / "IJ" / "KLMN" / "gtao" / "32-1-1").mkdir(parents=True)
    (folder / "IJ" / "KLMN" / "program.bc").write_bytes(BITCODE)
    (folder / "IJ" / "KLMN" / "gtao" / "32-1-1" / "gtao.so").write_bytes(b"")
    with pytest.warns(RuntimeWarning, match="2 truncated files"):
        assert len(clear_damaged(since=now - 30)) == 2


def test_a_cache_of_usual_size_is_looked_through_by_every_process(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel = folder / "AB" / "CDEF" / "ssao" / "32-1-1" / "ssao.so"
    kernel.write_bytes(b"")
    monkeypatch.setattr(pocl_cache, "LOOK_SECONDS", 60.0)
    with pytest.warns(RuntimeWarning, match="1 truncated file"):
        guard()
    assert not kernel.exists()


def mark_of_another(folder: Path) -> Path:
    """Return the mark of a process that uses PoCL; locked by nobody it is that of a dead one."""
    mark = cache_folder() / f"{pocl_cache._prefix(folder)}4000000"
    mark.parent.mkdir(exist_ok=True)
    mark.touch()
    return mark


def silently_guarded() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        guard()


def test_after_a_process_that_died_the_cache_is_looked_through(folder: Path) -> None:
    kernel = folder / "AB" / "CDEF" / "ssao" / "32-1-1" / "ssao.so"
    kernel.write_bytes(b"")
    silently_guarded()  # nobody died
    (own,) = pocl_cache._held
    mark = mark_of_another(folder)
    with pytest.warns(RuntimeWarning, match="truncated"):
        guard()
    assert not kernel.exists()
    assert not mark.exists()
    assert own.exists()
    silently_guarded()


def test_a_mark_of_a_living_process_stays(folder: Path) -> None:
    (folder / "AB" / "CDEF" / "program.bc").write_bytes(b"")
    mark = mark_of_another(folder)
    with mark.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        silently_guarded()
        assert mark.exists()


def test_a_process_that_ends_in_order_leaves_no_mark(folder: Path) -> None:
    guard()
    (mark,) = pocl_cache._held
    pocl_cache._unmark(mark, os.getpid() + 1)  # a fork that ends
    assert mark.exists()
    pocl_cache._unmark(mark, os.getpid())
    assert not mark.exists()


def test_a_cache_that_cannot_be_written_is_no_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", "/proc/nowhere")
    guard()
    assert pocl_cache._held == {}
    shutil.rmtree(folder)
    assert clear_damaged() == []
