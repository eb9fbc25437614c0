"""The picture of a frame graph as SVG: stages in layers, and the lifetimes of resources below."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from ssgi_cl.frame.graph_layout import Layout, layout, mebibytes, readers

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord, ResourceRecord, StageRecord

BOX = 244.0
LINE = 14.0
BETWEEN = 58.0
"""Height between two layers, where the names of resources stand, px."""
EDGE = 24.0
CELL = 26.0
NAMES = 190.0
SIZES = 80.0
COLUMNS = 39
"""Characters of a line in a box."""
MOST_SKIPS = 3
"""Skips that a box lists; more are counted."""
COLORS = (
    "#2f6db3",
    "#b3552f",
    "#3f8f4f",
    "#8a4fa3",
    "#b08a1e",
    "#1f8f8f",
    "#a33f66",
    "#5b6b7b",
    "#6a7f1f",
    "#4f4fa3",
    "#9a6a3f",
    "#2f7f5f",
    "#7f3f3f",
    "#3f5f8f",
)
GREY = "#b5b9be"
LABEL = 'text-anchor="middle"'
"""Attributes of the names of resources, which stand on lines."""
_FILLS = {
    "ran": ("#e8f0fb", "#2f6db3", ""),
    "planned": ("#e8f0fb", "#2f6db3", ""),
    "reused": ("#e6f4e8", "#3f8f4f", ""),
    "idle": ("#ffffff", "#8a8f96", "5 3"),
    "unneeded": ("#ffffff", "#8a8f96", "5 3"),
    "culled": ("#fafafa", GREY, "1.5 3"),
}
_LEGEND = {"ran": "ran", "reused": "reused", "idle": "idle or not needed", "culled": "culled"}


@dataclass(frozen=True)
class _Box:
    stage: StageRecord
    number: int
    lines: tuple[str, ...]

    @property
    def height(self) -> float:
        return 34.0 + LINE * len(self.lines)


def svg(record: GraphRecord) -> str:
    """Return the picture as the text of an SVG file."""
    boxes = {
        stage.name: _Box(stage, number, tuple(_lines(record, stage)))
        for number, stage in enumerate(record.stages, start=1)
    }
    places = layout(record, BOX)
    table = NAMES + SIZES + CELL * len(boxes) + CELL
    width = max(places.width, table, 560.0) + 2 * EDGE
    head, y = _head(record, width)
    tops, heights = [], []
    for layer in places.layers:
        heights.append(max((boxes[n].height for kind, n in layer if kind == "stage"), default=0.0))
        tops.append(y)
        y += heights[-1] + BETWEEN
    left = (width - places.width) / 2
    parts = [*head, *_wires(record, places, boxes, left, tops, heights)]
    most = max((box.stage.ms for box in boxes.values()), default=0.0)
    for row, layer in enumerate(places.layers):
        for kind, name in layer:
            if kind == "stage":
                x = left + places.x[row, (kind, name)] - BOX / 2
                parts += _draw_box(boxes[name], x, tops[row], most)
    parts += _lifetimes(record, y)
    height = y + 70.0 + 22.0 * sum(not each.given for each in record.resources)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="Helvetica, Arial, sans-serif" '
            'font-size="11">',
            f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
            *parts,
            "</svg>",
            "",
        ]
    )


def _head(record: GraphRecord, width: float) -> tuple[list[str], float]:
    """Return title, facts and legend, and where they end."""
    total = sum(stage.ms for stage in record.stages)
    held = sum(each.device_bytes or 0 for each in record.resources)
    facts = (
        record.device,
        f"{total:.2f} ms on the device; {mebibytes(held)} in resources, "
        f"{mebibytes(record.memory['used'])} of the device in use",
        f"outputs: {', '.join(record.outputs)}",
    )
    parts = [_text(EDGE, EDGE + 8, "Frame graph", "#111", 'font-size="15" font-weight="bold"')]
    y = EDGE + 28
    for line in (line for fact in facts for line in textwrap.wrap(fact, int(width / 6.8))):
        parts.append(_text(EDGE, y, line, "#333"))
        y += LINE + 2
    x = EDGE
    for state, text in _LEGEND.items():
        fill, stroke, dash = _FILLS[state]
        parts.append(
            f'<rect x="{x:.0f}" y="{y - 9:.0f}" width="16" height="10" rx="2" fill="{fill}" '
            f'stroke="{stroke}" stroke-dasharray="{dash or "none"}"/>' + _text(x + 21, y, text, "#555")
        )
        x += 40 + 6 * len(text)
    parts.append(
        f'<path d="M{x:.0f} {y - 4:.0f}h24" stroke="#555" stroke-dasharray="4 3"/>'
        + _text(x + 30, y, "hint: changes no bit of the result", "#555")
    )
    return parts, y + 24.0


def _lines(record: GraphRecord, stage: StageRecord) -> list[str]:
    """Return what stands in the box of a stage below its name."""
    given = {each.name for each in record.resources if each.given}
    lines = []
    if stage.why:
        lines += textwrap.wrap(f"{stage.state}: {stage.why}", COLUMNS)
    elif stage.state == "ran":
        count = len(stage.passes)
        passes = f"{count} pass{'' if count == 1 else 'es'}" if count else "no pass"
        lines.append(f"{passes}; host {stage.host_ms:.2f} ms")
    from_caller = [name for name in stage.reads if name in given]
    if from_caller and not stage.why:
        lines += textwrap.wrap(f"given: {', '.join(from_caller)}", COLUMNS)
    skips: dict[str, int] = {}
    for skip in stage.skips if not stage.why else ():
        text = f"skipped {skip.name}: {skip.skipped}"
        skips[text] = skips.get(text, 0) + 1
    for text, count in list(skips.items())[:MOST_SKIPS]:
        lines += textwrap.wrap(f"{count} x {text}" if count > 1 else text, COLUMNS)
    if len(skips) > MOST_SKIPS:
        lines.append(f"and {len(skips) - MOST_SKIPS} skips more")
    return lines


def _draw_box(box: _Box, x: float, y: float, most: float) -> list[str]:
    stage = box.stage
    fill, stroke, dash = _FILLS[stage.state]
    color = "#111" if stage.live else "#777"
    parts = [
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{BOX:.0f}" height="{box.height:.1f}" rx="5" '
        f'fill="{fill}" stroke="{stroke}" stroke-dasharray="{dash or "none"}"/>',
        _text(x + 10, y + 18, f"{box.number}  {stage.name}", color, 'font-size="13" font-weight="bold"'),
    ]
    if stage.state == "ran":
        parts.append(_text(x + BOX - 10, y + 18, f"{stage.ms:.2f} ms", color, 'font-size="13" text-anchor="end"'))
        share = (BOX - 20) * stage.ms / most if most > 0.0 else 0.0
        parts.append(f'<rect x="{x + 10:.1f}" y="{y + 23:.1f}" width="{share:.1f}" height="3" fill="{stroke}"/>')
    for number, line in enumerate(box.lines):
        parts.append(_text(x + 10, y + 40 + LINE * number, line, "#444" if stage.live else "#777"))
    return parts


def _wires(
    record: GraphRecord, places: Layout, boxes: dict[str, _Box], left: float, tops: list[float], heights: list[float]
) -> list[str]:
    """Return the lines from writers to readers, and the names of resources."""
    reading, color = readers(record), _colors(record)
    lines, names = [], []
    row_of = {name: row for row, layer in enumerate(places.layers) for kind, name in layer if kind == "stage"}
    shown = {each.name: _shown(each) for each in record.resources}
    for stage in record.stages:
        row = row_of[stage.name]
        for port, name in enumerate(stage.writes):
            shift = BOX * ((port + 1) / (len(stage.writes) + 1) - 0.5)
            at = left + places.x[row, ("stage", stage.name)] + shift
            y = tops[row] + boxes[stage.name].height
            if name in shown:
                ink = color[name] if stage.live else GREY
                names.append(_text(at, y + 13 + 13 * (port % 2), shown[name], ink, LABEL))
            last = max((row_of[reader] for reader in reading[name]), default=row)
            for below in range(row + 1, last + 1):
                for reader in reading[name]:
                    if row_of[reader] == below:
                        to = left + places.x[below, ("stage", reader)]
                        to += _entry(record, reader, name)
                        style = _style(color.get(name, GREY), stage, [boxes[reader].stage], name)
                        lines.append(_curve(at, y, to, tops[below], style))
                        lines.append(_arrow(to, tops[below], style))
                if below < last:
                    to = left + places.x[below, ("lane", name)]
                    further = [boxes[each].stage for each in reading[name] if row_of[each] > below]
                    style = _style(color.get(name, GREY), stage, further, name)
                    end = tops[below] + heights[below]
                    lines.append(_curve(at, y, to, tops[below], style))
                    lines.append(f'<path d="M{to:.1f} {tops[below]:.1f}V{end:.1f}" {style}/>')
                    at, y = to, end
    return lines + names


def _shown(resource: ResourceRecord) -> str:
    size = f", {mebibytes(resource.device_bytes)}" if resource.device_bytes else ""
    return f"{resource.name}{size}{' (output)' if resource.output else ''}"


def _style(color: str, writer: StageRecord, further: list[StageRecord], name: str) -> str:
    """Return how a line to some readers is drawn: grey if none runs, dashed if it is a hint."""
    live = writer.live and any(reader.live for reader in further)
    hint = all(name in reader.hints for reader in further)
    dash = ' stroke-dasharray="4 3"' if hint else ""
    return f'stroke="{color if live else GREY}" fill="none"{dash}'


def _entry(record: GraphRecord, reader: str, name: str) -> float:
    """Return where a line enters the box of a stage, from its centre, px."""
    written = {each for stage in record.stages for each in stage.writes}
    stage = next(stage for stage in record.stages if stage.name == reader)
    names = [each for each in (*stage.reads, *stage.hints) if each in written]
    return 0.8 * BOX * ((names.index(name) + 1) / (len(names) + 1) - 0.5)


def _curve(x: float, y: float, to: float, to_y: float, style: str) -> str:
    middle = (y + to_y) / 2
    return f'<path d="M{x:.1f} {y:.1f}C{x:.1f} {middle:.1f} {to:.1f} {middle:.1f} {to:.1f} {to_y:.1f}" {style}/>'


def _arrow(x: float, y: float, style: str) -> str:
    ink = style.split('"')[1]
    return f'<path d="M{x - 3.5:.1f} {y - 7:.1f}h7l-3.5 7z" fill="{ink}"/>'


def _lifetimes(record: GraphRecord, y: float) -> list[str]:
    """Return the table of resources: device memory, and the stages from first to last use."""
    color = _colors(record)
    start = EDGE + NAMES + SIZES
    parts = [
        _text(EDGE, y, "Lifetimes of resources, by the numbers of stages", "#111", 'font-size="13" font-weight="bold"'),
        _text(start - 16, y + 22, "device memory", "#555", 'text-anchor="end"'),
    ]
    column = {stage.name: start + CELL * i for i, stage in enumerate(record.stages)}
    for number, x in enumerate(column.values(), start=1):
        parts.append(_text(x + CELL / 2, y + 22, str(number), "#555", LABEL))
    row = y + 30.0
    for each in record.resources:
        if each.given:
            continue
        there = each.first is not None
        size = "host" if each.device_bytes == 0 else mebibytes(each.device_bytes or 0)
        if each.device_bytes is None:
            size = "not made"
        name = each.name + (", kept" if each.kept and there else "")
        ink = "#222" if there else "#999"
        parts.append(_text(EDGE, row + 14, name, ink))
        parts.append(_text(start - 16, row + 14, size, ink, 'text-anchor="end"'))
        if each.first is not None and each.last is not None:
            x = column[each.first]
            end = column[each.last] + CELL
            if each.output:
                end = start + CELL * len(column)
            parts.append(
                f'<rect x="{x + 3:.1f}" y="{row + 7:.1f}" width="{end - x - 6:.1f}" height="8" '
                f'rx="3" fill="{color[each.name]}" fill-opacity="0.35"/>'
            )
            for stage in record.stages:
                if stage.live and each.name in (*stage.reads, *stage.hints, *stage.writes):
                    parts.append(
                        f'<circle cx="{column[stage.name] + CELL / 2:.1f}" cy="{row + 11:.1f}" '
                        f'r="4" fill="{color[each.name]}"/>'
                    )
            if each.output:
                parts.append(_text(end + 4, row + 15, "output", "#555"))
        row += 22.0
    return parts


def _colors(record: GraphRecord) -> dict[str, str]:
    names = [each.name for each in record.resources if not each.given]
    return {name: COLORS[number % len(COLORS)] for number, name in enumerate(names)}


def _text(x: float, y: float, text: str, color: str, more: str = "") -> str:
    plain = f'<text x="{x:.1f}" y="{y:.1f}" fill="{color}" {more}>{escape(text)}</text>'
    if more != LABEL:
        return plain
    # White below, so that lines do not run through the letters.
    around = f'fill="#fff" stroke="#fff" stroke-width="4" {more}'
    return f'<text x="{x:.1f}" y="{y:.1f}" {around}>{escape(text)}</text>{plain}'
