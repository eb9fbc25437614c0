"""Page of Markdown of a document, with plots and pictures, small enough to be kept with code."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core import atomic
from ssgi_cl.io.previews import share_view
from ssgi_cl.reference.filters.tonemap import encoded_reference
from ssgi_cl.techniques.filters.tonemap import auto_exposure

from .document import groups, metric
from .peers import PEERS
from .plot import has_plot, looks, plot
from .verdict import guides, verdict
from .wording import (
    calibration_line,
    device_milliseconds,
    markdown,
    milliseconds,
    number,
    quartiles,
    revision,
    rmse,
    short_name,
    star,
    title,
)

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

OCCLUSION_RANGE = 0.25
"""Difference of A at the ends of an error map's scale."""
LIGHT_RANGE = 0.5
"""Relative difference of luminance at the ends of an error map's scale."""
DARK_SHARE = 0.01
"""Of the mean luminance: what is added to the truth that a difference is divided by."""
LEVELS = 17
"""Steps of an error map's scale: enough to read, few enough to pack well."""
TOO_DARK, JUST, TOO_BRIGHT = (((12, 44, 110), (64, 138, 214)), (246, 246, 246), ((240, 142, 40), (128, 48, 0)))
"""RGB from the ends to the middle: blue and orange, which no common colour blindness confuses."""
_NOTHING = (128, 128, 128)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def scale() -> NDArray[np.uint8]:
    """Return [LEVELS, 3]: the colours of an error map from too dark to too bright."""
    stops = np.array([*TOO_DARK, JUST, *TOO_BRIGHT], np.float64)
    where = np.linspace(0.0, len(stops) - 1.0, LEVELS)
    colors = [np.interp(where, np.arange(len(stops)), stops[:, c]) for c in range(3)]
    return np.rint(np.stack(colors, axis=-1)).astype(np.uint8)


def exposure_of(truth: Floats, seen: Mask) -> float:
    """Return what to multiply irradiance with so that the truth is well lit.

    It is the automatic one of what is seen; see `auto_exposure`.
    """
    return auto_exposure(np.where(seen[..., None], _finite(truth), np.float32(0.0)))


def encoded(image: Floats, exposure: float) -> NDArray[np.uint8]:
    """Return what a screen shows, [rows, columns] or [rows, columns, 3].

    Args:
        image: [rows, columns], a share: black is 0 and white 1, without gamma; or
            [rows, columns, 3], light: multiplied by the exposure, then the library's filmic curve
            and sRGB. What is not finite is black.
        exposure: of light.
    """
    image = _finite(image)
    if image.ndim == 2:
        return share_view(image)
    return np.rint(encoded_reference(image, exposure)).astype(np.uint8)


def error_colors(image: Floats, truth: Floats, seen: Mask) -> NDArray[np.uint8]:
    """Return [rows, columns, 3]: blue is too dark, orange too bright, grey not compared.

    Of shares the difference, of light the difference of luminance over that of the truth, to which
    1 % of its mean is added so that black pixels have an error too. Ends of the scale are
    `OCCLUSION_RANGE` and `LIGHT_RANGE`.
    """
    value, reference = (_finite(array).astype(np.float64) for array in (image, truth))
    if value.ndim == 2:
        share = (value - reference) / OCCLUSION_RANGE
    else:
        value, reference = value @ _LUMINANCE, reference @ _LUMINANCE
        base = DARK_SHARE * float(reference[seen].mean()) if seen.any() else 0.0
        share = (value - reference) / np.maximum(reference + base, 1e-30) / LIGHT_RANGE
    level = np.rint((np.clip(share, -1.0, 1.0) + 1.0) * 0.5 * (LEVELS - 1)).astype(np.uint8)
    level[~seen] = LEVELS
    colors: NDArray[np.uint8] = np.concatenate([scale(), np.array([_NOTHING], np.uint8)])[level]
    return colors


def _finite(image: Floats) -> Floats:
    return np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)


if TYPE_CHECKING:
    from .suite import Pictures

_HEAD = ("", "case", "ms", "quartiles", "device ms", "RMSE", "bias", "MRSE", "SSIM", "FLIP")
_STREAKS = ("streaks",)
"""Of documents that have them."""
_OF_FRAMES, _OF_MODELS = ("mottling",), ("RMSE of the model", "its bias")
TRIAL = "A trial of the recording, at a tiny size with few rays on a busy machine: these figures say nothing."
LEGEND = (
    "ms: median wall time of a frame, and the quartiles of the runs. It counts what a caller pays "
    "for the result beyond the base G-buffer (one layer, no overscan), which everything here gets "
    "for nothing: layers and overscan drawn, auxiliary cameras and maps drawn, lights chosen, "
    "copies to and from the device, blur or denoiser; the last column names it. Search trees of "
    "meshes that do not move are built before, those of meshes that move in every frame. Device "
    "ms: by the device's clock, passes alone; nothing is judged by it.",
    "\\* nothing in its group is both faster and closer to the reference; + only such results are "
    "as overlap with it in time. ~ unsteady: the halves of its runs differ by more than a tenth, "
    "or the machine was busy; it counts like any other. RMSE, bias, MRSE, SSIM and FLIP (of light "
    "HDR-FLIP, of frames that of pictures with the reference's exposure) are against rays or paths "
    "through the mesh; the model's against what the same screen-space model converges to. RMSE of "
    "light: in W/m², and as a share of the reference's mean. Streaks: the root mean square of errors that "
    "repeat along rows, columns or diagonals, or every 4 or 8 pixels, on smooth surfaces "
    "(`metrics.streaks`). Mottling: the root mean square of a frame's relative errors on smooth surfaces, "
    "between Gaussians of 2 and 20 pixels.",
)
_STRIP, _QUALITY = 1200, 80
"""Columns of a strip of three pictures, and what JPEG keeps of it, of 100."""


def write(path: str | os.PathLike[str], document: Mapping[str, Any], pictures: Mapping[str, Pictures]) -> list[Path]:
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
        MissingExtraError: matplotlib is not installed, and a group has a plot.
        OSError: a file can't be written; the message names it.
    """
    file = Path(path)
    shown = strips(document, pictures)
    files = []
    for name, drawn in plots(document, file.stem).items():
        files.append(file.with_name(f"{name}.svg"))
        with atomic.replacement(files[-1]) as temporary:
            temporary.write_text(drawn, encoding="utf-8")
    for name, case in zip(_names(document, file.stem), shown, strict=True):
        if case:
            files.append(file.with_name(f"{name}.jpg"))
            with atomic.replacement(files[-1]) as temporary:
                _strip(pictures[case]).save(temporary, "JPEG", quality=_QUALITY)
    with atomic.replacement(file) as temporary:
        temporary.write_text(page({**document, "strips": shown}, file.stem), encoding="utf-8")
    return [file, *files]


def strips(document: Mapping[str, Any], pictures: Mapping[str, Pictures]) -> list[str]:
    """Return for each group of a document the case whose pictures are shown; "" for none."""
    found = (_best(results, pictures) for results in groups(document["results"]).values())
    return [best["name"] if best else "" for best in found]


def plots(document: Mapping[str, Any], stem: str) -> dict[str, str]:
    """Return name of a file, without its ending -> SVG, of each group that has a plot."""
    drawn = {}
    for name, (key, results) in zip(_names(document, stem), groups(document["results"]).items(), strict=True):
        shown = sorted({r["family"] for r in results if metric(r, "world", "rmse") is not None})
        drawn[name] = plot(results, looks(shown, list(PEERS)), title(key), key[0])
    return {name: drawing for name, drawing in drawn.items() if drawing}


def page(document: Mapping[str, Any], stem: str) -> str:
    """Return the page: a function of the document alone.

    Args:
        document: see `document`; its `strips` are what the function of that name returns.
        stem: with which the names of plots and pictures begin.
    """
    device, machine = document["device"], document["machine"]
    lines = [
        "# Run time against error",
        "",
        f"{device['label']}, {device['variant']}; {machine['cpu']}, {machine['threads']} threads. "
        f"Revision {revision(document)}, {document['created']}. "
        f"C{calibration_line(document['calibration'])[1:]}. "
        f"Reference: {document['reference']['name']}, {number(document['reference']['ms'])} ms.",
    ]
    if document.get("quick"):
        lines += ["", f"**{TRIAL}**"]
    for text in LEGEND:
        lines += ["", text]
    lines += _guides(document)
    shown = document.get("strips") or [""] * len(groups(document["results"]))
    for name, strip, (key, results) in zip(
        _names(document, stem), shown, groups(document["results"]).items(), strict=True
    ):
        lines += ["", f"## {title(key)}", ""]
        if has_plot(results):
            lines += [f"![{title(key)}: error over time]({name}.svg)", ""]
        said = [f"- {each}" for each in verdict(results)]
        lines += [*said, ""] if said else []
        streaks = _STREAKS if any(metric(result, "world", "streaks") is not None for result in results) else ()
        head = (*_HEAD, *streaks, *(_OF_FRAMES if key[0] == "radiance" else _OF_MODELS), "counted")
        lines += markdown(head, (_row(result, streaks) for result in results), f"ll{'r' * (len(head) - 3)}l")
        if strip:
            case = strip.rsplit(".", 2)[0]
            lines += [
                "",
                f"![{case}, reference, error]({name}.jpg)",
                "",
                f"*{case}; reference; error from blue, {-OCCLUSION_RANGE}, to orange, "
                f"+{OCCLUSION_RANGE} (of light, half the reference's luminance).*",
            ]
    lines += ["", *(f"- {entry['name']}: {entry['reason']}" for entry in document["skipped"])]
    return "\n".join(lines).rstrip() + "\n"


def _guides(document: Mapping[str, Any]) -> list[str]:
    """Return the tables of what has the least error within a time."""
    found = guides(document)
    if not found:
        return []
    lines = ["", "## The least error within a time", "", "Setting and RMSE, by median wall time."]
    for case, (head, *rows) in found.items():
        lines += ["", f"{case}:", "", *markdown(head, rows, "r" + "l" * len(head[1:]))]
    return lines


def _names(document: Mapping[str, Any], stem: str) -> list[str]:
    """Return with what the names of the files of each group begin."""
    return [
        f"{stem}-{quantity}-{scene}-{columns}x{rows}"
        for quantity, scene, (rows, columns) in groups(document["results"])
    ]


def _best(results: list[dict[str, Any]], pictures: Mapping[str, Pictures]) -> dict[str, Any] | None:
    """Return this library's result on the front that has the least error and pictures."""
    shown = [
        (error, result)
        for result in results
        if result["front"]
        and result["family"] not in PEERS
        and result["name"] in pictures
        and (error := metric(result, "world", "rmse")) is not None
    ]
    return min(shown, key=lambda pair: pair[0])[1] if shown else None


def _strip(of: Pictures) -> Image.Image:
    """Return result, truth and error map beside one another."""
    world = of.result if of.world is None else of.world
    exposure = 1.0 if world.ndim == 2 else exposure_of(world, of.seen)
    parts = [
        np.broadcast_to(np.atleast_3d(part), (*of.seen.shape, 3))
        for part in (encoded(of.result, exposure), encoded(world, exposure), error_colors(of.result, world, of.seen))
    ]
    strip = Image.fromarray(np.concatenate(parts, axis=1))
    if strip.width > _STRIP:
        strip = strip.resize((_STRIP, round(strip.height * _STRIP / strip.width)))
    return strip


def _row(result: Mapping[str, Any], streaks: Sequence[str]) -> tuple[str, ...]:
    world = [
        number(metric(result, "world", name), "+" if name == "bias" else "")
        for name in ("bias", "mrse", "ssim", "flip", *streaks)
    ]
    last: tuple[str, ...]
    if result["quantity"] == "radiance":  # of frames, which have no model
        last = (number(metric(result, "world", "mottling")),)
    else:
        last = (rmse(result, "assumption"), number(metric(result, "assumption", "bias"), "+"))
    return (
        star(result).replace("*", "\\*"),
        short_name(result),
        milliseconds(result),
        quartiles(result),
        device_milliseconds(result),
        rmse(result, "world"),
        *world,
        *last,
        result.get("counted") or "",
    )
