"""The table of what a scene doesn't need: frames with and without each skip.

    python -m ssgi_cl.bench.skips docs/skips.md
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from ssgi_cl.atomic import replacement
from ssgi_cl.camera import Camera
from ssgi_cl.plan import SKIPS
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.render import Frame, render
from ssgi_cl.runtime import Runtime

from .skip_scenes import SKIP_SCENES

SIZE = (800, 600)
"""Columns and rows."""
LAYERS = 2
ROUNDS = 4
STEP = 1e-3
"""By how much the camera moves from frame to frame, relative to its distance."""

ALL = "all"
STILL = "all, still"
SINGLE = tuple(name for name in SKIPS if name not in ("outputs", "unchanged"))
ALONE = "all, ao alone"
COLUMNS = ("none", *SINGLE, ALL, STILL, ALONE)
SSDO = ("ssdo, none", "ssdo, all")
"""Columns of frames that SSDO lights, at its own defaults."""


@dataclass(frozen=True)
class Row:
    """A scene's times.

    Attributes:
        name: of the scene.
        seen: share of the pixels that show anything.
        ms: of the device for a frame, by column.
        wall: ms from the call to the finished arrays, by column.
        skipped: what was left out with all skips, the camera moving.
    """

    name: str
    seen: float
    ms: dict[str, float]
    wall: dict[str, float]
    skipped: tuple[str, ...]


def measured(runtime: Runtime, view: BuiltinScene, rounds: int = ROUNDS) -> Row:
    """Render a scene with each skip, in turns, and check that the pictures are the same."""
    cameras = _cameras(view)
    columns = (*COLUMNS, *SSDO)
    frames = {column: _rendered(runtime, view, cameras[0], column) for column in columns}
    taken: dict[str, list[float]] = {column: [] for column in columns}
    wall: dict[str, list[float]] = {column: [] for column in columns}
    for number in range(2 * rounds):
        for column in columns:
            camera = cameras[0] if column == STILL else cameras[(number + 1) % 2]
            frame = _rendered(runtime, view, camera, column)
            taken[column].append(sum(p.ms for p in frame.passes))
            wall[column].append(frame.wall_ms)
    for column in columns:
        if column == ALONE:
            continue
        like = frames[SSDO[0] if column in SSDO else "none"]
        if not np.array_equal(frames[column].radiance, like.radiance):
            raise RuntimeError(f"{view.name}: skipping {column} changes the picture")
    seen = render(view.scene, cameras[0], (), ao=False, gbuffer=True, runtime=runtime).gbuffer
    assert seen is not None  # noqa: S101  it was asked for
    reasons = tuple(f"{p.name}: {p.skipped}" for p in frames[ALL].passes if p.skipped)
    return Row(
        view.name, float(np.isfinite(np.asarray(seen.depth)).mean()),
        {column: median(times) for column, times in taken.items()},
        {column: median(times) for column, times in wall.items()}, reasons,
    )


def _cameras(view: BuiltinScene) -> tuple[Camera, Camera]:
    away = np.subtract(view.eye, view.target) * (1.0 + STEP)
    x, y, z = np.add(view.target, away).tolist()
    return view.camera(*SIZE), Camera.look_at(
        (x, y, z), view.target, view.up, yfov=view.yfov, width=SIZE[0], height=SIZE[1]
    )


def _rendered(runtime: Runtime, view: BuiltinScene, camera: Camera, column: str) -> Frame:
    moving = tuple(name for name in SKIPS if name != "unchanged")
    chosen: dict[str, tuple[str, ...]] = {
        "none": (), ALL: moving, STILL: tuple(SKIPS), ALONE: moving, SSDO[0]: (), SSDO[1]: moving,
    }
    return render(
        view.scene, camera, view.lights, ao_radius=view.ao_radius, layers=LAYERS,
        skips=chosen.get(column, (column,)), outputs=("ao",) if column == ALONE else None,
        indirect="ssdo" if column in SSDO else None, runtime=runtime,
    )


def page(rows: Sequence[Row], runtime: Runtime) -> str:
    """Return the table in Markdown."""
    lines = [
        "# What a scene doesn't need",
        "",
        f"Milliseconds of the device for a frame of {SIZE[0]} x {SIZE[1]} pixels, {LAYERS} depth "
        "layers, GTAO, one shadow map of 1024 texels a lamp face; medians of "
        f"{2 * ROUNDS} frames, columns in turns. The camera moves between frames but in "
        f"`{STILL}`. Each column has that skip alone; `none` has none, `{ALONE}` asks for nothing "
        "but ambient occlusion, with all. Every picture has the same bits as that of `none`.",
        "",
        f"Device: {runtime.info.label}, {runtime.form}.",
        "",
        "| scene | seen | " + " | ".join(COLUMNS) + " | none / all |",
        "|---|---:|" + "---:|" * (len(COLUMNS) + 1),
    ]
    for row in rows:
        times = " | ".join(f"{row.ms[column]:.1f}" for column in COLUMNS)
        gain = row.ms["none"] / row.ms[ALL]
        lines.append(f"| {row.name} | {100.0 * row.seen:.0f} % | {times} | {gain:.1f} |")
    lines += [
        "",
        "The same from the call to the finished arrays on the host, and frames that `ssdo` lights "
        "(its defaults, both layers shaded), milliseconds of the device:",
        "",
        "| scene | wall, none | wall, all | none / all | ssdo, none | ssdo, all | none / all |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        pairs = ((row.wall, ("none", ALL)), (row.ms, SSDO))
        cells = [
            f"{ms[before]:.1f} | {ms[after]:.1f} | {ms[before] / ms[after]:.1f}"
            for ms, (before, after) in pairs
        ]
        lines.append(f"| {row.name} | " + " | ".join(cells) + " |")
    lines += ["", "| skip | what it leaves out |", "|---|---|"]
    lines += [f"| `{name}` | {meaning} |" for name, meaning in SKIPS.items()]
    lines += ["", "Left out with all of them, the camera moving:", ""]
    for row in rows:
        lines.append(f"- {row.name}: " + ("; ".join(dict.fromkeys(row.skipped)) or "nothing"))
    lines += ["", "Made by `python -m ssgi_cl.bench.skips docs/skips.md`.", ""]
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Measure all scenes, or those whose names hold the second argument, and write the page."""
    if not 1 <= len(arguments) <= 2:
        raise SystemExit("usage: python -m ssgi_cl.bench.skips PAGE [WORDS OF SCENES]")
    runtime = Runtime.open()
    wanted = arguments[1] if len(arguments) == 2 else ""
    rows = []
    for make in SKIP_SCENES:
        view = make()
        if wanted in view.name:
            rows.append(measured(runtime, view))
            print(rows[-1], file=sys.stderr)
    with replacement(Path(arguments[0])) as target:
        target.write_text(page(rows, runtime), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
