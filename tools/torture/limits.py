"""Processes that are killed at random times, or have little memory or room for files."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.io import exr
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

PROGRAM = Path(__file__).parents[2] / "ssgi_cl" / "__main__.py"
"""Start of the program `ssgi`."""
KILLS = 12
LONGEST = 2.0
"""Seconds after which a command is killed at the latest."""
RENDER = ["render", "cornell_box", "--width", "320", "--height", "240"]


def _ssgi(folder: Path, *arguments: str, limits: Callable[[], None] | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(PROGRAM), *arguments],
        cwd=folder,
        text=True,
        errors="replace",
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        preexec_fn=limits,
    )


def kills(seed: int) -> None:
    """A picture is whole or absent whenever its process is killed."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        picture = folder / "box.exr"
        for _ in range(KILLS):
            process = _ssgi(folder, *RENDER, "--output", picture.name)
            with suppress(subprocess.TimeoutExpired):
                process.wait(rng.random() * LONGEST)
            process.send_signal(signal.SIGKILL)
            process.communicate()
            if picture.exists():
                channels = exr.read(picture)  # refuses what is cut short
                assert all(values.shape == (240, 320) for values in channels.values())
                picture.unlink()
        done = _ssgi(folder, *RENDER, "--output", picture.name)
        said, _ = done.communicate(timeout=120)
        assert done.returncode == 0, said
        left = sorted(path.name for path in folder.iterdir())
        assert left == [picture.name], f"files of killed processes are left: {left}"


def interrupts(seed: int) -> None:
    """Ctrl-C ends a command at any time, while modules are imported too, without a traceback."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        for _ in range(KILLS):
            process = _ssgi(Path(name), *RENDER, "--output", "box.png")
            time.sleep(0.1 + rng.random() * 1.5)
            process.send_signal(signal.SIGINT)
            said, _ = process.communicate(timeout=60)
            assert "Traceback" not in said, said
            assert process.returncode != 1 or "rror" in said or "Aborted!" in said, said


def address_space(seed: int) -> None:
    """Little memory ends in an error, or in a picture."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name:
        for _ in range(6):
            size = int(rng.uniform(1.0, 6.0) * 2**30)
            process = _ssgi(
                Path(name),
                "render",
                "cornell_box",
                "--width",
                "4096",
                "--height",
                "4096",
                "--output",
                "box.png",
                limits=lambda size=size: resource.setrlimit(resource.RLIMIT_AS, (size, size)),
            )
            said, _ = process.communicate(timeout=200)
            assert "Traceback" not in said, f"{size / 2**30:.2f} GiB: {said}"
            assert process.returncode in (0, 1, 2), f"{size / 2**30:.2f} GiB: {said}"


def file_size(seed: int) -> None:
    """A file that can't be written whole is not there, and the message names it."""
    size = Random(seed).randrange(1 << 20, 2 << 20)  # enough for a driver's files

    def limits() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    with tempfile.TemporaryDirectory() as name:
        process = _ssgi(
            Path(name),
            "render",
            "cornell_box",
            "--width",
            "1024",
            "--height",
            "768",
            "--output",
            "box.exr",
            limits=limits,
        )
        said, _ = process.communicate(timeout=120)
        assert process.returncode == 1, said
        assert "box.exr" in said, said
        assert "Traceback" not in said, said
        assert not os.listdir(name), os.listdir(name)


def memory(seed: int) -> None:
    """New radii, sizes, scenes and lights each frame: memory stays within its bound."""
    rng = Random(seed)
    box = BUILTIN_SCENES["cornell_box"]()
    runtime = gi.Runtime.open()
    runtime.memory.keep = 64 << 20
    modes = ("multires", "vpl", "gather", "ssdo", None)
    for _ in range(200):
        width, height = rng.randrange(16, 320), rng.randrange(16, 240)
        scene = BUILTIN_SCENES["cornell_box"]().scene if rng.random() < 0.3 else box.scene
        lights = [gi.PointLight((rng.random(), 1.0, rng.random()), (1.0, 1.0, 1.0)) for _ in range(rng.randrange(1, 4))]
        gi.render(
            scene,
            box.camera(width, height),
            lights,
            ao_radius=0.1 + rng.random(),
            indirect=rng.choice(modes),
            vpls=64,
            shadow_size=rng.choice((16, 64, 128)),
            rsm_size=64,
        )
        # What the latest call uses is never let go.
        assert runtime.memory.kept < 256 << 20, runtime.memory
    many = [gi.PointLight((0.0, 1.0, 0.001 * i), (1.0, 1.0, 1.0)) for i in range(1000)]
    start = time.monotonic()
    runtime.memory.limit = runtime.memory.used + (1 << 30)
    try:
        gi.render(box.scene, box.camera(64, 48), many, bounces=0, shadow_size=1024)
    except DeviceMemoryError as error:
        assert "6000 shadow maps" in str(error), error
    else:
        raise AssertionError("1000 point lights are not refused")
    assert time.monotonic() - start < 2.0, "the refusal is slow"
    gi.render(box.scene, box.camera(64, 48), many[:1], bounces=0, shadow_size=1024)


CASES: dict[str, Callable[[int], None]] = {
    "kills": kills,
    "interrupts": interrupts,
    "address_space": address_space,
    "file_size": file_size,
    "memory": memory,
}
