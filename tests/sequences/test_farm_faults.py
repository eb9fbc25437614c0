"""Workers and schedulers are killed while frames are done: nothing is lost, nothing made twice, and no byte differs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="Dask distributed is not installed (extra 'cluster')")


@pytest.mark.slow
def test_kills_lose_nothing(tmp_path: Path) -> None:
    """The whole of it, with 200 frames, 20 and 5 kills, is that command without options."""
    options = ("--no-times", "--frames", "60", "--width", "64", "--kills", "4", "--scheduler-kills", "2")
    done = subprocess.run(
        [sys.executable, "-m", "ssgi_cl.bench.experiments.farm", *options],
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "workers: 4 of 4 kills while 60 frames were done in 1 calls: 60 done" in done.stdout
    assert "schedulers: 2 kills" in done.stdout
    assert re.findall("(\\d+) results are those of one process", done.stdout) == ["60", "60"]
