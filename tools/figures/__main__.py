"""All figures of README and docs, recorded anew: `make figures`, or `--help`.

Results go to `docs/figures/*.json`, and README and pages are made from those (`pages`).
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ssgi_cl.bench import document, suite, summary
from ssgi_cl.bench.options import device_option, meshes_option, seconds_option
from ssgi_cl.bench.plot import require_plots
from ssgi_cl.bench.scene_sets import MESH_VIEWS
from ssgi_cl.bench.verdict import mark
from ssgi_cl.bench.wording import revision
from ssgi_cl.core.atomic import replacement
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BuiltinScene, is_scene
from ssgi_cl.tuning.case import Case
from ssgi_cl.tuning.context import TruthSettings
from ssgi_cl.tuning.measured_scenes import MissingMeshError, views_of
from tools.figures import pages, skips, summation
from tools.figures.skips import ROUNDS
from tools.figures.tables import VISIBILITY

QUICK: Size = (72, 96)
QUICK_PATTERNS = 3
"""Of the scenes of docs/views."""
QUICK_RUNS = 4
QUICK_TRUTHS: Mapping[str, Any] = {"rays": 16, "paths": 4, "points": 16}

OCCLUSION = (
    "floor.1",
    "floor.4-10",
    "gtao.1x4",
    "gtao.2x9",
    "gtao.2x9-2",
    "hbao.2x9",
    "ssao-blur.16",
    "bitmask_ao.2x14",
    "bitmask_ao.2x14-2",
    "bitmask_ao.2x14-4",
    "gtao-preset",
    "bitmask-preset",
    "xegtao",
    "embree",
    "mitsuba-ao",
    "mitsuba-ao-blur",
    "mitsuba-ao-oidn",
    "mitsuba-ao-moving-blur",
    "mitsuba-ao-moving-oidn",
)
LIGHT = (
    "rsm-gather.400",
    "rsm-gather-adaptive.400",
    "vpl.1024",
    "vpl-plain.1024",
    "vpl-interleaved.1024",
    "vpl-visibility.1024",
    "vpl-visibility.4096",
    "multires.10-permille",
    "multires-visibility.4096",
    "ssdo-bitmask-half.2",
    "ssdo-points.8",
    "mitsuba-path.1",
    "mitsuba-path.4",
    "mitsuba-path.16",
    "mitsuba-path-oidn.1",
    "mitsuba-path-oidn.4",
    "mitsuba-path-oidn.16",
)
PASSES = (
    "gbuffer",
    "rsm.512",
    "rsm.1024",
    "blended-layers.4",
    "bent-normals.none",
    "bent-normals.2x9",
    "blur.7",
    "accumulate.1",
    "upsample.2",
    "direct.1024",
    "frame.default",
    "frame-first.default",
    "frame-ssao.16",
    "radiosity.2048",
    "reflections.1",
)
WALLS = ("vpl-visibility", "multires-visibility", "mitsuba-path", "mitsuba-path-oidn")
CUTS = ("vpl-cut", "vpl-cut-restored", "vpl-cut-plain.1-percent")
LOBES = ("vpl-lobes", "vpl-lobes-cut", "vpl-lobes-plain")
FAR = ("ssdo-far*.8", "ssdo-far.2", "ssdo-far-all.2")


@dataclass(frozen=True)
class Plan:
    """A document of results.

    Attributes:
        size: (rows, columns) of all cases.
        truths: how good the references are.
        cases: scene -> patterns of cases.
    """

    size: Size
    truths: Mapping[str, Any]
    cases: Mapping[str, tuple[str, ...]]


PLANS: Mapping[str, Plan] = {
    "benchmark": Plan(
        (300, 400),
        {"rays": 512, "paths": 256, "points": 256},
        {
            "cornell_box": (*OCCLUSION, *LIGHT),
            "hall": (*OCCLUSION, *LIGHT, *PASSES),
            **dict.fromkeys(MESH_VIEWS, OCCLUSION),
        },
    ),
    "indirect": Plan(
        (150, 200),
        {"rays": 2, "paths": 512, "points": 2},
        {
            "cornell_box": (*WALLS, *CUTS, *LOBES, *FAR),
            "hall": (*WALLS, *CUTS, *FAR),
            "sponza": (*FAR, *VISIBILITY),
            **dict.fromkeys(("parlour", "workshop", "terrace", "country_kitchen"), VISIBILITY),
        },
    ),
}
OTHERS = ("skips", "summation")


class Progress:
    """Prints what is under way, with the time since the beginning, a line each."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._last = ""

    def __call__(self, text: str, share: float | None = None) -> None:
        """Print a text, unless it is a share of the one before."""
        if not text or text.endswith("%") or text == self._last:
            return
        self._last = text
        minutes, seconds = divmod(int(time.monotonic() - self._began), 60)
        part = "" if share is None else f" {100.0 * share:3.0f} %"
        click.echo(f"{minutes:3d}:{seconds:02d}{part}  {text}")


def record(
    name: str,
    stamp: Mapping[str, Any],
    runtime: Runtime,
    meshes: Path | None,
    root: Path,
    *,
    quick: bool,
    rebuild: bool,
    seconds: float,
    report: Progress,
) -> dict[str, Any]:
    """Measure a document of `PLANS` or `OTHERS`; plots and pictures are written on the way.

    Args:
        name: of the document.
        stamp: what `document.stamp` returns, taken before anything was written.
        runtime: the device.
        meshes: the folder of the views' meshes; scenes whose mesh is absent are left out.
        root: of the checkout.
        quick: at a tiny size with few rays, to try it.
        rebuild: make all references anew.
        seconds: how long each case is repeated.
        report: called with what is under way.
    """
    revised = {"revision": revision(stamp), "created": stamp["created"]}
    if name == "skips":
        size = (QUICK[1], QUICK[0]) if quick else skips.SIZE
        rounds = 1 if quick else ROUNDS
        return {**revised, **skips.record(runtime, rounds, size, lambda view: report(view))}
    if name == "summation":
        return {**revised, **summation.measured(runtime)}
    plan = PLANS[name]
    views, absent = available(plan.cases, runtime, meshes, root)
    size = QUICK if quick else plan.size
    truths = TruthSettings(**(QUICK_TRUTHS if quick else plan.truths), rebuild=rebuild)
    found = suite.measure(
        chosen(plan, size, views, quick=quick),
        views,
        runtime,
        truths=truths,
        seconds=seconds,
        runs=QUICK_RUNS if quick else None,
        report=report,
    )
    found.skipped += absent
    mark(found.results)
    made = {**stamp, "quick": quick, **suite.entries(found, truths, seconds)}
    if name == "benchmark":
        # Plots are those of the numbers as they are recorded.
        again = json.loads(pages.compact(made))
        again["strips"] = summary.strips(again, found.pictures)
        written = summary.write(root / "docs/benchmark.md", again, found.pictures)
        for old in (root / "docs").glob("benchmark-*"):
            if old not in written:
                old.unlink()
        return {**made, "strips": again["strips"]}
    return made


def chosen(plan: Plan, size: Size, views: Mapping[str, BuiltinScene], *, quick: bool = False) -> list[Case]:
    """Return the cases of a plan on the scenes that there are.

    Args:
        plan, size, views: what there is.
        quick: one case a pattern, and few patterns of a scene of docs/views.
    """
    found = []
    for scene, patterns in plan.cases.items():
        if scene in views:
            few = patterns[:QUICK_PATTERNS] if quick and not is_scene(scene) else patterns
            for pattern in few:
                cases = suite.select([pattern], [scene], [size])
                found += cases[:1] if quick else cases
    return list(dict.fromkeys(found))


def available(
    scenes: Sequence[str] | Mapping[str, Any], runtime: Runtime, meshes: Path | None, root: Path
) -> tuple[dict[str, BuiltinScene], list[dict[str, str]]]:
    """Return name -> scene of those that there are, and an entry for each that there is not."""
    found: dict[str, BuiltinScene] = {}
    absent = []
    for name in scenes:
        file = name if is_scene(name) else str(root / "docs/views" / f"{name}.json")
        try:
            found |= views_of([file], runtime, meshes)
        except MissingMeshError as error:
            # Without the path, which is this machine's.
            absent.append({"name": name, "reason": "its mesh was not there (--meshes FOLDER)"})
            click.echo(f"left out {name}: {error}")
    return found, absent


def write(root: Path, name: str, found: Mapping[str, Any]) -> None:
    """Write what was measured to the folder of recorded figures."""
    folder = root / pages.FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    text = (
        pages.compact(found)
        if "results" in found
        else (json.dumps(pages.rounded(found), indent=1, ensure_ascii=False) + "\n")
    )
    with replacement(folder / f"{name}.json") as path:
        path.write_text(text, encoding="utf-8")


def render(root: Path) -> list[str]:
    """Write README and all pages from what is recorded; return those that changed."""
    changed = []
    for name, text in pages.pages(root).items():
        path = root / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            with replacement(path) as target:
                target.write_text(text, encoding="utf-8")
            changed.append(name)
    return changed


def check_tree(stamp: Mapping[str, Any], *, allow_dirty: bool) -> None:
    """Raise a ClickException unless figures are of a revision that can be checked out."""
    if allow_dirty:
        return
    if stamp["revision"] is None:
        raise click.ClickException("this is no git checkout: expected one, or --allow-dirty")
    if stamp["modified"]:
        raise click.ClickException(
            f"files differ from revision {stamp['revision']}: commit them first, or --allow-dirty"
        )


@click.command()
@click.option(
    "--only",
    multiple=True,
    type=click.Choice([*PLANS, *OTHERS]),
    help="Of the documents; several times. All by default.",
)
@meshes_option
@device_option
@seconds_option(0.3)
@click.option("--keep-truths", is_flag=True, help="Use references that were made before.")
@click.option("--quick", is_flag=True, help="Try it: a tiny size and few rays.")
@click.option("--allow-dirty", is_flag=True, help="Record though files differ from the revision.")
@click.option(
    "--render", "only_render", is_flag=True, help="Measure nothing; make README and pages from what is recorded."
)
@click.option(
    "--root",
    default=".",
    show_default=True,
    help="Of the checkout.",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
)
def main(
    only: tuple[str, ...],
    meshes: Path | None,
    device: str | None,
    seconds: float,
    keep_truths: bool,
    quick: bool,
    allow_dirty: bool,
    only_render: bool,
    root: Path,
) -> None:
    """Record the figures of README and docs on this machine, and write them there."""
    report = Progress()
    if not only_render:
        require_plots()  # before anything is measured
        runtime = Runtime.open(device)
        # Before anything is written: afterwards the checkout differs from the revision.
        stamp = document.stamp(runtime)
        check_tree(stamp, allow_dirty=allow_dirty)
        for name in only or (*PLANS, *OTHERS):
            report(f"{name} of revision {revision(stamp)}")
            options: dict[str, Any] = {
                "quick": quick,
                "rebuild": not keep_truths,
                "seconds": 0.02 if quick else seconds,
            }
            write(root, name, record(name, stamp, runtime, meshes, root, report=report, **options))
    with contextlib.suppress(FileNotFoundError):  # not all documents are recorded yet
        for name in render(root):
            click.echo(f"wrote {name}")
    report("finished")


if __name__ == "__main__":
    main(prog_name="python -m tools.figures")
