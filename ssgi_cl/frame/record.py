"""Record of a run of the frame graph: what became of each stage and resource, to be read, kept and drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.graph_dot import dot
from ssgi_cl.frame.graph_mermaid import mermaid

STATES = {
    "ran": "ran",
    "reused": "its results are those of an earlier frame: what it reads is the same",
    "idle": "its condition says that there is nothing to do",
    "unneeded": "only stages would read it that are idle or reused",
    "culled": "no output needs it, or the caller gives what it writes",
    "planned": "not run yet",
}
"""Meaning of each state of a stage."""

MOST_SHARE = 0.25
"""Share of a frame's device time above which drawings show a stage as a group of its kernels."""


class StageRecord(NamedTuple):
    """A stage of a graph that was run.

    Attributes:
        name: of the stage.
        state: out of `STATES`.
        why: the reason, where it did not run.
        host_ms: milliseconds that the host spent in it, reading back included.
        latest_ms: milliseconds of its passes on the device in the latest frame in which it ran,
            None if it never did.
        reads, hints, writes: names of resources, see `Stage`.
        passes: that ran in it.
        skips: passes and parts that were left out in it, and why.
    """

    name: str
    state: str
    why: str
    host_ms: float
    latest_ms: float | None
    reads: tuple[str, ...]
    hints: tuple[str, ...]
    writes: tuple[str, ...]
    passes: tuple[PassTime, ...]
    skips: tuple[PassTime, ...]

    @property
    def ms(self) -> float:
        """Milliseconds of its passes on the device."""
        return sum(each.ms for each in self.passes)

    @property
    def live(self) -> bool:
        """Whether its resources are there."""
        return self.state in ("ran", "reused", "planned")

    @property
    def kernels(self) -> dict[str, tuple[int, float]]:
        """Number and milliseconds of its passes by kernel, in the order of their first passes."""
        found: dict[str, tuple[int, float]] = {}
        for each in self.passes:
            count, ms = found.get(each.name, (0, 0.0))
            found[each.name] = count + 1, ms + each.ms
        return found

    def text(self, total: float) -> str:
        """Return what drawings say of it, line by line, in a frame of `total` milliseconds on the device."""
        notes = [self.why] if self.why else [f"{skip.name}: {skip.skipped}" for skip in self.skips]
        return "\n".join([self.name, duration(self.ms, total) if self.state == "ran" else self.state, *notes])


class ResourceRecord(NamedTuple):
    """A resource of a graph that was run.

    Attributes:
        name: of the resource.
        device_bytes: device memory that holds it; 0 of one on the host; None if it was never made
            or the caller gave it.
        given: whether the caller gave it.
        output: whether the caller reads it after the last stage.
        kept: whether it is kept for the next frame.
        writer: the stage that writes it, None if it was given.
        first, last: the first and the last stage that touches it, in the order of the frame; None
            if none does.
    """

    name: str
    device_bytes: int | None
    given: bool
    output: bool
    kept: bool
    writer: str | None
    first: str | None
    last: str | None


@dataclass(frozen=True)
class GraphRecord:
    """A graph that was run.

    Attributes:
        device: label of the device and kernel variant.
        outputs: resources asked for.
        stages: in the order in which they run, those that did not run among them.
        memory: bytes of the device after the run: "used", at the "peak", and the "limit".
        sizes: bytes of device memory by resource, of those that a stage ever made.
        given: resources that the caller gave.
        held: resources that the caller reads after the last stage.
        kept: resources that are kept for the next frame.
    """

    device: str
    outputs: tuple[str, ...]
    stages: tuple[StageRecord, ...]
    memory: Mapping[str, int]
    sizes: Mapping[str, int]
    given: frozenset[str]
    held: frozenset[str]
    kept: frozenset[str]

    @property
    def resources(self) -> tuple[ResourceRecord, ...]:
        """Given resources first, then the others in the order in which they are written."""
        writers = {name: each for each in self.stages for name in each.writes if name not in self.given}
        read = (name for each in self.stages for name in each.reads if name in self.given)
        found = []
        for name in dict.fromkeys((*read, *writers)):
            writer = writers.get(name)
            there = writer is None or writer.live
            users = [each for each in self.stages if there and each.live]
            touching = [each.name for each in users if name in (*each.reads, *each.hints, *each.writes)]
            found.append(
                ResourceRecord(
                    name,
                    device_bytes=self.sizes.get(name) if writer is not None and touching else None,
                    given=writer is None,
                    output=name in self.held,
                    kept=writer is not None and name in self.kept,
                    writer=None if writer is None else writer.name,
                    first=touching[0] if touching else None,
                    last=touching[-1] if touching else None,
                )
            )
        return tuple(found)

    @property
    def ms(self) -> float:
        """Milliseconds of all passes on the device."""
        return sum(stage.ms for stage in self.stages)

    def boxes(self, stage: StageRecord) -> list[str]:
        """Return the text of each box of a stage in drawings: of one, or of each kernel where the stage takes more than
        `MOST_SHARE` of the frame and has several."""
        if stage.ms <= MOST_SHARE * self.ms or len(stage.kernels) < 2:
            return [stage.text(self.ms)]
        return [
            f"{name}{f' x {count}' if count > 1 else ''}\n{duration(ms, self.ms)}"
            for name, (count, ms) in stage.kernels.items()
        ]

    def to_json(self) -> str:
        """Return the record as JSON: one object.

        Keys: `device`, `outputs`, `memory` (bytes: `used`, `peak`, `limit`), `stages` and
        `resources`, two lists of objects with the attributes of `StageRecord` and `ResourceRecord`
        as keys. Passes have `name` and `ms`; skips have `name`, `why` and `saved_ms`, an estimate.
        """
        stages = []
        for stage in self.stages:
            entry = {**stage._asdict(), "ms": round(stage.ms, 4), "host_ms": round(stage.host_ms, 4)}
            entry["passes"] = [{"name": p.name, "ms": round(p.ms, 4)} for p in stage.passes]
            entry["skips"] = [{"name": p.name, "why": p.skipped, "saved_ms": round(p.saved, 4)} for p in stage.skips]
            stages.append(entry)
        resources = [each._asdict() for each in self.resources]
        whole = {"device": self.device, "outputs": self.outputs, "memory": self.memory}
        return json.dumps({**whole, "stages": stages, "resources": resources}, indent=1)

    def to_dot(self) -> str:
        """Return the graph in the language of Graphviz, see `dot`."""
        return dot(self)

    def to_mermaid(self) -> str:
        """Return the graph in the language of Mermaid, see `mermaid`."""
        return mermaid(self)


def duration(ms: float, total: float) -> str:
    """Return a time in ms with its share of `total`."""
    return f"{ms:.2f} ms, {ms / total:.0%}" if total else f"{ms:.2f} ms"


def device_bytes(value: Any) -> int:
    """Return the device memory of a resource: of a plane or an array, of all in a list, or of all
    that another object has as attributes."""
    buffers: dict[int, int] = {}

    def visit(each: Any, deep: bool) -> None:
        if isinstance(each, (Plane, DeviceArray)):
            buffers[id(each.buffer)] = getattr(each.buffer, "size", 0)
        elif isinstance(each, (tuple, list)):
            for part in each:
                visit(part, deep)
        elif deep and hasattr(each, "__dict__"):
            for part in vars(each).values():
                visit(part, False)

    visit(value, True)
    return sum(buffers.values())
