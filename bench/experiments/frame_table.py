"""Whole frames beside path tracers: `python -m ssgi_cl.bench.experiments.frame_table --help`.

A row a view: times and errors of the default frame, of one and four denoised paths, and which of all
peers are no slower and nearer. Views of validation are rooms on which nothing is tuned, and the meshes of
`VALIDATION_MESHES` where their folder is given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ssgi_cl.bench import document, suite
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.document import clock, metric
from ssgi_cl.bench.options import PixelSize, check_output, device_option, human_errors, meshes_option, progress_bar
from ssgi_cl.bench.peers.mitsuba_frame import KEPT, SETTINGS
from ssgi_cl.bench.wording import NOTHING, markdown, number, short_name
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import VALIDATION_ROOMS
from ssgi_cl.tuning.context import TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of

Result = Mapping[str, Any]

REPORTED = ("cornell_box", "cornell_box-spot", "hall", "parlour", "terrace", "workshop")
"""Built-in views, of which some have been looked at while the frame was made."""
VALIDATION_MESHES = ("country_kitchen", "veach_ajar")
"""Views of real rooms, files in docs/views."""
OWN, FIRST = "frame.default", "frame-first.default"
ONE, ONE_FIRST, FOUR = "mitsuba-frame-oidn.1", "mitsuba-frame-oidn-first.1", "mitsuba-frame-oidn.4"
CASES = (OWN, FIRST, ONE_FIRST, *(f"{family}.{samples}" for family in KEPT for samples in SETTINGS))
FEW = (OWN, FIRST, ONE_FIRST, ONE, FOUR)
"""Of these, what the columns of the table are made of."""
_VIEWS = Path(__file__).resolve().parent.parent.parent / "docs" / "views"
_HEAD = (
    *("view", "first, ms", "kept, ms", "FLIP", "mottling"),
    *("1 path + OIDN: first", "kept", "FLIP", "mottling", "4 paths + OIDN: kept", "FLIP", "mottling"),
    *("kept over 1 path", "peers that are no slower and nearer"),
)


def told(results: Sequence[Result]) -> str:
    """Return the lines of a Markdown table: a row for each scene of the results, in their order."""
    rows = []
    for scene in dict.fromkeys(result["scene"] for result in results):
        found = {short_name(result): result for result in results if result["scene"] == scene}
        own = found.get(OWN)
        if own is not None:
            rows.append((scene, *_cells(found), _ratio(own, found.get(ONE)), ", ".join(nearer(found)) or "none"))
    return "\n".join(markdown(_HEAD, rows, "l" + 12 * "r" + "l"))


def nearer(found: Mapping[str, Result]) -> list[str]:
    """Return the peers whose frames take no longer than the default's and have less FLIP, the fastest first."""
    flip, wall = metric(found[OWN], "world", "flip"), clock(found[OWN])["median"]
    peers = [name for name in found if name.partition(".")[0] in KEPT and clock(found[name])["median"] <= wall]
    return [
        name
        for name in sorted(peers, key=lambda name: clock(found[name])["median"])
        if flip is not None and (error := metric(found[name], "world", "flip")) is not None and error < flip
    ]


def _cells(found: Mapping[str, Result]) -> list[str]:
    cells = []
    for first, kept in ((FIRST, OWN), (ONE_FIRST, ONE), (None, FOUR)):
        times = [kept] if first is None else [first, kept]
        cells += [number(clock(found[name])["median"]) if name in found else NOTHING for name in times]
        cells += [number(metric(found.get(kept, {}), "world", name)) for name in ("flip", "mottling")]
    return cells


def _ratio(own: Result, other: Result | None) -> str:
    return NOTHING if other is None else f"{clock(own)['median'] / clock(other)['median']:.2f}"


@click.command()
@click.option("--scene", "scenes", multiple=True, help="As of `ssgi bench`; by default all that are told of.")
@meshes_option
@click.option("--size", type=PixelSize(), default="800x600", show_default=True, help="Of the images in pixels.")
@device_option
@click.option("--truth-paths", default=256, show_default=True, type=click.IntRange(2, 1 << 20), help="Per pixel.")
@click.option("--seconds", default=3.0, show_default=True, type=click.FloatRange(0.01, 60.0), help="Of each case.")
@click.option("--few", is_flag=True, help="1 and 4 denoised paths alone as peers: a minute or two a view.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Write what was measured, .json.")
def main(
    scenes: tuple[str, ...],
    meshes: Path | None,
    size: Size,
    device: str | None,
    truth_paths: int,
    seconds: float,
    few: bool,
    output: Path | None,
) -> None:
    """Print a table of the default frame beside path tracers on views of the report and of validation.

    With the default 256 paths of the references it takes some hours on two cores; references are kept, and each
    view's row is printed and written as soon as it is measured.
    """
    check_output(output, ".json")
    rooms = [*VALIDATION_ROOMS, *(str(_VIEWS / f"{name}.json") for name in VALIDATION_MESHES if meshes)]
    tables = {"": scenes} if scenes else {"reported": REPORTED, "validation": rooms}
    settings = TruthSettings(paths=truth_paths)
    with human_errors():
        runtime = Runtime.open(device)
        parts: list[suite.Measurements] = []
        with progress_bar() as step:
            for title, names in tables.items():
                heading = f"## {title}\n\n" if title else ""
                click.echo(f"{heading}{told([])}")
                for name in names:
                    views = views_of([name], runtime, meshes)
                    cases = suite.select(FEW if few else CASES, list(views), [size], FAMILIES)
                    part = suite.measure(
                        cases, views, runtime, truths=settings, seconds=seconds, families=FAMILIES, report=step
                    )
                    parts.append(part)
                    _tell(part)
                    if output is not None:
                        whole = suite.entries(suite.joined(parts), settings, seconds)
                        document.write(output, {**document.stamp(runtime), **whole})
                    if part.interrupted:
                        return
                click.echo()


def _tell(part: suite.Measurements) -> None:
    """Print a view's row, and on standard error what is missing in it."""
    for line in told(part.results).splitlines()[2:]:
        click.echo(line)
    for entry in part.skipped:
        click.echo(f"skipped {entry['name']}: {entry['reason']}", err=True)


if __name__ == "__main__":
    main(prog_name="python -m ssgi_cl.bench.experiments.frame_table")
