"""Every kernel under oclgrind: no race, nothing read or written outside its memory or before it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from ssgi_cl.device.drivers import KERNEL_VARIANTS, KernelVariant

from .every_by_kernels import COPY

OPTIONS = "-O0 -Dalways_inline=unused -D__has_builtin(x)=0"
"""oclgrind knows neither what LLVM notes about arguments of functions that it inlines, nor minima
of vectors."""

KNOWN = {
    # A flag that only ever gets one value in a launch; looked at first to spare the exchange.
    ("Read-write data race", "rsm_face"),
    # Bits that are only ever set, looked at first for the same reason.
    ("Read-write data race", "occupancy_pixels"),
    ("Read-write data race", "occupancy_voxelize"),
    # Lanes outside the image read and write the guard, which is 0 and gets 0.
    ("Read-write data race", "vpl_interleaved"),
}


def findings(log: str) -> set[tuple[str, str]]:
    """Return (what, kernel) of each complaint."""
    return set(re.findall(r"^(\S.*?)(?: at .*)?\n\tKernel: (\w+)", log, flags=re.MULTILINE))


HERE = Path(__file__).parent
UNINITIALISED = re.compile(r"[Uu]ninitialized")


def simulated(script: Sequence[str], options: Sequence[str], log: Path) -> str:
    """Run Python in oclgrind, and return its log."""
    oclgrind = shutil.which("oclgrind")
    if oclgrind is None:
        pytest.skip("oclgrind is not installed")
    options = [*options, "--max-errors", "100000", "--build-options", OPTIONS, "--log", str(log)]
    # A program that was compiled before would not be with these options.
    variables = {**os.environ, "PYOPENCL_NO_CACHE": "1"}
    command = [oclgrind, *options, sys.executable, *script]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return log.read_text() if log.exists() else ""


@pytest.mark.slow
@pytest.mark.parametrize("variant", KERNEL_VARIANTS, ids=str)
def test_no_kernel_races_or_strays(variant: KernelVariant, tmp_path: Path) -> None:
    arguments = [str(variant.lanes), variant.storage]
    text = simulated(["-m", "ssgi_cl.bench.every", *arguments], ["--data-races"], tmp_path / "oclgrind.log")
    assert findings(text) <= KNOWN, text[:4000]


@pytest.mark.slow
def test_no_kernel_depends_on_memory_that_nothing_wrote(tmp_path: Path) -> None:
    # The simulator takes the halves of a vector for uninitialised where they are compared, even of memory that was
    # cleared, and all that is copied to an image; 1 lane on buffers reads the same.
    script = [str(HERE / "every_by_kernels.py"), "1", "buffer"]
    text = simulated(script, ["--uninitialized"], tmp_path / "oclgrind.log")
    found = {finding for finding in findings(text) if finding[1] != COPY}
    assert not found, text[:4000]


@pytest.mark.slow
@pytest.mark.parametrize("case", ["never", "beside a fill", "beside a copy"])
@pytest.mark.parametrize("by_kernels", [False, True], ids=["by the host", "by kernels"])
def test_what_the_simulator_takes_for_uninitialised(case: str, by_kernels: bool, tmp_path: Path) -> None:
    """Why the search has kernels write what the host does, and that it still finds what nothing wrote."""
    script = [str(HERE / "written_in_part.py"), case, *(["by kernels"] if by_kernels else [])]
    found = findings(simulated(script, ["--uninitialized"], tmp_path / "oclgrind.log"))
    assert {kernel for what, kernel in found if UNINITIALISED.search(what)} == (
        {"look"} if case == "never" or not by_kernels else set()
    )
