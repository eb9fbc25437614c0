"""The part of a report that shows results beside their truths and errors."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from .pictures import DARK_SHARE, LIGHT_RANGE, OCCLUSION_RANGE, error_map, exposure_of, picture, scale
from .wording import number, short_name

if TYPE_CHECKING:
    from .suite import Pictures

SMALLEST = 480
"""Pixels of the page that a picture is wide, at least, where there is room."""

_SIDES = {"world": "truth", "error": "error", "assumption": "truth, same model", "error2": "error, same model"}


class Album:
    """Pictures of a page, each kept once.

    Attributes:
        uris: id -> data URI.
    """

    def __init__(self) -> None:
        self.uris: dict[str, str] = {}
        self._ids: dict[str, str] = {}

    def add(self, uri: str) -> str:
        """Return the picture's id."""
        name = self._ids.setdefault(uri, f"p{len(self._ids)}")
        self.uris[name] = uri
        return name


def html(index: int, results: list[dict[str, Any]], pictures: Mapping[str, Pictures], album: Album) -> str:
    """Return a viewer of a group's pictures; "" if it has none.

    Light is shown at one exposure for the whole group, that of the first truth.

    Args:
        index: of the group, unique on the page.
        results: of the group; the first is shown first.
        pictures: by the name of the case.
        album: gets the pictures.
    """
    shown = [(result, pictures[result["name"]]) for result in results if result["name"] in pictures]
    shown = [(result, of) for result, of in shown if _truths(of)]
    if not shown:
        return ""
    exposure = 1.0
    first = shown[0][1]
    light = first.result.ndim == 3
    if light:
        exposure = exposure_of(next(iter(_truths(first).values())), first.seen)
    options: list[str] = []
    sides: set[str] = set()
    for result, of in shown:
        ids = {"result": album.add(picture(of.result, exposure))}
        for side, truth in _truths(of).items():
            error = "error" if side == "world" else "error2"
            ids[side] = album.add(picture(truth, exposure))
            ids[error] = album.add(error_map(of.result, truth, of.seen))
        sides |= ids.keys()
        data = " ".join(f'data-{name}="{value}"' for name, value in ids.items())
        options.append(f"<option {data}>{escape(short_name(result))}</option>")
    available = {name: word for name, word in _SIDES.items() if name in sides}
    rows, columns = shown[0][1].result.shape[:2]
    choices = "".join(
        f'<label><input type="radio" name="side-{index}" value="{name}"{" checked" if i == 0 else ""}> {word}</label>'
        for i, (name, word) in enumerate(available.items())
    )
    first_name = escape(short_name(shown[0][0]))
    return (
        "<h3>Pictures</h3><noscript><p>The pictures need JavaScript.</p></noscript>"
        '<figure class="viewer"><div class="controls">'
        f"<label>Case <select>{''.join(options)}</select></label>"
        f"<fieldset><legend>Right of the line</legend>{choices}</fieldset></div>"
        f'<div style="max-width:{max(columns, SMALLEST)}px">'
        f'<div class="stage" style="aspect-ratio:{columns}/{rows}">'
        f'<img alt="{next(iter(available.values()))} of {first_name}" draggable="false">'
        f'<img class="left" alt="result of {first_name}" draggable="false">'
        '<span class="cut"></span><span class="tag result">result</span>'
        '<span class="tag other"></span></div>'
        '<input type="range" min="0" max="100" step="0.5" value="50" '
        'aria-label="How much of the width shows the result, per cent"></div>'
        f"{_scale(light)}<figcaption>{_shown_how(light, exposure)}</figcaption></figure>"
    )


def _truths(of: Pictures) -> dict[str, Any]:
    both = {"world": of.world, "assumption": of.assumption}
    return {name: truth for name, truth in both.items() if truth is not None}


def _scale(light: bool) -> str:
    end = f"{100 * LIGHT_RANGE:g} %" if light else f"{OCCLUSION_RANGE:g}"
    colors = "".join(f'<i style="background:rgb({r},{g},{b})"></i>' for r, g, b in scale())
    return (
        f'<div class="scale" hidden><span>too dark, -{end} or less</span>'
        f'<span class="colors" aria-hidden="true">{colors}</span>'
        f"<span>+{end} or more, too bright</span></div>"
    )


def _shown_how(light: bool, exposure: float) -> str:
    if not light:
        return "Black is 0 and white is 1, without gamma. Errors are result minus truth; grey is not compared."
    return (
        f"Every picture of this group: times {number(exposure)}, filmic curve, sRGB. Errors are "
        f"those of luminance over the truth's, to which {100 * DARK_SHARE:g} % of its mean is "
        "added; grey is not compared."
    )
