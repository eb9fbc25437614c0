"""The table of skips: frames with all of them, without any, and without each.

`make figures` writes docs/skips.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.frame.skips import SKIPS
from ssgi_cl.rasterize.scenes import BuiltinScene

from .skip_scenes import TABLE_SCENES
from .wording import markdown

SIZE = (400, 300)
"""Columns and rows."""
LAYERS = 2
ROUNDS = 4
STEP = 1e-3
"""By how much the camera moves from frame to frame, relative to its distance."""

ALL = "all"
STILL = "all, still"
MOVING = tuple(name for name in SKIPS if name != "unchanged")
"""Skips of a frame that differs from the one before."""
WITHOUT = {f"all but {name}": name for name in MOVING if name != "outputs"}
"""Columns of frames with all skips but one -> which. A picture needs
everything that `outputs` could leave out."""
ALONE = "all, ao alone"
COLUMNS = ("none", *WITHOUT, ALL, STILL, ALONE)
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


def record(
    runtime: Runtime,
    rounds: int = ROUNDS,
    size: tuple[int, int] = SIZE,
    report: Callable[[str], object] = lambda name: None,
) -> dict[str, Any]:
    """Return the rows of all scenes as JSON can hold them; see `page`.

    Args:
        runtime: the device.
        rounds: pairs of frames of each column.
        size: columns and rows.
        report: called with the name of each scene before it is measured.
    """
    rows = []
    for make in TABLE_SCENES:
        view = make()
        report(view.name)
        rows.append(asdict(measured(runtime, view, rounds, size)))
    return {"device": f"{runtime.info.label}, {runtime.variant}", "size": size, "rounds": rounds, "rows": rows}


def measured(runtime: Runtime, view: BuiltinScene, rounds: int = ROUNDS, size: tuple[int, int] = SIZE) -> Row:
    """Render a scene without each skip, in turns, and check that the pictures are the same."""
    cameras = _cameras(view, size)
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
    seen = render(view.scene, cameras[0], (), bounces=0, ao=False, gbuffer=True, runtime=runtime).gbuffer
    assert seen is not None  # noqa: S101  it was asked for
    reasons = tuple(f"{p.name}: {p.skipped}" for p in frames[ALL].passes if p.skipped)
    return Row(
        view.name,
        float(np.isfinite(np.asarray(seen.depth)).mean()),
        {column: median(times) for column, times in taken.items()},
        {column: median(times) for column, times in wall.items()},
        reasons,
    )


def _cameras(view: BuiltinScene, size: tuple[int, int]) -> tuple[Camera, Camera]:
    away = np.subtract(view.eye, view.target) * (1.0 + STEP)
    x, y, z = np.add(view.target, away).tolist()
    return view.camera(*size), Camera.look_at(
        (x, y, z), view.target, view.up, yfov=view.yfov, width=size[0], height=size[1]
    )


def _rendered(runtime: Runtime, view: BuiltinScene, camera: Camera, column: str) -> Frame:
    chosen: dict[str, tuple[str, ...]] = {
        "none": (),
        ALL: MOVING,
        STILL: tuple(SKIPS),
        ALONE: MOVING,
        SSDO[0]: (),
        SSDO[1]: MOVING,
        **{each: tuple(other for other in MOVING if other != name) for each, name in WITHOUT.items()},
    }
    return render(
        view.scene,
        camera,
        view.lights,
        ao_radius=view.ao_radius,
        layers=LAYERS,
        skips=chosen[column],
        outputs=("ao",) if column == ALONE else None,
        indirect="ssdo" if column in SSDO else None,
        runtime=runtime,
    )


def _wins(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """Return on how many scenes all skips are faster than all but one; a dash without such a column."""
    column = f"all but {name}"
    if column not in WITHOUT or not all(column in row["wall"] for row in rows):
        return "-"
    won = sum(row["wall"][ALL] < row["wall"][column] for row in rows)
    return f"{won} of {len(rows)}"


def _pair(ms: Mapping[str, float], before: str, after: str) -> tuple[str, str, str]:
    """Return two times, and how many times the second one the first is."""
    return f"{ms[before]:.1f}", f"{ms[after]:.1f}", f"{ms[before] / max(ms[after], 1e-9):.1f}"


def page(found: Mapping[str, Any]) -> str:
    """Return the page of what `record` returns."""
    columns, high = found["size"]
    shown = [column for column in COLUMNS if all(column in row["wall"] for row in found["rows"])]
    lines = [
        "# Skipped passes",
        "",
        "`render` skips passes that have no effect on the outputs. `skips=` selects skips by name "
        "(table below), and `frame.passes` has the reason for each skipped pass.",
        "",
        "Wall-clock milliseconds from the call to the finished arrays on the host, for a frame of "
        f"{columns} x {high} pixels with {LAYERS} depth layers, GTAO, and a shadow map of 1024 "
        f"texels a light face: medians of {2 * found['rounds']} frames, columns interleaved. The "
        f"camera moves between frames except in `{STILL}`. `none` has no skip; `{ALL}` has "
        f"all; `all but ...` lacks one; `{ALONE}` has all and asks for ambient occlusion only. Every image is "
        "bit-identical to that of `none`.",
        "",
        "A skip stays if it wins on most of at least eight scenes: if `all` is faster there than all but that skip.",
        "",
        f"Device: {found['device']}. Revision {found.get('revision') or 'unknown'}." + found.get("note", ""),
        "",
        *markdown(
            ("scene", "seen", *shown, "none / all"),
            (
                (
                    row["name"],
                    f"{100.0 * row['seen']:.0f} %",
                    *(f"{row['wall'][column]:.1f}" for column in shown),
                    f"{row['wall']['none'] / row['wall'][ALL]:.1f}",
                )
                for row in found["rows"]
            ),
            "l" + "r" * (len(shown) + 2),
        ),
        "",
        'Wall-clock times of frames with `indirect="ssdo"` (its defaults, both layers shaded), and '
        "device times of the passes of the frames above:",
        "",
        *markdown(
            ("scene", "ssdo, none", "ssdo, all", "none / all", "device, none", "device, all", "none / all"),
            ((row["name"], *_pair(row["wall"], *SSDO), *_pair(row["ms"], "none", ALL)) for row in found["rows"]),
            "lrrrrrr",
        ),
        "",
        *markdown(
            ("skip", "leaves out", "wins on"),
            ((f"`{name}`", meaning, _wins(found["rows"], name)) for name, meaning in SKIPS.items()),
            "llr",
        ),
        "",
        "Skipped with all skips, the camera moving:",
        "",
        *(f"- {row['name']}: " + ("; ".join(dict.fromkeys(row["skipped"])) or "nothing") for row in found["rows"]),
        "",
        "Made by `make figures`.",
        "",
    ]
    return "\n".join(lines)
