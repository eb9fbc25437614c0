"""Frame graph: stages in their order, of which those run that the outputs need.

`Graph` alone decides what runs: it culls what no output needs, skips by condition, reuses what did
not change, and notes why. After FrameGraph (O'Donnell, GDC 2017, "FrameGraph: Extensible Rendering
Architecture in Frostbite"). Departs: results are kept from frame to frame, and hints are told from
inputs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from time import perf_counter
from typing import Any, NamedTuple

from ssgi_cl.core import checks
from ssgi_cl.device.progress import Told
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.record import GraphRecord, StageRecord, device_bytes
from ssgi_cl.frame.skips import same
from ssgi_cl.frame.stage import WANTED, Stage, Values

UNCHANGED = "all that it is made of stays the same"
"""Reason of a stage whose results are reused."""
READERS_REUSED = "what would read it is reused"


class GraphRun(NamedTuple):
    """Results of a run of a graph.

    Attributes:
        values: all resources by name; None, or no entry, where there is nothing.
        passes: of the frame, in order.
        record: what became of each stage and resource. It holds no device memory.
    """

    values: Values
    passes: tuple[PassTime, ...]
    record: GraphRecord


class _Outcome(NamedTuple):
    """Outcome of a stage: `StageRecord.state`, `.why` and `.host_ms`; `first` and `end` are the places of its passes,
    skipped ones counted, in those of the frame."""

    state: str
    why: str = ""
    first: int = 0
    end: int = 0
    host_ms: float = 0.0


class Graph:
    """The stages of a frame, and their latest results.

    Args:
        runtime: the device.
        stages: in their order: each comes after those whose results it reads.
        keep: whether results are reused.

    Attributes:
        stages: as given.
        costs: ms by name of stage and pass, from the latest run of each: the estimate of what a
            skip saves.
        device_bytes: device memory of each resource that a stage made, by name.

    Raises:
        ValueError: a name that occurs twice, or a stage that reads what a later one writes.
    """

    def __init__(self, runtime: Runtime, stages: Sequence[Stage], *, keep: bool = True) -> None:
        self.runtime = runtime
        self.stages = tuple(stages)
        self.keep = keep
        self.costs: dict[str, float] = {}
        self.device_bytes: dict[str, int] = {}
        self._writer = _writers_of(stages)
        self._inputs = {stage.name: tuple(dict.fromkeys(self._inputs_of(stage))) for stage in stages}
        self._made: dict[str, tuple[tuple[object, ...], tuple[Any, ...]]] = {}
        self._versions = dict.fromkeys(self._inputs, 0)

    def run(
        self, given: Values, outputs: Iterable[str], also: Iterable[str] = (), tell: Told | None = None
    ) -> GraphRun:
        """Run what `outputs` need, and wait for it.

        Should a stage raise, nothing is taken for made by it.

        Args:
            given: resources that the caller brings; one that is None counts as not given.
            outputs: resources asked for.
            also: resources that the caller reads afterwards where `outputs` need them; they live
                as long as outputs.
            tell: called after each stage, when the device is done with it, with the share of stages that is done;
                below 1, which what is made of the outputs is.

        Raises:
            ValueError: an output that no stage writes, or a resource that is read and neither
                written nor given.
        """
        given = {name: value for name, value in given.items() if value is not None}
        outputs = frozenset(outputs)
        left_out = self._left_out(given, outputs, {**given, "outputs": outputs})
        log: dict[str, _Outcome] = {}
        with self.runtime.frame(self.costs):
            values = self._run(given, outputs, left_out, log, tell)
            passes = tuple(self.runtime.times())
        return GraphRun(values, passes, self._record(given, outputs, log, passes, also))

    def forget(self, name: str) -> None:
        """Have the next run make what a stage writes, whatever its inputs are."""
        self._made.pop(name, None)

    def planned(self, given: Iterable[str], outputs: Iterable[str]) -> GraphRecord:
        """Return the record of a run in which no stage is idle and nothing is reused."""
        outputs = frozenset(outputs)
        left_out = self._left_out(given, outputs, None)
        runs = {stage.name: _Outcome(*left_out.get(stage.name, ("planned", ""))) for stage in self.stages}
        return self._record(given, outputs, runs)

    def _record(
        self,
        given: Iterable[str],
        outputs: frozenset[str],
        log: Mapping[str, _Outcome],
        passes: tuple[PassTime, ...] = (),
        also: Iterable[str] = (),
    ) -> GraphRecord:
        stages = []
        for stage in self.stages:
            state, why, first, end, host_ms = log[stage.name]
            ran, skips = (tuple(p for p in passes[first:end] if bool(p.skipped) == left) for left in (False, True))
            latest = self.costs.get(stage.name)
            names = stage.reads, stage.hints, stage.writes
            stages.append(StageRecord(stage.name, state, why, host_ms, latest, *names, ran, skips))
        memory = self.runtime.memory
        return GraphRecord(
            f"{self.runtime.info.label}, {self.runtime.variant}",
            tuple(sorted(outputs)),
            tuple(stages),
            {"used": memory.used, "peak": memory.peak, "limit": memory.limit},
            sizes=dict(self.device_bytes),
            given=frozenset(given),
            held=outputs.union(also),
            kept=frozenset(name for s in self.stages if self.keep and not s.on_demand for name in s.writes),
        )

    def _left_out(
        self, given: Iterable[str], outputs: frozenset[str], facts: Values | None
    ) -> dict[str, tuple[str, str]]:
        """Return (state, why) of the stages that do not run whatever is kept, by name.

        Conditions are called with `facts`, readers before writers; without, no stage is idle.
        """
        given = frozenset(given)
        for name in outputs - given:
            checks.choice("an output", name, tuple(self._writer))
        found: dict[str, tuple[str, str]] = {}
        asked, needed = set(outputs), set(outputs)  # by stages that are not culled; by those not idle either
        for stage in reversed(self.stages):
            if given.issuperset(stage.writes):
                found[stage.name] = "culled", f"the caller gives {', '.join(stage.writes)}"
                continue
            if asked.isdisjoint(stage.writes):
                found[stage.name] = "culled", "no output needs it"
                continue
            asked.update(stage.uses)
            for name in stage.reads:
                if name not in self._writer and name not in given:
                    raise ValueError(
                        f"stage {stage.name!r} reads {name!r}, which no stage writes and which is not given; "
                        f"stages write {', '.join(self._writer)}"
                    )
            if needed.isdisjoint(stage.writes):
                found[stage.name] = "unneeded", "what would read it is idle"
            elif facts is not None and stage.condition is not None and (why := stage.condition(facts)):
                found[stage.name] = "idle", why
            else:
                needed.update(stage.uses)
        return found

    def _inputs_of(self, stage: Stage) -> Iterable[str]:
        """Give the resources whose change makes a stage run again: in place of one that is made on
        demand, what that is made of."""
        for name in stage.reads:
            writer = self._writer.get(name)
            if writer is not None and writer.on_demand:
                yield from self._inputs_of(writer)
            else:
                yield name

    def _run(
        self,
        given: Values,
        outputs: frozenset[str],
        left_out: Mapping[str, tuple[str, str]],
        log: dict[str, _Outcome],
        tell: Told | None,
    ) -> dict[str, Any]:
        """Run stages in their order; return all resources, and note in `log` what became of each."""
        wanted = frozenset(name for stage in self.stages if stage.name not in left_out for name in stage.writes)
        values = {**given, WANTED: wanted}
        for number, stage in enumerate(self.stages, 1):
            state, why = left_out.get(stage.name, ("", ""))
            if state:
                told = {"culled": stage.culled, "idle": why}.get(state, "")
                log[stage.name] = self._not_run(stage, state, why, told)
            elif not stage.on_demand or not outputs.isdisjoint(stage.writes):
                self._bring(stage, values, log)
            if tell is not None:
                self.runtime.finish()
                tell(number / (len(self.stages) + 1))
        for stage in self.stages:
            if stage.name not in log:
                log[stage.name] = self._not_run(stage, "unneeded", READERS_REUSED, READERS_REUSED)
        return values

    def _not_run(self, stage: Stage, state: str, why: str, told: str) -> _Outcome:
        """Return the entry of a stage that does not run; list it among the passes if `told` is a reason."""
        first = self.runtime.noted
        if told:
            self.runtime.skip(stage.name, told)
        return _Outcome(state, why, first, self.runtime.noted)

    def _bring(self, stage: Stage, values: dict[str, Any], log: dict[str, _Outcome]) -> None:
        """Make what a stage writes, or take what it made of the same inputs."""
        name, kept = stage.name, self.keep and not stage.on_demand
        inputs = tuple(self._input(each, values, log) for each in self._inputs[name] if kept)
        inputs += tuple(each in values[WANTED] for each in stage.foresees)
        made = self._made.get(name)
        if made is not None and same(made[0], inputs):
            log[name] = self._not_run(stage, "reused", UNCHANGED, UNCHANGED)
            values.update(zip(stage.writes, made[1], strict=True))
            return
        for each in stage.uses:
            writer = self._writer.get(each)
            if writer is not None and writer.on_demand and writer.name not in log:
                self._bring(writer, values, log)
        # Should it fail, nothing is taken for made.
        for each in (name, *stage.releases):
            self._made.pop(each, None)
        self._versions[name] += 1
        first, start = self.runtime.noted, perf_counter()
        with self.runtime.part(name):
            results = stage.results(values)
        log[name] = _Outcome("ran", "", first, self.runtime.noted, (perf_counter() - start) * 1e3)
        values.update(zip(stage.writes, results, strict=True))
        self.device_bytes.update(zip(stage.writes, map(device_bytes, results), strict=True))
        if kept:
            self._made[name] = inputs, results

    def _input(self, name: str, values: Values, log: Mapping[str, _Outcome]) -> object:
        """Return what tells whether a resource changed: a number itself, of a given resource its
        `key` if it has one, of one that a stage made how often it was made."""
        value, writer = values.get(name), self._writer.get(name)
        if name not in values or isinstance(value, float):
            return value
        if writer is None or log[writer.name].state == "culled":
            return getattr(value, "key", value)
        return self._versions[writer.name]


def _writers_of(stages: Sequence[Stage]) -> dict[str, Stage]:
    """Return the stage that writes each resource, of stages in their order."""
    writers: dict[str, Stage] = {}
    names: set[str] = set()
    for stage in stages:
        if stage.name in names:
            raise ValueError(f"two stages are called {stage.name!r}: expected a name for each")
        names.add(stage.name)
        for name in stage.writes:
            if name in writers:
                raise ValueError(f"stages {writers[name].name!r} and {stage.name!r} both write {name!r}: expected one")
            writers[name] = stage
    done: set[str] = set()
    for stage in stages:
        for name in stage.uses:
            if name in writers and name not in done:
                raise ValueError(
                    f"stage {stage.name!r} reads {name!r} before stage {writers[name].name!r} writes it: "
                    "expected it after that in the list"
                )
        done.update(stage.writes)
    return writers
