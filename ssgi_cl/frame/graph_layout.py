"""Places of the stages and lines of a frame graph in a picture, by layers.

After Sugiyama, Tagawa and Toda 1981, "Methods for Visual Understanding of Hierarchical System
Structures": stages in layers, barycentres for their order. A resource has one line, however many
stages read it, which passes the layers between in a lane of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ssgi_cl.frame.record import GraphRecord

LANE = 16.0
"""Width that a line takes in a layer that it passes, px."""
GAP = 26.0
"""Least distance of two boxes, px."""
SWEEPS = 8

Node = tuple[str, str]
"""("stage", its name), or ("lane", the resource whose line passes a layer)."""


@dataclass(frozen=True)
class Layout:
    """A graph in layers.

    Attributes:
        layers: nodes from the top down, each from the left.
        x: centre of each node of each layer, px: (number of the layer, node) -> x.
        width: px.
    """

    layers: tuple[tuple[Node, ...], ...]
    x: Mapping[tuple[int, Node], float]
    width: float


def readers(record: GraphRecord) -> dict[str, list[str]]:
    """Return the stages that read each resource that a stage writes."""
    written = {name for stage in record.stages for name in stage.writes}
    found: dict[str, list[str]] = {name: [] for name in written}
    for stage in record.stages:
        for name in (*stage.reads, *stage.hints):
            if name in written:
                found[name].append(stage.name)
    return found


def layout(record: GraphRecord, box: float) -> Layout:
    """Return the places of stages that are `box` px wide."""
    level = _levels(record)
    layers: list[list[Node]] = [[] for _ in range(max(level.values(), default=-1) + 1)]
    above: dict[tuple[int, Node], list[Node]] = {}
    for stage in record.stages:
        layers[level[stage.name]].append(("stage", stage.name))
    reading = readers(record)
    for stage in record.stages:
        for name in stage.writes:
            start, last = level[stage.name], max((level[r] for r in reading[name]), default=0)
            source: Node = ("stage", stage.name)
            for row in range(start + 1, last + 1):
                for reader in reading[name]:
                    if level[reader] == row:
                        above.setdefault((row, ("stage", reader)), []).append(source)
                if row < last:
                    lane: Node = ("lane", name)
                    layers[row].append(lane)
                    above.setdefault((row, lane), []).append(source)
                    source = lane
    below: dict[tuple[int, Node], list[Node]] = {}
    for (row, node), sources in above.items():
        for each in sources:
            below.setdefault((row - 1, each), []).append(node)
    width = {"stage": box + GAP, "lane": LANE}
    x: dict[tuple[int, Node], float] = {}
    for row, nodes in enumerate(layers):
        _place(row, nodes, [0.0] * len(nodes), width, x)
    for sweep in range(SWEEPS):
        down = sweep % 2 == 0
        order = range(1, len(layers)) if down else range(len(layers) - 2, -1, -1)
        for row in order:
            near, step = (above, -1) if down else (below, 1)
            wished = {
                node: _mean([x[row + step, n] for n in near.get((row, node), [])], x[row, node]) for node in layers[row]
            }
            layers[row].sort(key=lambda node: wished[node])
            _place(row, layers[row], [wished[node] for node in layers[row]], width, x)
    least = min((x[key] - width[key[1][0]] / 2 for key in x), default=0.0)
    most = max((x[key] + width[key[1][0]] / 2 for key in x), default=0.0)
    return Layout(tuple(map(tuple, layers)), {key: place - least for key, place in x.items()}, most - least)


def _levels(record: GraphRecord) -> dict[str, int]:
    """Return the layer of each stage: below all whose results it reads, no higher than needed."""
    writer = {name: stage.name for stage in record.stages for name in stage.writes}
    level: dict[str, int] = {}
    for stage in record.stages:  # in an order in which writers come first
        before = [writer[name] for name in (*stage.reads, *stage.hints) if name in writer]
        level[stage.name] = max((level[name] + 1 for name in before), default=0)
    reading = readers(record)
    for stage in reversed(record.stages):
        lowest = [level[reader] - 1 for name in stage.writes for reader in reading[name]]
        if lowest and all(name not in writer for name in (*stage.reads, *stage.hints)):
            level[stage.name] = max(level[stage.name], min(lowest))
    return level


def _place(
    row: int, nodes: list[Node], wished: list[float], width: Mapping[str, float], x: dict[tuple[int, Node], float]
) -> None:
    """Place nodes in their order as near as may be to where they are wished."""
    places: list[float] = []
    for number, node in enumerate(nodes):
        least = -1e9
        if number:
            least = places[-1] + (width[nodes[number - 1][0]] + width[node[0]]) / 2
        places.append(max(wished[number], least))
    shift = _mean([w - p for w, p in zip(wished, places, strict=True)], 0.0)
    x.update({(row, node): place + shift for node, place in zip(nodes, places, strict=True)})


def _mean(values: list[float], default: float) -> float:
    return sum(values) / len(values) if values else default


def mebibytes(size: int) -> str:
    """Return a number of bytes in MiB, or KiB where that is less than a tenth."""
    return f"{size / 2**20:.1f} MiB" if size >= 2**20 / 10 else f"{size / 2**10:.1f} KiB"
