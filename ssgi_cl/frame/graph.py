"""The frame graph: stages compiled from the outputs asked for, and run.

`Graph` alone decides what runs: it culls what no output needs, orders by resources, skips by
condition, reuses what did not change, and notes why. After FrameGraph (O'Donnell, GDC 2017,
"FrameGraph: Extensible Rendering Architecture in Frostbite"). Departs: results are kept from frame
to frame, and hints are told from inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.record import GraphLog, StageNames, StageRun, device_bytes
from ssgi_cl.frame.skips import same
from ssgi_cl.frame.stage import Resource, Stage, Values, ordered, results_of, writers_of

UNCHANGED = "all that it is made of stays the same"
"""Why a stage is not run whose results are reused."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """The stages for some outputs.

    Attributes:
        outputs: resources asked for.
        stages: all, in the order in which they run.
        culled: stages that do not run -> why.
    """

    outputs: frozenset[str]
    stages: tuple[Stage, ...]
    culled: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class GraphRun:
    """A run of a graph.

    Attributes:
        values: all resources by name; None, or no entry, where there is nothing.
        log: what became of each stage, and the passes of the frame.
    """

    values: Mapping[str, Any]
    log: GraphLog


class Graph:
    """The stages of a frame, and what they made last.

    Args:
        runtime: the device.
        stages: in any order; those that may run at the same place run as they are listed.
        resources: those of which more than the name is to be known.
        keep: whether results are reused.

    Attributes:
        stages: in the order in which they run.
        resources: by name.
        costs: ms by name of stage and pass, from the latest run of each: the estimate of what a
            skip saves.
        device_bytes: device memory of each resource that a stage made, by name.

    Raises:
        ValueError: a name that occurs twice, a resource that no stage writes, or a cycle.
    """

    def __init__(
        self, runtime: Runtime, stages: Sequence[Stage], resources: Sequence[Resource] = (), *, keep: bool = True
    ) -> None:
        self.runtime = runtime
        self.keep = keep
        self.costs: dict[str, float] = {}
        self.device_bytes: dict[str, int] = {}
        self.resources = {each.name: each for each in resources}
        self._writer = writers_of(stages)
        self.stages = ordered(stages, self._writer, self.resources)
        self._names = tuple(
            StageNames(s.name, s.reads, s.hints, s.writes, keep and s.reuse == "kept") for s in self.stages
        )
        self._inputs = {stage.name: tuple(dict.fromkeys(self._inputs_of(stage))) for stage in stages}
        self._compiled: dict[tuple[frozenset[str], frozenset[str]], Compiled] = {}
        self._made: dict[str, tuple[tuple[object, ...], tuple[Any, ...]]] = {}
        self._versions = dict.fromkeys(self._inputs, 0)

    def compiled(self, outputs: Iterable[str], given: Iterable[str]) -> Compiled:
        """Return the stages for `outputs` where the resources `given` are given.

        Raises:
            ValueError: an output that no stage writes, or an input that is not given.
        """
        key = frozenset(outputs), frozenset(given)
        found = self._compiled.get(key)
        if found is None:
            found = self._compiled[key] = self._compile(*key)
        return found

    def run(self, given: Values, outputs: Iterable[str], also: Iterable[str] = ()) -> GraphRun:
        """Run what `outputs` need, and wait for it.

        Should a stage raise, nothing is taken for made by it.

        Args:
            given: resources that the caller brings; one that is None counts as not given.
            outputs: resources asked for.
            also: resources that the caller reads afterwards where `outputs` need them; they live
                as long as outputs.
        """
        given = {name: value for name, value in given.items() if value is not None}
        compiled = self.compiled(outputs, given)
        log: dict[str, StageRun] = {}
        with self.runtime.frame(self.costs):
            values = self._run(compiled, given, log)
            passes = tuple(self.runtime.times())
        return GraphRun(values, self._log(compiled, given, log, passes, also))

    def forget(self, name: str) -> None:
        """Have the next run make what a stage writes, whatever its inputs are."""
        self._made.pop(name, None)

    def planned(self, given: Iterable[str], outputs: Iterable[str]) -> GraphLog:
        """Return what a run would leave if no stage were idle and nothing were reused."""
        compiled = self.compiled(outputs, given)
        runs = {stage.name: StageRun("planned") for stage in self.stages}
        runs |= {name: StageRun("culled", why) for name, why in compiled.culled.items()}
        return self._log(compiled, given, runs, ())

    def _log(
        self,
        compiled: Compiled,
        given: Iterable[str],
        runs: Mapping[str, StageRun],
        passes: tuple[PassTime, ...],
        also: Iterable[str] = (),
    ) -> GraphLog:
        return GraphLog(
            self.runtime,
            compiled.outputs,
            frozenset(also),
            frozenset(given),
            self._names,
            runs,
            passes,
            dict(self.costs),
            dict(self.device_bytes),
        )

    # ---- compiling

    def _compile(self, outputs: frozenset[str], given: frozenset[str]) -> Compiled:
        for name in outputs - given:
            checks.choice("an output", name, tuple(self._writer))
        culled = {
            stage.name: f"the caller gives {', '.join(stage.writes)}"
            for stage in self.stages
            if given.issuperset(stage.writes)
        }
        unneeded = self._unneeded(outputs, culled, lambda stage: None)
        culled |= dict.fromkeys(unneeded, "no output needs it")
        for stage in self.stages:
            for name in () if stage.name in culled else stage.reads:
                if name not in self._writer and name not in given:
                    raise ValueError(f"stage {stage.name!r} reads {name!r}, which is not given")
        return Compiled(outputs, self.stages, culled)

    def _unneeded(
        self, outputs: frozenset[str], without: Mapping[str, str], idle: Callable[[Stage], str | None]
    ) -> set[str]:
        """Return the stages, `without` some, that nothing needs which is not idle itself.

        `idle` is called with each of the others, readers before writers.
        """
        needed, found = set(outputs), set()
        for stage in reversed(self.stages):
            if stage.name in without:
                continue
            if needed.isdisjoint(stage.writes):
                found.add(stage.name)
            elif not idle(stage):
                needed.update(stage.uses)
        return found

    def _inputs_of(self, stage: Stage) -> Iterable[str]:
        """Give the resources whose change makes a stage run again: in place of one that is made on
        demand, what that is made of."""
        for name in stage.reads:
            writer = self._writer.get(name)
            if writer is not None and writer.reuse == "on demand":
                yield from self._inputs_of(writer)
            else:
                yield name

    # ---- running

    def _run(self, compiled: Compiled, given: Values, log: dict[str, StageRun]) -> dict[str, Any]:
        """Run stages in their order; return all resources, and note in `log` what became of each."""
        values = dict(given)
        facts = {**given, "outputs": compiled.outputs}
        reasons: dict[str, str] = {}

        def idle(stage: Stage) -> str | None:
            why = stage.condition(facts) if stage.condition is not None else None
            if why:
                reasons[stage.name] = why
            return why

        unneeded = self._unneeded(compiled.outputs, compiled.culled, idle)
        for stage in compiled.stages:
            name, label = stage.name, stage.label or stage.name
            if name in compiled.culled:
                log[name] = self._left("culled", compiled.culled[name], label, stage.culled)
            elif name in reasons:
                log[name] = self._left("idle", reasons[name], label, reasons[name])
            elif name in unneeded:
                log[name] = self._left("unneeded", "what would read it is idle")
            elif stage.reuse != "on demand" or not compiled.outputs.isdisjoint(stage.writes):
                self._bring(stage, values, log)
        for stage in compiled.stages:
            if stage.name not in log:
                why = "what would read it is reused"
                log[stage.name] = self._left("unneeded", why, stage.label or stage.name, why)
        return values

    def _left(self, state: str, why: str, name: str = "", told: str = "") -> StageRun:
        """Return what is noted of a stage that does not run; report it among the passes as `name`
        if there is anything to tell."""
        first = self.runtime.noted
        if told:
            self.runtime.skip(name, told)
        return StageRun(state, why, first, first + bool(told))

    def _bring(self, stage: Stage, values: dict[str, Any], log: dict[str, StageRun]) -> None:
        """Make what a stage writes, or take what it made of the same inputs."""
        name, kept = stage.name, self.keep and stage.reuse == "kept"
        inputs = tuple(self._input(each, values, log) for each in self._inputs[name] if kept)
        made = self._made.get(name)
        if made is not None and same(made[0], inputs):
            log[name] = self._left("reused", UNCHANGED, name, UNCHANGED)
            values.update(zip(stage.writes, made[1], strict=True))
            return
        for each in stage.uses:
            writer = self._writer.get(each)
            if writer is not None and writer.reuse == "on demand" and writer.name not in log:
                self._bring(writer, values, log)
        # Should it fail, nothing is taken for made.
        for each in (name, *stage.releases):
            self._made.pop(each, None)
        self._versions[name] += 1
        first, start = self.runtime.noted, perf_counter()
        why = next(filter(None, (self._absent(each, values) for each in stage.reads)), "")
        with self.runtime.part(name):
            if why:
                self.runtime.skip(stage.label or name, why)
                results: tuple[Any, ...] = (None,) * len(stage.writes)
            else:
                results = results_of(stage, values)
        host_ms = (perf_counter() - start) * 1e3
        state = "idle" if why else "ran"
        log[name] = StageRun(state, why, first, self.runtime.noted, host_ms)
        values.update(zip(stage.writes, results, strict=True))
        self.device_bytes.update(zip(stage.writes, map(device_bytes, results), strict=True))
        if kept:
            self._made[name] = inputs, results

    def _input(self, name: str, values: Values, log: Mapping[str, StageRun]) -> object:
        """Return what tells whether a resource changed."""
        if name not in values:
            return None
        resource, writer = self.resources.get(name), self._writer.get(name)
        made = writer is not None and log[writer.name].state != "culled"
        if resource is not None and (resource.by_value or not made):
            return resource.key(values[name])
        assert writer is not None  # noqa: S101  what is not given is written
        return self._versions[writer.name]

    def _absent(self, name: str, values: Values) -> str:
        resource = self.resources.get(name)
        return resource.absent if resource is not None and values.get(name) is None else ""
