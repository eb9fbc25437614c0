"""Cost of a pixel-sample by size of image and radius: `python -m ssgi_cl.bench.experiments.cost --help`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import click
import numpy as np

from ssgi_cl.bench.options import device_option, json_option, seconds_option
from ssgi_cl.bench.wording import number
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.techniques.ao.slices import SliceParams, SliceTechnique
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.tuning.case import Subject
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.measure import Stopwatch
from ssgi_cl.tuning.measured_scenes import views_of

SIZES: tuple[Size, ...] = ((300, 400), (600, 800), (1200, 1600), (1080, 1920), (2160, 3840))
"""(rows, columns)."""
RADII = (0.5, 1.0, 2.0, 4.0)
"""Times the scene's own radius."""
RADII_AT: Size = (600, 800)

TECHNIQUES: Mapping[str, tuple[Any, type[SliceParams]]] = {
    name: (each.technique, each.technique.defaults)
    for name, each in of_kind("ao").items()
    if issubclass(each.technique, SliceTechnique)
}


@dataclass(frozen=True)
class Cost:
    """Cost of a technique with its default parameters.

    Attributes:
        technique: key in `TECHNIQUES`.
        size: (rows, columns) of the image.
        radii: radius in parts of the scene's own.
        ms: wall time of a frame until the device has finished, milliseconds; no copy to the host.
        ns: the same over pixels that show something and samples of each, nanoseconds.
        unsteady: why this is not to be relied on; empty if it is.
    """

    technique: str
    size: Size
    radii: float
    ms: float
    ns: float
    unsteady: str


def costs(
    view: BuiltinScene,
    runtime: Runtime,
    names: Sequence[str],
    places: Sequence[tuple[Size, float]],
    seconds: float = 1.0,
    runs: int | None = None,
) -> list[Cost]:
    """Measure techniques on a view.

    Milliseconds come from ratios to the reference run beside each run and the least time of that,
    so that they can be held to each other even where the machine is busy.

    Args:
        view: the scene.
        runtime: the device.
        names: keys of `TECHNIQUES`.
        places: (size, radius in parts of the scene's own).
        seconds, runs: how long, or how often, each is repeated.
    """
    watch = Stopwatch(runtime, seconds, runs)
    found, context = [], None
    for size, radii in places:
        if context is None or context.size != size:
            context = Context(runtime, view, size)
        gbuffer, seen = context.gbuffer, int(np.count_nonzero(context.seen))
        for name in names:
            make, kind = TECHNIQUES[name]
            params = kind(radius=radii * context.radius)
            technique = make(runtime, size, params)
            timing = watch.time(Subject(run=lambda t=technique, g=gbuffer: t.run(g)))  # type: ignore[misc]
            ms = timing.ratio.median * min(watch.reference_ms)
            samples = 2 * params.slices * params.taps * max(seen, 1)
            found.append(Cost(name, size, radii, ms, 1e6 * ms / samples, timing.unsteady))
    return found


def table(found: Sequence[Cost]) -> str:
    """Return costs as a table of Markdown: a row a technique, a column a size and radius."""
    places = list(dict.fromkeys((cost.size, cost.radii) for cost in found))
    names = list(dict.fromkeys(cost.technique for cost in found))
    by_place = {(cost.technique, cost.size, cost.radii): cost for cost in found}
    heads = [f"{size[1]} x {size[0]}, radius x {radii:g}" for size, radii in places]
    lines = [f"| ns a pixel-sample | {' | '.join(heads)} |", "|---|" + "---:|" * len(heads)]
    for name in names:
        row = [by_place[name, *place] for place in places]
        cells = (f"{number(cost.ns)}{'~' if cost.unsteady else ''}" for cost in row)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


@click.command()
@click.option("--scene", default="hall", show_default=True, metavar="NAME|FILE")
@click.option(
    "--technique", "names", multiple=True, type=click.Choice(list(TECHNIQUES)), help="Several times; all without."
)
@device_option
@seconds_option(1.0)
@json_option
def main(scene: str, names: tuple[str, ...], device: str | None, seconds: float, as_json: bool) -> None:
    """Print what a pixel-sample costs, blur included: by size of the image, and by radius."""
    runtime = Runtime.open(device)
    try:
        (view,) = views_of([scene], runtime).values()
    except ValueError as error:
        raise click.ClickException(str(error)) from error
    chosen = names or tuple(TECHNIQUES)
    parts = [
        costs(view, runtime, chosen, places, seconds)
        for places in ([(size, 1.0) for size in SIZES], [(RADII_AT, radii) for radii in RADII])
    ]
    if as_json:
        click.echo(json.dumps([asdict(cost) for part in parts for cost in part], indent=1))
    else:
        click.echo("\n\n".join(table(part) for part in parts))


if __name__ == "__main__":
    main()
