"""A document as a page of Markdown with plots and pictures, small enough to be kept with code."""

from __future__ import annotations

import os
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from ssgi_cl import atomic

from .document import Group, groups, metric
from .guide import GUIDE, advises
from .peers import PEERS
from .pictures import OCCLUSION_RANGE, encoded, error_colors, exposure_of
from .plot import HEIGHT, LEFT, MARKERS, WIDTH, looks, plot
from .report_page import PLOT_STYLE
from .verdict import verdict
from .wording import (
    calibration_line,
    milliseconds,
    number,
    ratio,
    revision,
    rmse,
    short_name,
    title,
)

if TYPE_CHECKING:
    from .suite import Pictures

_HEAD = "| | case | ms | ratio | RMSE | bias | MRSE | SSIM | FLIP | RMSE of the model | its bias |"
_RULE = "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
_LEGEND = (
    "\\* nothing of its group is both faster and closer to the truth. ~ unsteady. Ratio: time over "
    "that of the reference run beside it. RMSE, bias, MRSE, SSIM and FLIP (of light HDR-FLIP) are "
    "against rays or paths through the mesh; the last two columns are against what the same "
    "screen-space model converges to. RMSE of light: in W/m², and as a share of the truth's mean."
)
_ENTRY_WIDTH, _ROW = 140, 22
_STRIP, _QUALITY = 1200, 80
"""Columns of a strip of three pictures, and what JPEG keeps of it, of 100."""


def write(
    path: str | os.PathLike[str], document: Mapping[str, Any], pictures: Mapping[str, Pictures]
) -> list[Path]:
    """Write the page, with a plot and a strip of pictures of each group that has errors.

    A strip shows a result, the truth and the error map, of the case of this library on the front
    that has the least error.

    Args:
        path: of the page; plots and pictures lie beside it and begin with its name.
        document: see `document`.
        pictures: name of a case -> what it gave, for those that have any.

    Returns:
        All files.

    Raises:
        OSError: a file can't be written; the message names it.
    """
    page = Path(path)
    device, machine = document["device"], document["machine"]
    lines = [
        "# Run time against error",
        "",
        f"{device['label']}, {device['form']}; {machine['cpu']}, {machine['threads']} threads. "
        f"Revision {revision(document)}. "
        f"C{calibration_line(document['calibration'])[1:]}. "
        f"Reference: {document['reference']['name']}, {number(document['reference']['ms'])} ms.",
        "",
        _LEGEND,
    ]
    if advises(document):
        lines += ["", "## Who should use which", ""]
        lines += (f"- {need}: {served}" for need, served in GUIDE.items())
    files = []
    for key, results in groups(document["results"]).items():
        lines += ["", f"## {title(key)}", ""]
        name = f"{page.stem}-{key[0]}-{key[1]}-{key[2][1]}x{key[2][0]}"
        drawn = _drawing(key, results)
        if drawn:
            files.append(page.with_name(f"{name}.svg"))
            with atomic.replacement(files[-1]) as temporary:
                temporary.write_text(drawn, encoding="utf-8")
            lines += [f"![{title(key)}: error over time]({name}.svg)", ""]
        said = verdict(results)
        lines += [said, ""] if said else []
        lines += [_HEAD, _RULE, *map(_row, results)]
        best = _best(results, pictures)
        if best is not None:
            files.append(page.with_name(f"{name}.jpg"))
            with atomic.replacement(files[-1]) as temporary:
                _strip(pictures[best["name"]]).save(temporary, "JPEG", quality=_QUALITY)
            lines += [
                "",
                f"![{short_name(best)}, truth, error]({name}.jpg)",
                "",
                f"*{short_name(best)}; truth; error from blue, {-OCCLUSION_RANGE}, to orange, "
                f"+{OCCLUSION_RANGE} (of light, half the truth's luminance).*",
            ]
    lines += ["", *(f"- {entry['name']}: {entry['reason']}" for entry in document["skipped"])]
    with atomic.replacement(page) as temporary:
        temporary.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    return [page, *files]


def _best(
    results: list[dict[str, Any]], pictures: Mapping[str, Pictures]
) -> dict[str, Any] | None:
    """Return this library's result on the front that has the least error and pictures."""
    shown = [
        (error, result)
        for result in results
        if result["front"] and result["family"] not in PEERS and result["name"] in pictures
        and (error := metric(result, "world", "rmse")) is not None
    ]
    return min(shown, key=lambda pair: pair[0])[1] if shown else None


def _strip(of: Pictures) -> Image.Image:
    """Return result, truth and error map beside one another."""
    world = of.result if of.world is None else of.world
    exposure = 1.0 if world.ndim == 2 else exposure_of(world, of.seen)
    parts = [
        np.broadcast_to(np.atleast_3d(part), (*of.seen.shape, 3))
        for part in (
            encoded(of.result, exposure), encoded(world, exposure),
            error_colors(of.result, world, of.seen),
        )
    ]
    strip = Image.fromarray(np.concatenate(parts, axis=1))
    if strip.width > _STRIP:
        strip = strip.resize((_STRIP, round(strip.height * _STRIP / strip.width)))
    return strip


def _row(result: Mapping[str, Any]) -> str:
    world = [number(metric(result, "world", name), "+" if name == "bias" else "")
             for name in ("bias", "mrse", "ssim", "flip")]
    cells = (
        "\\*" if result["front"] else "",
        short_name(result),
        milliseconds(result),
        ratio(result),
        rmse(result, "world"),
        *world,
        rmse(result, "assumption"),
        number(metric(result, "assumption", "bias"), "+"),
    )
    return f"| {' | '.join(cells)} |"


def _drawing(key: Group, results: list[dict[str, Any]]) -> str:
    """Return the plot with its legend as a file of its own; "" if there is nothing to draw."""
    shown = sorted({r["family"] for r in results if metric(r, "world", "rmse") is not None})
    look = looks(shown, list(PEERS))
    drawn = plot([r for r in results if r["family"] in shown], look, title(key), key[0])
    if not drawn:
        return ""
    in_row = (WIDTH - LEFT) // _ENTRY_WIDTH
    legend = "".join(
        f'<g class="c{color}" transform="translate({LEFT + index % in_row * _ENTRY_WIDTH} '
        f'{HEIGHT + 12 + index // in_row * _ROW})"><path class="line{" dashed" if dashed else ""}" '
        f'd="M0 0H24"/><path class="point" transform="translate(12 0)" d="{MARKERS[marker]}"/>'
        f'<text x="30" y="4">{escape(family)}</text></g>'
        for index, (family, (color, marker, dashed)) in enumerate(look.items())
    )
    height = HEIGHT + 12 + -(-len(look) // in_row) * _ROW
    inner = drawn[drawn.index(">") + 1 :]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}"><style>{PLOT_STYLE}svg {{ background: var(--page); }}'
        f"</style>{legend}{inner}\n"
    )
