"""The table of skips: frames with all of them, without any, and without each, of scenes that need little.

`make figures` writes docs/skips.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from statistics import median
from typing import Any

import numpy as np

from ssgi_cl.bench.cases.frame import MOVING
from ssgi_cl.bench.wording import markdown
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, SpotLight
from ssgi_cl.core.scene import Material
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.frame.skips import SKIPS
from ssgi_cl.rasterize.normals import DEFAULT_CREASE_ANGLE
from ssgi_cl.rasterize.parts import Part, assemble
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.rasterize.scenes.generated import generated
from ssgi_cl.rasterize.scenes.scatter import between, rotation
from ssgi_cl.rasterize.scenes.shapes import box, mesh, quad

SUN = DirectionalLight((-0.3, -1.0, -0.4), (3.0, 2.8, 2.5))
SKY = Environment((0.4, 0.5, 0.7))
GLOW = Environment(0.3)
"""A little ambient light, so that ambient occlusion has a purpose indoors."""
LAMPS = 32
LEAVES = 20_000


def _view(
    name: str,
    parts: list[Part],
    lights: tuple[Light, ...],
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    ao_radius: float,
) -> BuiltinScene:
    scene = assemble(parts, (Material(albedo=(0.7, 0.7, 0.7)),), (), crease_angle=DEFAULT_CREASE_ANGLE)
    return BuiltinScene(
        name=name, scene=scene, eye=eye, target=target, yfov=math.radians(50.0), lights=lights, ao_radius=ao_radius
    )


def _ground() -> Part:
    return quad([(-50, 0, 50), (50, 0, 50), (50, 0, -50), (-50, 0, -50)])


def lone_object() -> BuiltinScene:
    """Make a crate in an empty sky that covers 1 pixel in 35."""
    crate = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    return _view("lone object", [crate], (SUN, SKY), (2.5, 2.0, 5.5), (0.0, 0.0, 0.0), 0.2)


def flat_floor() -> BuiltinScene:
    """Make a floor of 100 m that fills the view."""
    return _view("flat floor", [_ground()], (SUN, SKY), (0.0, 4.0, 8.0), (0.0, 0.0, 2.0), 0.3)


def foliage() -> BuiltinScene:
    """Make leaves of 5 cm, turned any way, in 30 cubic metres, over a floor."""
    count = LEAVES
    leaf = np.array([(-0.025, 0, 0), (0.025, 0, 0), (0.025, 0.05, 0), (-0.025, 0.05, 0)])
    axis = between(1, -1.0, 1.0, count, 3)
    turn = rotation(axis, between(2, 0.0, 2.0 * math.pi, count))
    places = between(3, 0.0, 1.0, count, 3) * [4.0, 2.5, 3.0] - [2.0, 0.0, 1.5]
    corners = np.einsum("nij,vj->nvi", turn, leaf) + places[:, None, :]
    first = 4 * np.arange(count)[:, None]
    triangles = (first[..., None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    leaves = mesh(corners.reshape(-1, 3), triangles, name="leaves")
    return _view("foliage", [_ground(), leaves], (SUN, SKY), (0.0, 1.6, 4.0), (0.0, 1.2, 0.0), 0.2)


def many_lamps() -> BuiltinScene:
    """Make crates on a floor under a light, with more behind the camera that light other things."""
    crates = [box((x - 0.4, 0.0, z - 0.4), (x + 0.4, 0.8, z + 0.4)) for x in (-2, 0, 2) for z in (-2, 0)]
    punctual_lights: list[Light] = [SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), 0.8, 60.0)]
    punctual_lights += [
        SpotLight((2.0 * (i - LAMPS // 2 + 1), 4.0, 14.0), (0.0, -0.5, 1.0), 0.5, 60.0) for i in range(LAMPS - 1)
    ]
    return _view("many lights", [_ground(), *crates], (*punctual_lights, GLOW), (0.0, 3.0, 7.0), (0.0, 0.3, 0.0), 0.3)


def closed_room() -> BuiltinScene:
    """Make the Cornell box seen from inside, with ambient light: all pixels show near surfaces."""
    built = BUILTIN_SCENES["cornell_box"]()
    return replace(
        built,
        name="closed room",
        eye=(0.278, 0.273, -0.02),
        target=(0.278, 0.273, 0.28),
        yfov=math.radians(70.0),
        lights=(*built.lights, GLOW),
    )


def hall() -> BuiltinScene:
    """Make the built-in hall: columns, plants and things everywhere."""
    return BUILTIN_SCENES["hall"]()


def unlit() -> BuiltinScene:
    """Make the hall without any light."""
    return replace(hall(), name="unlit", lights=())


SKIP_SCENES: tuple[Callable[[], BuiltinScene], ...] = (
    lone_object,
    flat_floor,
    many_lamps,
    unlit,
    closed_room,
    foliage,
    hall,
)
"""Their makers, the scenes that need least first."""

GENERATED = ("room-7", "colonnade-3", "street-5")

TABLE_SCENES: tuple[Callable[[], BuiltinScene], ...] = (
    *SKIP_SCENES,
    *(make for name, make in BUILTIN_SCENES.items() if name != "hall"),
    *(partial(generated, name) for name in GENERATED),
)
"""Those of the table: also the built-in scenes, and some that are generated."""


SIZE = (400, 300)
"""Columns and rows."""
LAYERS = 2
ROUNDS = 4
STEP = 1e-3
"""By how much the camera moves from frame to frame, relative to its distance."""

ALL = "all"
STILL = "all, still"
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
        "A skip stays if, over at least eight scenes, it wins where it leaves something out (`all` is faster there "
        "than all but that skip) and costs no more than the run-to-run range elsewhere.",
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
