"""Random `ssgi` command lines, from a seed: valid ones with hostile values, options and files."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random

import click
import numpy as np

from ssgi_cl.cli.command import main
from ssgi_cl.io import exr

NUMBERS = (
    "0",
    "-1",
    "1",
    "2",
    "3",
    "8",
    "0.5",
    "1e-300",
    "1e300",
    "-1e300",
    "nan",
    "inf",
    "-inf",
    "1e39",
    "99999",
    "2147483648",
    "1" + "0" * 400,
    "1" + "0" * 5000,
    "0x10",
    "1_0",
    "",
    " ",
    "x",
    "\u0663",
)
WORDS = (
    "",
    " ",
    ".",
    "..",
    "/",
    "-",
    "--",
    "-1",
    "x" * 5000,
    "\u00e9",
    os.fsdecode(b"\xff"),
    "%s",
    "[red]",
    "null",
    "room-7",
    "room--1",
    "room-99999999",
    "hall",
    "pocl",
    "no such device",
    "*",
    "{}",
)
SETTINGS = (
    "radius",
    "=",
    "=1",
    "radius=",
    "radius=0.3",
    "radius=nan",
    "radius=inf",
    "radius=1e300",
    "radius=1" + "0" * 400,
    "radius=" + "[" * 5000,
    "radius=[0.1, 0.2]",
    "radius={}",
    "radius=null",
    "samples=16",
    "samples=1e9",
    "taps=1",
    "resolution=half",
    "resolution=none",
    "method=published",
    "method=points",
    "bent_normals=true",
    "bent_normals=1",
    "help",
    "runtime=1",
    "thickness=-1",
)
NEVER = ("clear", "rebuild", "refresh", "help", "markdown", "views")
"""Options left out: they delete or measure what belongs to the user, or write many files."""
SMALL = {
    "width": ("1", "7", "33"),
    "height": ("1", "5", "24"),
    "shadow_size": ("2", "16", "64"),
    "rsm_size": ("2", "16"),
    "vpls": ("1", "64"),
    "layers": ("1", "2"),
    "glossy_vpls": ("0", "8"),
    "auxiliary_cameras": ("0", "1"),
    "edges": ("0", "1", "8"),
    "samples": ("1", "3"),
    "sizes": ("16x12", "0x0", "axb"),
    "seconds": ("0.01", "0"),
    "lanes": ("1", "8", "16", "3"),
}
"""Values that keep a run short, taken more often than hostile ones."""

DEEP_JSON = '{"camera": ' * 20_000
CAMERA_JSON = '{"origin": [0, 1, 4], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_deg": 60, "width": 9, "height": 7}'


def make_files(folder: Path, rng: Random) -> list[str]:
    """Make sound, odd and damaged files; return their names, with some of none."""
    random = np.random.default_rng(rng.randrange(2**32))
    depth = random.uniform(1.0, 2.0, (12, 16)).astype(np.float32)
    normal = np.tile(np.float32([0, 0, 1]), (12, 16, 1))
    broken = depth.copy()
    broken[3, 4] = np.nan
    exr.write(folder / "depth.exr", {"depth": depth})
    exr.write(folder / "full.exr", {"depth": depth, "normal": normal, "albedo": normal * 0.5, "image": normal})
    exr.write(folder / "nan.exr", {"depth": broken})
    exr.write(folder / "bright.exr", {"depth": depth, "albedo": normal * 2, "emission": normal * 9})
    exr.write(folder / "flat.exr", {"image": normal})
    windows = [rng.randrange(-9, 9) for _ in range(2)]
    data = (*windows, windows[0] + 15, windows[1] + 11)
    exr.write(folder / "window.exr", {"depth": depth}, data=data, display=(0, 0, 9, 7))
    exr.write(folder / os.fsdecode(b"odd\xff.exr"), {"depth": depth})
    whole = (folder / "full.exr").read_bytes()
    (folder / "cut.exr").write_bytes(whole[: rng.randrange(len(whole))])
    mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n"
    (folder / "mesh.obj").write_text(mesh)
    (folder / os.fsdecode(b"odd\xff.obj")).write_text(mesh)
    (folder / "point.obj").write_text("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
    (folder / "tiny.obj").write_text(mesh.replace("1", "1e-20", 4))
    (folder / "mesh.glb").write_bytes(rng.randbytes(200))
    (folder / "mesh.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 99999999999\n")
    (folder / "deep.json").write_text(DEEP_JSON)
    (folder / "deep.gltf").write_text(DEEP_JSON)
    (folder / "camera.json").write_text(CAMERA_JSON)
    (folder / "empty.exr").touch()
    (folder / "folder.exr").mkdir()
    (folder / "link.exr").symlink_to("full.exr")
    names = sorted(path.name for path in folder.iterdir())
    return [*names, "missing.exr", "missing.obj", "missing/a.png", ".", "/dev/null", "a" * 300]


def line(rng: Random, names: list[str]) -> list[str]:
    """Return a random command line; `names` are of files in the working folder."""
    kinds = {"render": 8, "apply": 8, "bench": 3, "truth": 1, "devices": 1, "odd": 1}
    (kind,) = rng.choices(list(kinds), list(kinds.values()))
    if kind == "odd":
        return [rng.choice((*WORDS, "rend", "--version", "-h")) for _ in range(rng.randrange(3))]
    arguments = [kind]
    if kind == "render":
        usual = ("cornell_box", "hall", "mesh.obj")
        scene = rng.choice((*usual, rng.choice(names), rng.choice(WORDS)))
        arguments += [
            scene,
            "-o",
            _output(rng, names),
            "--width",
            "33",
            "--height",
            "24",
            "--shadow-size",
            "16",
            "--rsm-size",
            "16",
            "--vpls",
            "64",
        ]
    elif kind == "apply":
        techniques = ("gtao", "ssao", "hbao", "bitmask_ao", "ssdo")
        technique = rng.choice((*techniques, *techniques, rng.choice(WORDS)))
        source = rng.choice(("full.exr", "full.exr", rng.choice(names)))
        arguments += [technique, source, "-o", rng.choice((*(_output(rng, names),) * 3, source))]
    elif kind in ("bench", "truth"):
        arguments += ["--list"]
        arguments += [rng.choice((*WORDS, "gtao", "ssao.16")) for _ in range(rng.randrange(2))]
    if kind == "apply" and rng.random() < 0.5:
        arguments += ["--set", rng.choice(SETTINGS)]
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        arguments += _option(rng, kind, names)
    return arguments


def _output(rng: Random, names: list[str]) -> str:
    odd = rng.choice((rng.choice(names), rng.choice(WORDS), "new.jpg"))
    return rng.choice(("new.png", *("new.exr",) * 5, odd))


def _option(rng: Random, kind: str, names: list[str]) -> list[str]:
    """Return a random option of a command, with a random value."""
    options = [p for p in main.commands[kind].params if isinstance(p, click.Option)]
    option = rng.choice([p for p in options if p.name not in NEVER])
    name = rng.choice(option.opts)
    if option.is_flag:
        return [name]
    return [name, *(_value(rng, option, names) for _ in range(max(option.nargs, 1)))]


def _value(rng: Random, option: click.Option, names: list[str]) -> str:
    if option.name == "settings":
        return rng.choice(SETTINGS)
    if option.name in SMALL and rng.random() < 0.6:
        return rng.choice(SMALL[option.name])
    if isinstance(option.type, click.Choice) and rng.random() < 0.8:
        return str(rng.choice(list(option.type.choices)))
    if isinstance(option.type, click.Path):
        return rng.choice((*names, rng.choice(WORDS)))
    numeric = option.type.name in ("integer", "float", "integer range", "float range")
    return rng.choice(NUMBERS if numeric and rng.random() < 0.9 else WORDS)
