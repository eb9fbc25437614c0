"""A benchmark as one HTML file: time against error, the pictures, and where the errors are."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from ssgi_cl.core import atomic
from ssgi_cl.truth.metrics import REGIONS

from . import viewer
from .document import Group, groups, metric, timed
from .guide import guides
from .peers import PEERS
from .plot import looks, plot, swatch
from .report_page import page
from .verdict import verdict
from .viewer import Album
from .wording import (
    NOTHING,
    calibration_line,
    ceiling,
    device_milliseconds,
    milliseconds,
    number,
    percent,
    quartiles,
    ratio,
    revision,
    short_name,
    title,
)

if TYPE_CHECKING:
    from .suite import Pictures

_STAR = '<span class="star" title="on the front">&#9733;</span>'
_COLUMNS = (
    "case",
    "ms",
    "quartiles, ms",
    "RMSE",
    "RMSE, same model",
    "bias, same model",
    "bias",
    "99 %",
    "MRSE",
    "PSNR, dB",
    "SSIM",
    "FLIP",
    "device, ms",
    "ratio",
    "G/s",
    "GB/s",
    "of ceiling",
)
_HOW = (
    "ms is the median wall time of a frame, all that the result needs beyond the base G-buffer "
    "counted; device, ms is that of the passes alone by the device's clock, and nothing is judged "
    "by it. Ratio is wall time over that of the reference case run just before. RMSE, bias and the "
    "rest compare with rays or paths against the mesh, the world's truth (FLIP of light is "
    "HDR-FLIP); &ldquo;same model&rdquo; is what the same screen-space model converges to. A star "
    "marks what nothing in its group beats in both time and error, + what only results beat that "
    "overlap with it in time, ~ an unsteady time: see its quartiles."
)


def write(path: str | os.PathLike[str], document: Mapping[str, Any], pictures: Mapping[str, Pictures]) -> None:
    """Write a report that needs nothing but itself, whole or not at all.

    Args:
        path: the file; one that exists is replaced.
        document: see `document`.
        pictures: name of a case -> what it gave, for those that have any.

    Raises:
        OSError: the file can't be written; the message names it.
    """
    album = Album()
    parts = [_header(document)]
    grouped = groups(document["results"])
    parts.append(_contents(list(grouped)))
    parts.append(_guide(document))
    families = sorted({result["family"] for result in document["results"]})
    look = looks(families, list(PEERS))
    for index, (key, results) in enumerate(grouped.items()):
        parts.append(
            f'<section id="group-{index}"><h2>{escape(title(key))}</h2>'
            f"{_plot(key, results, look)}<p>{escape(verdict(results))}</p>"
            f"{_table(results, document['calibration'])}"
            f"{viewer.html(index, results, pictures, album)}{_regions(results)}"
            f"{_passes(results)}</section>"
        )
    parts.append(_skipped(document["skipped"]))
    packed = json.dumps(album.uris)
    size = sum(len(part) for part in parts) + len(packed)
    parts.append(f'<footer class="soft"><p>{len(album.uris)} pictures; {number(1e-6 * size)} MB in all.</p></footer>')
    text = page(f"ssgi_cl benchmark, {document['device']['label']}", "\n".join(parts), packed)
    with atomic.replacement(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _header(document: Mapping[str, Any]) -> str:
    device, machine = document["device"], document["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in document["versions"].items() if version)
    options = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in document["options"].items())
    reference = document["reference"]
    facts = {
        "Device": f"{device['label']} ({device['variant']})",
        "Machine": f"{machine['cpu']}, {machine['threads']} threads, {machine['system']}",
        "Ceilings": calibration_line(document["calibration"]).partition(": ")[2],
        "Reference case": f"{reference['name']}, {number(reference['ms'])} ms",
        "Options": options,
        "Versions": versions,
        "Revision": revision(document),
        "Date": document["created"],
    }
    rows = "".join(f"<dt>{name}</dt><dd>{escape(fact)}</dd>" for name, fact in facts.items())
    return f'<header><h1>Run time against error</h1><dl class="facts">{rows}</dl><p class="soft">{_HOW}</p></header>'


def _contents(keys: list[Group]) -> str:
    if not keys:
        return "<p>Nothing was measured.</p>"
    items = "".join(f'<li><a href="#group-{index}">{escape(title(key))}</a></li>' for index, key in enumerate(keys))
    return f'<nav aria-label="Groups"><ul>{items}</ul></nav>'


def _guide(document: Mapping[str, Any]) -> str:
    tables = ""
    for guide in guides(document):
        head = "".join(f'<th scope="col">{escape(name)}</th>' for name in ("ms", *guide.scenes))
        rows = "".join(
            f'<tr><th scope="row">{ms:g}</th>' + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
            for ms, cells in guide.rows.items()
        )
        tables += (
            f'<h3>{escape(guide.case)}</h3><div class="scroll" tabindex="0"><table><thead><tr>'
            f"{head}</tr></thead><tbody>{rows}</tbody></table></div>"
        )
    return f"<section><h2>The least error within a time</h2>{tables}</section>" if tables else ""


def _plot(key: Group, results: list[dict[str, Any]], look: Mapping[str, tuple[int, int, bool]]) -> str:
    drawn = plot(results, look, title(key), key[0])
    if not drawn:
        return ""
    families = [
        family
        for family in look
        if any(r["family"] == family and metric(r, "world", "rmse") is not None for r in results)
    ]
    items = "".join(f"<li>{swatch(look[family])}{escape(family)}</li>" for family in families)
    dashed = "; dashed: other programs" if any(look[family][2] for family in families) else ""
    level = "" if all(map(timed, results)) else "; level lines are bounds"
    return (
        f'<ul class="key">{items}</ul><div class="scroll" tabindex="0">{drawn}</div>'
        '<p class="soft">Towards the lower left is better. The grey band is the front; '
        f"bars are quartiles, hollow points are unsteady{dashed}{level}.</p>"
    )


def _table(results: list[dict[str, Any]], calibration: Mapping[str, float]) -> str:
    rows = [_row(result, calibration) for result in results]
    # A column that says nothing of any case is left out.
    kept = [i for i in range(len(_COLUMNS)) if any(row[i] != NOTHING for row in rows)]
    head = "".join(f'<th scope="col">{escape(_COLUMNS[i])}</th>' for i in kept)
    body = []
    for result, row in zip(results, rows, strict=True):
        cells = "".join(f'<th scope="row">{row[i]}</th>' if i == 0 else f"<td>{row[i]}</td>" for i in kept)
        body.append(f"<tr{' class=front' if result.get('front') else ''}>{cells}</tr>")
    return (
        f'<div class="scroll" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>{_notes(results)}"
    )


def _notes(results: list[dict[str, Any]]) -> str:
    """Return what times count and which are unsteady, each text once with all its cases."""
    said: dict[str, list[str]] = {}
    for result in results:
        counted = result.get("counted") and f"counted: {result['counted']}"
        unsteady = result["unsteady"] and f"~ {result['unsteady']}"
        for text in (counted, result.get("note"), unsteady):
            if text:
                said.setdefault(text, []).append(short_name(result))
    items = "".join(f"<li>{escape(', '.join(names))}: {escape(text)}</li>" for text, names in said.items())
    return f'<ul class="notes">{items}</ul>' if items else ""


def _row(result: dict[str, Any], calibration: Mapping[str, float]) -> list[str]:
    """Return the cells of `_COLUMNS`, HTML."""
    reached, what = ceiling(result, calibration)
    star = _STAR if result.get("front") else (f'<span class="star">{"+" if result.get("near") else ""}</span>')

    def error(name: str, sign: str = "") -> str:
        return number(metric(result, "world", name), sign)

    return [
        star + escape(short_name(result)),
        milliseconds(result),
        f"<small>{quartiles(result)}</small>" if timed(result) else NOTHING,
        error("rmse"),
        number(metric(result, "assumption", "rmse")),
        number(metric(result, "assumption", "bias"), "+"),
        error("bias", "+"),
        error("p99"),
        error("mrse"),
        error("psnr"),
        error("ssim"),
        error("flip"),
        device_milliseconds(result),
        ratio(result),
        number(result.get("samples_g_s")),
        number(result.get("moved_gb_s")),
        f"{percent(reached)} <small>{what}</small>" if what else NOTHING,
    ]


def _regions(results: list[dict[str, Any]]) -> str:
    """Return a bar for each case: its squared error, divided among the regions."""
    rows, pixels = [], {}
    for result in results:
        found = ((result.get("errors") or {}).get("world") or {}).get("regions") or {}
        squares = {
            name: (found[name].get("share") or 0.0) * (found[name].get("rmse") or 0.0) ** 2
            for name in REGIONS
            if name in found
        }
        total = sum(squares.values())
        if 0.0 < total < math.inf:
            pixels = {name: found[name].get("share") or 0.0 for name in squares}
            shares = {name: square / total for name, square in squares.items()}
            rows.append(f"<div>{escape(short_name(result))}</div>{_bar(shares, 'squared error')}")
    if not rows:
        return ""
    key = "".join(f'<li><i class="r{i}"></i>{name}</li>' for i, name in enumerate(REGIONS) if name in pixels)
    return (
        f'<h3>Where the squared error is</h3><ul class="key">{key}</ul><div class="bars">'
        f'<div class="soft">all pixels</div>{_bar(pixels, "pixels")}{"".join(rows)}</div>'
    )


def _bar(shares: Mapping[str, float], of: str) -> str:
    told = ", ".join(f"{name} {percent(share)}" for name, share in shares.items())
    spans = "".join(
        f'<span class="r{REGIONS.index(name)}" style="width:{100.0 * share:.2f}%" '
        f'title="{name}: {percent(share)} of the {of}">'
        f"{percent(share) if share >= 0.07 else ''}</span>"
        for name, share in shares.items()
    )
    return f'<div class="bar" role="img" aria-label="{of}: {told}">{spans}</div>'


def _passes(results: list[dict[str, Any]]) -> str:
    rows = "".join(
        f'<tr><th scope="row">{escape(short_name(result))}</th><td class="text">'
        + escape(", ".join(f"{p['name']} {number(p['ms'])}" for p in result["passes"]))
        + "</td></tr>"
        for result in results
        if len(result["passes"]) > 1
    )
    if not rows:
        return ""
    return (
        '<details><summary>Passes, ms</summary><div class="scroll" tabindex="0"><table><tbody>'
        f"{rows}</tbody></table></div></details>"
    )


def _skipped(entries: list[dict[str, str]]) -> str:
    if not entries:
        return ""
    items = "".join(f"<li>{escape(entry['name'])}: {escape(entry['reason'])}</li>" for entry in entries)
    return f"<section><h2>Skipped</h2><ul>{items}</ul></section>"
