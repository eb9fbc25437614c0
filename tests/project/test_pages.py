"""Every code block of every page is run: Python as it stands, one page after the other; command lines as far as said.

Commands of the pages in `RUN` run too. Of other pages they are parsed, with all their options and choices. Blocks
with a name after the language are those of docs/arrays.md, which `tests/project/test_arrays_page.py` runs.
"""

from __future__ import annotations

import importlib.util
import math
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.cli.command import main as ssgi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.rasterize.scenes.builtin import BuiltinScene

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```([\w{}-]*)([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def pages() -> Iterator[tuple[str, str]]:
    paths = (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "kernels/README.md")
    for path in sorted(paths):
        if not {"generated", "_build"} & set(path.relative_to(ROOT).parts):
            yield path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")


def blocks(language: str) -> dict[str, list[str]]:
    """Page -> its blocks of a language that have no name."""
    found = {
        name: [b for kind, rest, b in BLOCK.findall(text) if kind == language and not rest] for name, text in pages()
    }
    return {name: each for name, each in found.items() if each}


# ---- Python

PYTHON = blocks("python")
ELSEWHERE = {"README.md": "test_prose.py"}
"""Pages whose blocks another test runs."""


def room(width: int = 320, height: int = 240) -> tuple[BuiltinScene, gi.Camera, gi.GBuffer]:
    built = cornell_box()
    camera = built.camera(width, height)
    return built, camera, gi.rasterize.gbuffer(built.scene, camera)


def shot(path: Path, width: int = 320, height: int = 240) -> None:
    room(width, height)[2].save(path)


def write_mesh(path: Path) -> None:
    import trimesh

    trimesh.creation.box((4, 3, 4)).export(path)


def guide(folder: Path) -> dict[str, Any]:
    gbuffer = room(800, 600)[2]
    gbuffer.save(folder / "shot.exr")
    write_mesh(folder / "room.glb")
    arrays = {name: getattr(gbuffer, name) for name in ("depth", "normal", "albedo")}
    arrays["depth"] = np.minimum(arrays["depth"], np.float32(10.0))
    return arrays


def choosing(folder: Path) -> dict[str, Any]:
    built, camera, gbuffer = room()
    return {"gbuffer": gbuffer, "radius": 0.1, "scene": built.scene, "camera": camera}


def measuring(folder: Path) -> dict[str, Any]:
    built, camera, gbuffer = room(96, 72)
    sun = gi.SpotLight((0.278, 0.5, 0.28), (0, -1, 0), 1.0, 1.0)
    ao = gi.gtao(gbuffer, radius=0.5)
    return {"scene": built.scene, "camera": camera, "gbuffer": gbuffer, "sun": sun, "ao": ao}


def sensor(folder: Path) -> dict[str, Any]:
    depth = np.full((48, 64), 2000, np.uint16)
    depth[12:36, 16:48] = 1500
    return {"measured": depth, "K": (60.0, 60.0, 31.5, 23.5)}


def predicted(folder: Path) -> dict[str, Any]:
    return {"predicted": sensor(folder)["measured"] * np.float32(1e-3)}


def passes(folder: Path) -> dict[str, Any]:
    shot(folder / "shot.exr")
    return {}


def sequence(folder: Path) -> dict[str, Any]:
    paths = [folder / f"shot.{number:04d}.exr" for number in (1, 2)]
    for path in paths:
        shot(path, 64, 48)
    return {"paths": paths}


def drawn_room(folder: Path) -> dict[str, Any]:
    return {"room": cornell_box()}


def seen(folder: Path) -> dict[str, Any]:
    pytest.importorskip("viser")
    built, camera, _ = room(64, 48)
    return {"scene": built.scene, "camera": camera, "lights": built.own_lights}


def nothing(folder: Path) -> dict[str, Any]:
    return {}


PREPARED: dict[str, Callable[[Path], dict[str, Any]]] = {
    "docs/guide.md": guide,
    "docs/choosing.md": choosing,
    "docs/results.md": measuring,
    "docs/measuring.md": measuring,
    "docs/gpus.md": choosing,
    "docs/depth-camera.md": sensor,
    "docs/predicted-depth.md": predicted,
    "docs/blender.md": passes,
    "docs/start/passes.md": passes,
    "docs/sequences.md": sequence,
    "docs/start/mesh.md": nothing,
    "docs/start/methods.md": nothing,
    "docs/conventions.md": nothing,
    "docs/large_images.md": nothing,
    "docs/light.md": nothing,
    "docs/motion.md": nothing,
    "docs/techniques/accumulate.md": drawn_room,
    "docs/techniques/bitmask_ao.md": choosing,
    "docs/window.md": seen,
    "docs/versions.md": nothing,
    "CONTRIBUTING.md": nothing,
}
"""What the reader of a page has: the names that its blocks take for granted, and files in the folder."""

SAID = {"gi": gi, "np": np, "math": math, "Image": Image}


@pytest.mark.parametrize("name", sorted(PYTHON.keys() - ELSEWHERE))
@pytest.mark.filterwarnings("ignore::ssgi_cl.core.errors.AssumedWarning")
def test_the_python_of_a_page_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "truth." in "".join(PYTHON[name]):
        pytest.importorskip("mitsuba")
        pytest.importorskip("embreex")
    monkeypatch.chdir(tmp_path)
    names = {**SAID, "__name__": "page", **PREPARED[name](tmp_path)}
    for number, block in enumerate(PYTHON[name], 1):
        exec(compile(block, f"{name}, block {number}", "exec"), names)


def test_the_example_of_a_projection_says_what_it_prints(capsys: pytest.CaptureFixture[str]) -> None:
    exec(PYTHON["docs/conventions.md"][0], dict(SAID))
    assert capsys.readouterr().out.split() == ["200.0", "150.0"]


# ---- OpenCL C


@pytest.mark.parametrize("name", sorted(blocks("c")))
def test_the_kernels_of_a_page_compile(name: str, runtime: Runtime) -> None:
    for block in blocks("c")[name]:
        (entry,) = re.findall(r"__kernel void (\w+)", block)
        assert runtime.kernel_from_text(entry, block)


# ---- command lines

RUN = ("docs/start/mesh.md", "docs/start/passes.md", "docs/start/methods.md")
"""Pages whose commands run."""
MADE_BEFORE = {"venv", "pip", "activate"}
"""Commands that set up what a test has already."""


def commands() -> dict[str, list[str]]:
    """Page -> lines of its blocks of commands."""
    found: dict[str, list[str]] = {}
    for language in ("sh", ""):
        for name, each in blocks(language).items():
            for line in "".join(each).replace("\\\n", " ").splitlines():
                if line.split("#")[0].strip() and (language or line.startswith(("ssgi ", "make ", "python"))):
                    found.setdefault(name, []).append(line.partition(" #")[0].strip())
    return found


COMMANDS = commands()


def check(words: list[str]) -> None:
    """Raise unless a command could be run: its options, targets, modules and extras exist."""
    if words[0] == "ssgi":
        command: click.Command = ssgi
        # With its settings: a command keeps the help option of the first context that it has.
        parent, rest = click.Context(ssgi, info_name="ssgi", **ssgi.context_settings), words[1:]
        while isinstance(command, click.Group) and rest:
            command = command.get_command(parent, rest[0]) or pytest.fail(f"ssgi has no command {rest[0]}")
            rest = rest[1:]
        try:
            command.make_context(words[1], [word for word in rest if word != "..."], parent=parent)
        except click.BadParameter as error:
            if "does not exist" not in str(error):  # a file of the reader's
                raise
    elif words[0] == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert words[1] in targets
    elif words[0].endswith(("python", "python3")) and words[1] == "-m" and words[2] not in ("pip", "venv"):
        assert importlib.util.find_spec(words[2]), words
    elif "pip" in words and (extras := re.findall(r"\[([\w,]+)\]", " ".join(words))):
        known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        assert set(extras[0].split(",")) <= set(known)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_commands_of_a_page_could_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    write_mesh(tmp_path / "room.glb")
    shot(tmp_path / "shot.exr", 64, 48)
    monkeypatch.chdir(tmp_path)
    for line in COMMANDS[name]:
        check(shlex.split(line))


@pytest.mark.parametrize(
    "line",
    [
        "ssgi rendr hall",
        "ssgi render hall --colour 1",
        "make nothing",
        "python -m ssgi_cl.nothing",
        "pip install x[none]",
    ],
)
def test_a_command_that_could_not_run_is_found(line: str) -> None:
    with pytest.raises((click.UsageError, AssertionError, ModuleNotFoundError, pytest.fail.Exception)):
        check(shlex.split(line))


def run(words: list[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, f"{words}: {done.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_the_commands_of_a_door_run(name: str, tmp_path: Path) -> None:
    """In the order of the page, with its Python in between, as a reader who copies block after block."""
    said = ""
    for language, _, block in BLOCK.findall(dict(pages())[name]):
        if language == "python":
            said += block
            run([sys.executable, "-c", said], tmp_path)
        for line in block.splitlines() if language == "sh" else ():
            words = shlex.split(line.partition(" #")[0])
            if words and not any(part in word for word in words for part in MADE_BEFORE):
                run([sys.executable, "-m", "ssgi_cl", *words[1:]] if words[0] == "ssgi" else words, tmp_path)
    assert list(tmp_path.glob("*.*"))


def test_every_block_is_of_a_language_that_is_checked() -> None:
    known = {"python", "sh", "c", "", "{toctree}"}
    for name, text in pages():
        odd = [language for language, _, _ in BLOCK.findall(text) if language not in known]
        assert not odd, name
    assert PYTHON.keys() - ELSEWHERE <= PREPARED.keys()
