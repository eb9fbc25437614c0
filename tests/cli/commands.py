"""Commands of `ssgi` as tests run them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner, Result

from ssgi_cl.cli.command import main
from ssgi_cl.core.camera import Camera
from ssgi_cl.io import exr

SMALL = ("--width", "64", "--height", "48", "--shadow-size", "64")
SHAPE = (48, 64)
DIRECT = (*SMALL, "--bounces", 0)
"""For tests of what no bounced light changes."""
CAMERAS = {
    "--fov 40": Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(40.0), width=64, height=48),
    "--ortho 3": Camera.orthographic((0, 0, 0), (0, 0, -1), view_height=3.0, width=64, height=48),
    "--intrinsics 70 72 30 25": Camera.from_intrinsics(70, 72, 30, 25, width=64, height=48),
    "": Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(50.0), width=64, height=48),
}
"""What options of `ssgi apply` say of a file of that size."""


def ssgi(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def succeeds(*arguments: object) -> Result:
    result = ssgi(*arguments)
    assert result.exit_code == 0, result.output
    return result


def answer(*arguments: object) -> Any:
    """What a command with --json prints; nothing but JSON on standard output, nothing else."""
    result = succeeds(*arguments, "--json")
    assert result.stderr == ""
    return json.loads(result.stdout)


def process(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """The finished process of a command."""
    return subprocess.run(
        [sys.executable, "-m", "ssgi_cl.cli.command", *map(os.fspath, arguments)],  # type: ignore[call-overload]
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **options,
    )


def fails(folder: Path, *arguments: object) -> str:
    """The message of a command that has to fail; no new file may be left in `folder`."""
    before = sorted(folder.rglob("*"))
    result = ssgi(*arguments)
    assert result.exit_code in (1, 2), result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert sorted(folder.rglob("*")) == before, "it left a file"
    lines = result.stderr.strip().splitlines()
    errors = [line for line in lines if line.startswith("Error: ")]
    assert len(errors) == 1
    # A misused option adds click's usage lines above; the message itself is the last line.
    assert lines[-1] == errors[0]
    assert len(lines) == 1 or (lines[0].startswith("Usage: ") and result.exit_code == 2)
    return errors[0].removeprefix("Error: ")


def applied(source: Path, *arguments: object) -> np.ndarray[Any, Any]:
    output = source.with_name("ao.exr")
    succeeds("apply", "ssao", source, "-o", output, *arguments)
    channels = exr.read(output)
    assert set(channels) == {"ao"}
    return channels["ao"]
