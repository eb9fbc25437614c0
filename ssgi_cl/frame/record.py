"""What became of each stage and resource when a frame graph was run, to be read, kept and drawn."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.graph_dot import dot
from ssgi_cl.frame.graph_mermaid import mermaid

STATES = {
    "ran": "ran",
    "reused": "its results are those of an earlier frame: what it reads is the same",
    "idle": "its condition, or a resource that is not there, says that there is nothing to do",
    "unneeded": "only stages would read it that are idle or reused",
    "culled": "no output needs it, or the caller gives what it writes",
    "planned": "not run yet",
}
"""What may become of a stage."""


class StageRun(NamedTuple):
    """What became of a stage.

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
        return json.dumps(
            {
                "device": self.device,
                "outputs": self.outputs,
                "memory": self.memory,
                "stages": stages,
                "resources": [asdict(each) for each in self.resources],
            },
            indent=1,
        )

    def to_dot(self) -> str:
        """Return the graph in the language of Graphviz: stages are boxes, resources ellipses."""
        return dot(self)

    def to_mermaid(self) -> str:
        """Return the graph in the language of Mermaid: stages are boxes, resources rounded."""
        return mermaid(self)


@dataclass(frozen=True)
class StageNames:
    """The names of a stage and of its resources, see `Stage`, and whether its results are kept."""

    name: str
    reads: tuple[str, ...]
    hints: tuple[str, ...]
    writes: tuple[str, ...]
    kept: bool


@dataclass(frozen=True, eq=False)
class GraphLog:
    """What a run of a graph leaves: no resource, and nothing that holds device memory.

    Attributes:
        runtime: the device.
        outputs: resources asked for.
        also: others that the caller reads after the run where they are there.
        given: names of the resources that the caller gave.
        stages: in their order.
        runs: what became of each stage, by name.
        passes: of the frame, in order.
        costs: ms of the latest run, by name of stage.
        device_bytes: of each resource, by name.
    """

    runtime: Runtime
    outputs: frozenset[str]
    also: frozenset[str]
    given: frozenset[str]
    stages: tuple[StageNames, ...]
    runs: Mapping[str, StageRun]
    passes: tuple[PassTime, ...]
    costs: Mapping[str, float]
    device_bytes: Mapping[str, int]

    def record(self) -> GraphRecord:
        """Return the record; its memory is that of now."""
        stages = []
        for stage in self.stages:
            run = self.runs[stage.name]
            own = self.passes[run.first : run.end]
            ran = tuple(p for p in own if not p.skipped)
            stages.append(
                StageRecord(
                    stage.name,
                    run.state,
                    run.why,
                    sum(p.ms for p in ran),
                    run.host_ms,
                    self.costs.get(stage.name),
                    stage.reads,
                    stage.hints,
                    stage.writes,
                    ran,
                    tuple(p for p in own if p.skipped),
                )
            )
        memory, info = self.runtime.memory, self.runtime.info
        return GraphRecord(
            f"{info.label}, {self.runtime.variant}",
            tuple(sorted(self.outputs)),
            tuple(stages),
            tuple(self._resources(stages)),
            {"used": memory.used, "peak": memory.peak, "limit": memory.limit},
        )

    def _resources(self, stages: Sequence[StageRecord]) -> Iterator[ResourceRecord]:
        kept = {name for stage in self.stages if stage.kept for name in stage.writes}
        writers = {name: each for each in stages for name in each.writes if name not in self.given}
        read = (name for stage in stages for name in stage.reads if name in self.given)
        for name in dict.fromkeys((*read, *writers)):
            writer = writers.get(name)
            touching = [
                stage.name for stage in stages if stage.live and name in (*stage.reads, *stage.hints, *stage.writes)
            ]
            if writer is not None and not writer.live:
                touching = []
            given = writer is None
            yield ResourceRecord(
                name,
                None if given or not touching else self.device_bytes.get(name),
                given,
                name in self.outputs | self.also,
                not given and name in kept,
                None if writer is None else writer.name,
                touching[0] if touching else None,
                touching[-1] if touching else None,
            )


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
