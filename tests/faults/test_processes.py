"""Several processes, threads and runtimes at once; processes that are killed; missing drivers."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from ssgi_cl.cli import command
from ssgi_cl.core import atomic
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import drivers, probe, sources
from ssgi_cl.device.drivers import probing
from ssgi_cl.device.drivers.info import DeviceInfo, Found
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr

from .computing import added, digest

SCRIPT = Path(__file__).with_name("computing.py")
NOWHERE = "/proc/nowhere"
"""A folder in which nobody can make a file, whoever runs the tests."""


def process(*arguments: str, folder: Path, **variables: str) -> subprocess.Popen[str]:
    """Start the script; devices need not be timed again."""
    known = folder / "ssgi"
    if not known.exists():
        shutil.copytree(drivers.cache_folder(), known, ignore=shutil.ignore_patterns("truth*"))
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), *arguments],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "SSGI_CL_CACHE": str(known), **variables},
    )


def answer(started: subprocess.Popen[str]) -> str:
    """Return what the script printed at its end."""
    out, errors = started.communicate(timeout=300)
    assert started.returncode == 0, errors
    return out.strip()


def killed(started: subprocess.Popen[str], after: float) -> None:
    """Kill the script some seconds after it said that it is at work."""
    assert started.stdout is not None
    assert started.stdout.readline()
    time.sleep(after)
    started.send_signal(signal.SIGKILL)
    started.communicate()


def caches(folder: Path) -> dict[str, str]:
    """Return variables that give the compilers an empty cache in `folder`."""
    return {"POCL_CACHE_DIR": str(folder / "pocl"), "XDG_CACHE_HOME": str(folder / "home")}


@pytest.mark.slow
def test_two_processes_share_an_empty_program_cache(runtime: Runtime, tmp_path: Path) -> None:
    both = [process(folder=tmp_path, **caches(tmp_path)) for _ in range(2)]
    assert {answer(one) for one in both} == {f"{digest(runtime)} 8.0"}


@pytest.mark.slow
def test_a_process_killed_while_it_compiles_leaves_a_cache_that_works(runtime: Runtime, tmp_path: Path) -> None:
    for after in (0.05, 0.4, 1.0):
        killed(process("compute", folder=tmp_path, **caches(tmp_path)), after)
    assert answer(process(folder=tmp_path, **caches(tmp_path))) == f"{digest(runtime)} 8.0"


def test_a_process_killed_while_it_writes_leaves_whole_files(tmp_path: Path) -> None:
    for after in (0.1, 0.23):
        killed(process("write", folder=tmp_path), after)
        with Image.open(tmp_path / "a.png") as picture:
            assert len(set(np.asarray(picture).ravel())) == 1
        assert len(set(exr.read(tmp_path / "a.exr")["Z"].ravel())) == 1


def test_what_a_killed_process_leaves_goes_with_the_next_write(tmp_path: Path) -> None:
    left = tmp_path / ".ssgi-0.tmp"
    left.write_bytes(b"of a process that was killed")
    with atomic.replacement(tmp_path / "a") as first:
        assert not left.exists()
        with atomic.replacement(tmp_path / "b") as second:
            assert first.exists()  # whoever writes lives
            second.write_bytes(b"b")
        first.write_bytes(b"a")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"a", "b": b"b"}


def test_a_folder_is_looked_through_once_a_minute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = tmp_path / ".ssgi-0.tmp"
    now = [1000.0]
    monkeypatch.setattr(atomic.time, "monotonic", lambda: now[0])
    for seconds, is_there in ((0.0, False), (59.0, True), (1.5, False)):
        left.touch()
        now[0] += seconds
        with atomic.replacement(tmp_path / "a"):
            assert left.exists() == is_there


def test_records_of_devices_are_whole_whoever_writes_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    info = DeviceInfo("x", 0, 0, "x" * 10**5, "cpu", 2, {"1 lane, buffer": 1.0})
    monkeypatch.setattr(probing, "probe", lambda driver: Found([info]))
    driver = tmp_path / "x.icd"
    driver.write_text("x")
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: drivers._looked_at(driver).devices, range(64)))
    assert all(one == [info] for one in found)
    assert len(list(tmp_path.glob("*.tmp"))) == 0


@pytest.mark.slow
def test_threads_with_a_runtime_each_find_the_same(runtime: Runtime) -> None:
    results: list[str] = []

    def work(lanes: int) -> None:
        own = Runtime(runtime.info, drivers.KernelVariant(lanes, "buffer"))
        results.extend(digest(own) for _ in range(3))

    lanes = [
        variant.lanes
        for variant in drivers.KERNEL_VARIANTS
        if variant.storage == "buffer" and isinstance(runtime.info.speeds[str(variant)], float)
    ]
    threads = [threading.Thread(target=work, args=(count,)) for count in (*lanes, lanes[-1])]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # The forms give bit-identical results.
    assert results == [digest(runtime)] * (3 * len(threads))


def test_threads_that_take_turns_may_share_a_runtime(runtime: Runtime) -> None:
    turn = threading.Lock()

    def work(term: int) -> float:
        with turn:
            return added(runtime, term % 3)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(24))) == [1.0 + term % 3 for term in range(24)]


def test_without_opencl_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    monkeypatch.setattr(drivers, "devices", drivers.devices.__wrapped__)
    with pytest.raises(DeviceError, match=r"Devices found:\n  none\nInstall a driver"):
        Runtime.open("any")
    result = CliRunner().invoke(command.main, ["devices"])
    assert result.exit_code == 1
    assert "no OpenCL device found. Install a driver" in result.output


def test_a_driver_that_cannot_be_loaded_is_passed_over(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "broken.icd").write_text("/nowhere/libbroken.so\n")
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path / "cache"))
    assert drivers.devices.__wrapped__() == ()


def test_a_lane_width_that_does_not_build_is_passed_over_and_said(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flatten, refuse = sources.flatten, "\n#if SSGI_LANES == 16\n#error too wide\n#endif\n"
    monkeypatch.setattr(sources, "flatten", lambda *given: flatten(*given) + refuse)
    monkeypatch.setattr(probe, "REPEATS", 1)
    own = runtime.info
    probe.time_variants(own.platform, own.device, ["8 lanes, buffer", "16 lanes, buffer"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    speeds = {line["variant"]: line["speed"] for line in lines}
    info = DeviceInfo("", 0, 0, "Test 1", "cpu", 2, speeds)
    monkeypatch.setattr(drivers, "devices", lambda: (info,))
    assert info.best is not None
    assert info.best.lanes == 8
    with pytest.raises(DeviceError, match="cannot run 16 lanes, buffer: kernels/probe"):
        Runtime.open("test", lanes=16)
    result = CliRunner().invoke(command.main, ["devices"])
    assert " ".join(result.output.split()).count("does not compile") == 1


@pytest.mark.slow
def test_a_read_only_home_costs_time_but_nothing_else(runtime: Runtime, tmp_path: Path) -> None:
    started = process(folder=tmp_path, SSGI_CL_CACHE=NOWHERE, XDG_CACHE_HOME=NOWHERE, POCL_CACHE_DIR=f"{NOWHERE}/pocl")
    assert answer(started) == f"{digest(runtime)} 8.0"
