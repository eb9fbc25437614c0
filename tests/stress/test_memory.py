"""Every kernel under oclgrind: no race, nothing read or written outside its memory or before it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ssgi_cl.device.drivers import KERNEL_VARIANTS, KernelVariant

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


@pytest.mark.slow
@pytest.mark.parametrize("variant", KERNEL_VARIANTS, ids=str)
def test_no_kernel_races_or_strays(variant: KernelVariant, tmp_path: Path) -> None:
    oclgrind = shutil.which("oclgrind")
    if oclgrind is None:
        pytest.skip("oclgrind is not installed")
    log = tmp_path / "oclgrind.log"
    # It takes the halves of a vector for uninitialised where they are compared, even of memory that
    # was cleared, and all that is copied to an image; 1 lane on buffers reads the same.
    initialised = ["--uninitialized"] if variant == KernelVariant(1, "buffer") else []
    options = ["--data-races", *initialised, "--max-errors", "100000", "--build-options", OPTIONS, "--log", str(log)]
    script = [sys.executable, "-m", "ssgi_cl.bench.every", str(variant.lanes), variant.storage]
    # A program that was compiled before would not be with these options.
    variables = {**os.environ, "PYOPENCL_NO_CACHE": "1"}
    done = subprocess.run([oclgrind, *options, *script], env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    text = log.read_text() if log.exists() else ""
    assert findings(text) <= KNOWN, text[:4000]
