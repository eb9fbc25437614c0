"""The plot of error over time of one group of results, as SVG."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from .document import clock, metric, timed
from .wording import number, short_name, unit

WIDTH, HEIGHT = 760, 420
LEFT, RIGHT, TOP, BOTTOM = 66, 24, 14, 48
PLOT_STYLE = """
:root { color-scheme: light dark; --page: #fcfcfa; --text: #1b1c1e; --soft: #5b5f66;
  --rule: #d9d9d4; --grid: #e7e7e2; --panel: #f3f3ee; --front: #8a8d92; --mark: #0072b2;
  --c0: #0072b2; --c1: #c04a00; --c2: #00815c; --c3: #b0568b; --c4: #946800; --c5: #6b4fc0;
  --c6: #4c4c4c; }
@media (prefers-color-scheme: dark) { :root { --page: #16181b; --text: #e6e6e3; --soft: #a0a5ad;
  --rule: #3a3e44; --grid: #272a2f; --panel: #1f2226; --front: #7d828a; --mark: #5ab4f0;
  --c0: #5ab4f0; --c1: #ff8a4a; --c2: #3fcf9f; --c3: #e29ac6; --c4: #f0b432; --c5: #b8a6ff;
  --c6: #c9c9c9; } }
.c0 { color: var(--c0); } .c1 { color: var(--c1); } .c2 { color: var(--c2); }
.c3 { color: var(--c3); } .c4 { color: var(--c4); } .c5 { color: var(--c5); }
.c6 { color: var(--c6); }
svg.plot { display: block; width: 100%; max-width: 56rem; height: auto; }
svg text { font: 12px system-ui, sans-serif; fill: currentColor; }
svg .middle { text-anchor: middle; } svg .end { text-anchor: end; }
svg > text { fill: var(--soft); } svg > text.name { fill: var(--text); }
svg path { fill: none; }
svg .grid { stroke: var(--grid); } svg .axis { stroke: var(--soft); }
svg .front { stroke: var(--front); stroke-width: 7; stroke-opacity: .35; stroke-linejoin: round; }
svg .line { stroke: currentColor; stroke-width: 1.8; } svg .dashed { stroke-dasharray: 5 4; }
svg .spread { stroke: currentColor; stroke-width: 1.2; }
svg .point { fill: currentColor; stroke: var(--page); stroke-width: 1; }
svg .unsteady { fill: var(--page); stroke: currentColor; stroke-width: 2; }
"""
"""Style sheet of a plot, by day and by night."""
COLORS = 7
"""Of families, as the style sheet numbers them."""
MARKERS = (
    "M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0z",  # circle
    "M-4-4h8v8h-8z",  # square
    "M0-5.8L5.8 0L0 5.8L-5.8 0z",  # diamond
    "M0-5.4L5.2 3.8H-5.2z",  # triangle
    "M0 5.4L5.2-3.8H-5.2z",  # triangle, upside down
)
_LETTER = 6.4  # width of a character of a label, at most
_LINE = 13.0  # height of a line of text


@dataclass(frozen=True)
class Axis:
    """A logarithmic axis: positions of values between two ends, in units of the drawing."""

    low: float
    high: float
    start: float
    end: float

    @classmethod
    def over(cls, values: Sequence[float], start: float, end: float) -> Axis:
        """Return an axis that holds all values > 0 with room at the ends: a factor of 3 or more."""
        positive = [value for value in values if value > 0.0] or [1.0]
        low, high = math.log10(min(positive)), math.log10(max(positive))
        room = max(0.5 * (0.48 - (high - low)), 0.07 * (high - low))
        return cls(low - room, high + room, start, end)

    def at(self, value: float) -> float:
        """Return the position of a value; of 0, the low end."""
        power = self.low if value <= 0.0 else max(self.low, math.log10(value))
        return self.start + (power - self.low) / (self.high - self.low) * (self.end - self.start)

    def ticks(self) -> list[float]:
        """Return the values to name: 1, 2 and 5 of each decade, or 1 alone of many decades."""
        steps = (1,) if self.high - self.low > 2.5 else (1, 2, 5)
        powers = range(math.floor(self.low), math.ceil(self.high) + 1)
        found = [step * 10.0**power for power in powers for step in steps]
        return [value for value in found if self.low <= math.log10(value) <= self.high]


def looks(families: Sequence[str], peers: Sequence[str]) -> dict[str, tuple[int, int, bool]]:
    """Return family -> (colour, marker, whether its line is dashed); dashed are peers."""
    return {family: (index % COLORS, index % len(MARKERS), family in peers) for index, family in enumerate(families)}


def plot(
    results: Sequence[Mapping[str, Any]], look: Mapping[str, tuple[int, int, bool]], title: str, quantity: str
) -> str:
    """Return an SVG element; "" if no result has an error against the world's truth.

    Args:
        results: of one group, the fastest first.
        look: see `looks`.
        title: names the plot to those who don't see it.
        quantity: whose unit the errors have.
    """
    found = [
        (clock(result), rmse, result) for result in results if (rmse := metric(result, "world", "rmse")) is not None
    ]
    points = [point for point in found if timed(point[2])]
    if not points:
        return ""
    across = Axis.over([time[name] for time, _, _ in points for name in ("low", "median", "high")], LEFT, WIDTH - RIGHT)
    up = Axis.over([rmse for _, rmse, _ in found], HEIGHT - BOTTOM, TOP)
    at = [(across.at(time["median"]), up.at(rmse), result) for time, rmse, result in points]
    bounds = [(up.at(rmse), result) for _, rmse, result in found if not timed(result)]
    parts = [*_frame(across, up, quantity), *_bounds(bounds, look), *_front(at), *_lines(at, look)]
    labels = _labels([(x, y, str(result["setting"])) for x, y, result in at])
    for (x, y, result), (time, rmse, _), label in zip(at, points, labels, strict=True):
        color, marker, _ = look[result["family"]]
        parts.append(
            f'<g class="c{color}"><title>{escape(_told(result, time, rmse))}</title>'
            f'<path class="spread" d="M{across.at(time["low"]):.1f} {y:.1f}'
            f'H{across.at(time["high"]):.1f}"/>'
            f'<path class="{"point unsteady" if result["unsteady"] else "point"}" '
            f'transform="translate({x:.1f} {y:.1f})" d="{MARKERS[marker]}"/>{label}</g>'
        )
    return (
        f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(title)}: RMSE over time, both logarithmic">{"".join(parts)}</svg>'
    )


def _told(result: Mapping[str, Any], time: Mapping[str, float], rmse: float) -> str:
    return (
        f"{short_name(result)}: {number(time['median'])} ms "
        f"({number(time['low'])} to {number(time['high'])}), RMSE {number(rmse)}"
        f"{unit(result['quantity'])}"
        f"{'; unsteady: ' + result['unsteady'] if result['unsteady'] else ''}"
    )


def _frame(across: Axis, up: Axis, quantity: str) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for value in across.ticks():
        x = across.at(value)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP}V{bottom}"/>')
        parts.append(f'<text x="{x:.1f}" y="{bottom + 17}" class="middle">{value:g}</text>')
    for value in up.ticks():
        y = up.at(value)
        parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{LEFT - 7}" y="{y + 4:.1f}" class="end">{value:g}</text>')
    parts.append(f'<path class="axis" d="M{LEFT} {TOP}V{bottom}H{right}"/>')
    parts.append(f'<text x="{(LEFT + right) / 2:.0f}" y="{HEIGHT - 9}" class="middle name">median time, ms</text>')
    parts.append(
        f'<text transform="translate(15 {(TOP + bottom) / 2:.0f}) rotate(-90)" '
        f'class="middle name">RMSE against the world{unit(quantity) and "," + unit(quantity)}'
        "</text>"
    )
    return parts


def _bounds(at: Sequence[tuple[float, Mapping[str, Any]]], look: Mapping[str, tuple[int, int, bool]]) -> list[str]:
    """Return a level line for each result that is a bound, named where there is room."""
    parts = []
    named: list[float] = []
    for y, result in at:
        told = f"{short_name(result)}: RMSE {number(metric(result, 'world', 'rmse'))}"
        text = ""
        if all(abs(y - other) >= _LINE for other in named):
            named.append(y)
            text = f'<text x="{WIDTH - RIGHT}" y="{y - 3:.1f}" class="end">{escape(short_name(result))}</text>'
        parts.append(
            f'<g class="c{look[result["family"]][0]}"><title>{escape(told)}</title>'
            f'<path class="spread" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>{text}</g>'
        )
    return parts


def _front(at: Sequence[tuple[float, float, Mapping[str, Any]]]) -> list[str]:
    """Return stairs: the least error that can be had within a time."""
    steps = sorted((x, y) for x, y, result in at if result.get("front"))
    if not steps:
        return []
    path = f"M{steps[0][0]:.1f} {steps[0][1]:.1f}"
    path += "".join(f"H{x:.1f}V{y:.1f}" for x, y in steps[1:])
    return [f'<path class="front" d="{path}H{WIDTH - RIGHT}"/>']


def _lines(
    at: Sequence[tuple[float, float, Mapping[str, Any]]], look: Mapping[str, tuple[int, int, bool]]
) -> list[str]:
    parts = []
    for family, (color, _, dashed) in look.items():
        own = [point for point in at if point[2]["family"] == family]
        if all(str(result["setting"]).isdecimal() for _, _, result in own):
            own.sort(key=lambda point: int(point[2]["setting"]))  # names stay in order of time
        if len(own) > 1:
            path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y, _ in own)
            style = "line dashed" if dashed else "line"
            parts.append(f'<path class="{style} c{color}" d="{path}"/>')
    return parts


def _labels(points: Sequence[tuple[float, float, str]]) -> list[str]:
    """Return a text element beside each point, where none covers a point or another text.

    Without such a place the text is left out; the point's title has it too.
    """
    taken = [(x - 6.0, y - 6.0, x + 6.0, y + 6.0) for x, y, _ in points]
    parts = []
    for x, y, text in points:
        wide = _LETTER * len(text)
        for anchor, dx, dy in (
            ("start", 8, -5),
            ("start", 8, 13),
            ("end", -8, -5),
            ("end", -8, 13),
            ("middle", 0, -10),
            ("middle", 0, 19),
            ("start", 10, 4),
            ("end", -10, 4),
        ):
            left = x + dx - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * wide
            place = (left, y + dy - 9.0, left + wide, y + dy + 2.0)
            inside = left >= LEFT and left + wide <= WIDTH and place[1] >= TOP
            if inside and place[3] <= HEIGHT - BOTTOM and not _overlaps(place, taken):
                taken.append(place)
                parts.append(f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" class="{anchor}">{escape(text)}</text>')
                break
        else:
            parts.append("")
    return parts


def _overlaps(place: tuple[float, float, float, float], taken: Sequence[tuple[float, float, float, float]]) -> bool:
    return any(
        place[0] < other[2] and other[0] < place[2] and place[1] < other[3] and other[1] < place[3] for other in taken
    )
