"""Record of a run of the frame graph: what became of each stage and resource, to be read, kept and drawn."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.graph_dot import dot
from ssgi_cl.frame.graph_mermaid import mermaid
from ssgi_cl.frame.stage import Stage

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


class StageRun(NamedTuple):
    """Outcome of a stage.

    Attributes:
        state: out of `STATES`.
        why: the reason, where it did not run.
        first, end: its passes, skipped ones counted, as places in those of the frame.
        host_ms: milliseconds that the host spent in it, reading back included.
    """

    state: str
    why: str = ""
    first: int = 0
    end: int = 0
    host_ms: float = 0.0


@dataclass(frozen=True)
class StageRecord:
    """A stage of a graph that was run.

    Attributes:
        name, state, why, host_ms: see `StageRun`.
        ms: milliseconds of its passes on the device.
        latest_ms: the same of the latest frame in which it ran, None if it never did.
        reads, hints, writes: names of resources, see `Stage`.
        passes: that ran in it.
        skips: passes and parts that were left out in it, and why.
    """

    name: str
    state: str
    why: str
    ms: float
    host_ms: float
    latest_ms: float | None
    reads: tuple[str, ...]
    hints: tuple[str, ...]
    writes: tuple[str, ...]
    passes: tuple[PassTime, ...]
    skips: tuple[PassTime, ...]

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


@dataclass(frozen=True)
class ResourceRecord:
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
    """A graph that was compiled and run.

    Attributes:
        device: label of the device and kernel variant.
        outputs: resources asked for.
        stages: in the order in which they run, those that did not run among them.
        resources: given ones first, then in the order in which they are written.
        memory: bytes of the device: "used" now, at the "peak", and the "limit".
    """

    device: str
    outputs: tuple[str, ...]
    stages: tuple[StageRecord, ...]
    resources: tuple[ResourceRecord, ...]
    memory: dict[str, int]

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
            entry = {**asdict(stage), "ms": round(stage.ms, 4), "host_ms": round(stage.host_ms, 4)}
            entry["passes"] = [{"name": p.name, "ms": round(p.ms, 4)} for p in stage.passes]
            entry["skips"] = [{"name": p.name, "why": p.skipped, "saved_ms": round(p.saved, 4)} for p in stage.skips]
            stages.append(entry)
        return json.dumps({**asdict(self), "stages": stages}, indent=1)

    def to_dot(self) -> str:
        """Return the graph in the language of Graphviz, see `dot`."""
        return dot(self)

    def to_mermaid(self) -> str:
        """Return the graph in the language of Mermaid, see `mermaid`."""
        return mermaid(self)


def graph_record(
    runtime: Runtime,
    stages: Sequence[Stage],
    runs: Mapping[str, StageRun],
    passes: Sequence[PassTime],
    costs: Mapping[str, float],
    sizes: Mapping[str, int],
    *,
    given: frozenset[str],
    outputs: frozenset[str],
    held: frozenset[str],
    keep: bool,
) -> GraphRecord:
    """Return the record of a run; its memory is that of now.

    Args:
        runtime: the device.
        stages: in their order; only their names and those of their resources are read.
        runs: what became of each stage, by name.
        passes: of the frame, in order.
        costs: ms of the latest run, by name of stage.
        sizes: bytes of device memory of each resource, by name.
        given: resources that the caller gave.
        outputs: resources asked for.
        held: resources that the caller reads after the run, `outputs` among them.
        keep: whether results are kept for the next frame.
    """
    records = []
    for stage in stages:
        run = runs[stage.name]
        own = passes[run.first : run.end]
        ran = tuple(p for p in own if not p.skipped)
        records.append(
            StageRecord(
                stage.name,
                run.state,
                run.why,
                sum(p.ms for p in ran),
                run.host_ms,
                costs.get(stage.name),
                stage.reads,
                stage.hints,
                stage.writes,
                ran,
                tuple(p for p in own if p.skipped),
            )
        )
    kept = {name for stage in stages if keep and not stage.on_demand for name in stage.writes}
    writers = {name: each for each in records for name in each.writes if name not in given}
    read = (name for each in records for name in each.reads if name in given)
    resources = []
    for name in dict.fromkeys((*read, *writers)):
        writer = writers.get(name)
        touching = [each.name for each in records if each.live and name in (*each.reads, *each.hints, *each.writes)]
        if writer is not None and not writer.live:
            touching = []
        resources.append(
            ResourceRecord(
                name,
                sizes.get(name) if writer is not None and touching else None,
                writer is None,
                name in held,
                writer is not None and name in kept,
                None if writer is None else writer.name,
                touching[0] if touching else None,
                touching[-1] if touching else None,
            )
        )
    memory, info = runtime.memory, runtime.info
    return GraphRecord(
        f"{info.label}, {runtime.variant}",
        tuple(sorted(outputs)),
        tuple(records),
        tuple(resources),
        {"used": memory.used, "peak": memory.peak, "limit": memory.limit},
    )


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
