"""Hostile input: command lines, changed arrays, scenes of any scale, windows of OpenEXR files."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import json
import os
import pickle
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from click.testing import CliRunner
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.io import exr
from ssgi_cl.io.exr_header import read_header
from ssgi_cl.rasterize.scenes import make_scene

from .command_lines import line, make_files

Run = Callable[[list[str]], tuple[int, str, str]]
"""Runs a command line; returns exit status, standard output and standard error."""

LINES, PROCESSES = 200, 6
"""Command lines in this process, and in processes of their own."""
PATIENCE = 60
"""Seconds that a command line may take."""
SCALES, WINDOWS, COPIES = 12, 30, 200


def command_lines(seed: int) -> None:
    """Random command lines in this process."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as name, chdir(name):
        names = make_files(Path(name), rng)
        for number in range(LINES):
            arguments = line(rng, names)
            _holds(f"{number}: {_shown(arguments)}", arguments, _in_process)


def command_processes(seed: int) -> None:
    """Random command lines in processes of their own."""
    rng = Random(seed + 1)
    with tempfile.TemporaryDirectory() as name, chdir(name):
        names = make_files(Path(name), rng)
        for number in range(PROCESSES):
            arguments = line(rng, names)
            _holds(f"{number}: {_shown(arguments)}", arguments, _as_process)


def _shown(arguments: list[str]) -> str:
    text = shlex.join(one if len(one) < 60 else f"{one[:50]}...({len(one)})" for one in arguments)
    return text.encode("utf-8", "backslashreplace").decode()


def _holds(what: str, arguments: list[str], run: Run) -> None:
    """Run a command line; raise unless it ends well, or with a message and nothing half done."""
    before = _digests()
    start = time.monotonic()
    status, out, errors = run(arguments)
    _expect(time.monotonic() - start < PATIENCE, f"{what}: it took too long")
    _expect(status in (0, 1, 2), f"{what}: exit status {status}: {errors[-2000:]}")
    _expect("Traceback" not in out + errors, f"{what}: {errors[-2000:]}")
    if status:
        said = "Error" in errors or "Usage" in out + errors
        _expect(said, f"{what}: status {status} without a message")
    elif "--json" in arguments and arguments[0] != "bench":
        json.loads(out)
    after = _digests()
    changed = {name for name in {*before, *after} if before.get(name) != after.get(name)}
    paths = [value for value in arguments if len(value) < 250]
    outputs = {os.path.basename(name) for name in (*paths, *map(os.path.realpath, paths))}
    _expect(not status or not changed, f"{what}: it failed and changed {changed}")
    _expect(changed <= outputs, f"{what}: it changed {changed}")
    for name in changed:
        _whole(Path(name))
        if name.startswith("new."):
            os.remove(name)


def _expect(holds: bool, message: str) -> None:
    if not holds:
        raise AssertionError(message)


def _digests() -> dict[str, str]:
    """Return what the files of the working folder hold, temporary ones too."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in Path().iterdir()
        if path.is_file() and not path.is_symlink()
    }


def _whole(path: Path) -> None:
    """Raise unless a picture can be read."""
    if path.suffix.lower() == ".exr":
        exr.read(path)
    else:
        with Image.open(path) as picture:
            picture.load()


def _in_process(arguments: list[str]) -> tuple[int, str, str]:
    def late(*_: object) -> None:
        raise AssertionError(f"it took more than {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(PATIENCE)
    try:
        result = CliRunner().invoke(main, arguments)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise AssertionError(_shown(arguments)) from result.exception
    return result.exit_code, result.stdout, result.stderr


def _as_process(arguments: list[str]) -> tuple[int, str, str]:
    done = subprocess.run(
        [sys.executable, "-m", "ssgi_cl.cli.command", *arguments],
        capture_output=True,
        text=True,
        errors="replace",
        timeout=PATIENCE,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    return done.returncode, done.stdout, done.stderr


def changed_arrays(seed: int) -> None:
    """No array of what is cached by identity can be written to, however it was copied."""
    rng = Random(seed)
    box = make_scene("cornell_box")
    camera = gi.Camera.look_at(box.eye, box.target, box.up, yfov=box.yfov, width=16, height=12)
    lights = (
        gi.PointLight((0, 1, 0), 1.0),
        gi.SpotLight((0, 1, 0), (0, -1, 0), 0.5, 1.0),
        gi.DirectionalLight((0, -1, 0), 1.0),
        gi.Environment(np.ones((2, 4, 3))),
    )
    copies: tuple[Callable[[Any], Any], ...] = (
        copy.copy,
        copy.deepcopy,
        dataclasses.replace,
        lambda made: pickle.loads(pickle.dumps(made)),
    )
    for _ in range(COPIES):
        rsm = gi.rasterize.rsm(box.scene, lights[1], size=8)
        made = rng.choice((box.scene, camera, rsm, *lights))
        for _ in range(rng.randrange(4)):
            made = rng.choice(copies)(made)
        for field in dataclasses.fields(made):
            value = getattr(made, field.name)
            if not isinstance(value, np.ndarray):
                continue
            try:
                value[...] = 0
            except ValueError:
                continue
            raise AssertionError(f"{type(made).__name__}.{field.name} can be written to")


def scales(seed: int) -> None:
    """A scene of any scale gives the light of the same scene at scale 1, or is refused."""
    rng = Random(seed)
    techniques = {"multires_splat": {"vpls": 64}, "vpl_splat": {"vpls": 64}, "rsm_gather": {}, "gtao": {}}
    right: dict[str, Any] = {}
    for number in range(SCALES):
        scale = 2.0 ** (rng.randrange(-90, 90) if number else 0)
        for name, options in techniques.items():
            try:
                found = _at_scale(name, scale, options)
            except ValueError as error:
                if "scene units" not in str(error) and "flux" not in str(error):
                    raise
                continue
            expected = right.setdefault(name, found)
            # Powers of two change no digit, but where limits of float32 are near.
            off = float(np.abs(found - expected).mean())
            _expect(off < 0.02 * float(expected.mean()), f"{name} at scale {scale:g}: {off:g}")


def _at_scale(name: str, scale: float, options: dict[str, Any]) -> Any:
    box = make_scene("cornell_box")
    scene = dataclasses.replace(
        box.scene,
        origin=box.scene.origin * scale,
        positions=(box.scene.positions.astype(np.float64) * scale).astype(np.float32),
    )
    camera = gi.Camera.look_at(
        np.multiply(box.eye, scale), np.multiply(box.target, scale), box.up, yfov=box.yfov, width=48, height=36
    )
    gbuffer = gi.rasterize.gbuffer(scene, camera)
    if name == "gtao":
        return gi.gtao(gbuffer, radius=0.1 * scale)
    if "splat" in name:
        options = {**options, "unit_distance": scale}
    sun = gi.DirectionalLight((0.1, -0.3, 1.0), 5.0)
    return getattr(gi, name)(gbuffer, gi.rasterize.rsm(scene, sun, size=32), **options)


def windows(seed: int) -> None:
    """Whatever the windows of a file are, they survive, and the camera is the display window's."""
    rng, random = Random(seed), np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as name:
        source, output = Path(name) / "in.exr", Path(name) / "out.exr"
        for _ in range(WINDOWS):
            left, top, width, height = (rng.randrange(*ends) for ends in ((-99, 99), (-99, 99), (1, 40), (1, 40)))
            data = (left, top, left + width - 1, top + height - 1)
            x, y = left + rng.randrange(-20, 20), top + rng.randrange(-20, 20)
            display = (x, y, x + rng.randrange(60), y + rng.randrange(60))
            depth = random.uniform(1.0, 1.2, (height, width)).astype(np.float32)
            exr.write(source, {"depth": depth}, data=data, display=display)
            result = CliRunner().invoke(main, ["apply", "ssao", str(source), "--fov", "60", "-o", str(output)])
            _expect(result.exit_code == 0, f"{data}, {display}: {result.output}")
            header = read_header(output)
            _expect((header.data, header.display) == (data, display), f"{header}")
            camera = gi.Camera.look_at(
                (0, 0, 0), (0, 0, -1), yfov=np.radians(60.0), width=display[2] - x + 1, height=display[3] - y + 1
            ).cropped(left - x, top - y, width, height)
            expected = gi.ssao(gi.GBuffer(camera=camera, depth=depth))
            np.testing.assert_array_equal(exr.read(output)["ao"], expected, f"{data}, {display}")


CASES: dict[str, Callable[[int], None]] = {
    "command_lines": command_lines,
    "command_processes": command_processes,
    "changed_arrays": changed_arrays,
    "scales": scales,
    "windows": windows,
}
