"""A stage of a frame as a record: what it reads and writes, when it is idle, and what runs it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ssgi_cl.core import checks

REUSE = ("kept", "on demand", "every frame")
"""When a stage runs; see `Stage`."""

Values = Mapping[str, Any]
"""Resources by name."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage:
    """A stage of a frame.

    Attributes:
        name: of the stage, unique in its graph.
        reads: resources that its results are made of.
        hints: resources that change how much is computed and no bit of the result: None where they
            are not there, and no reason to make the result again.
        writes: resources that it makes.
        run: is called with `Declared`, the resources of `reads` and `hints` and no other; returns
            the one that it writes, or a tuple of all.
        condition: is called with the resources given by the caller, and their "outputs", the
            resources asked for; returns why the stage is idle, or None. An idle stage leaves None.
        reuse: "kept": results stay until what the stage reads changes. "on demand": it runs anew
            when a stage that reads it runs, and keeps by itself what it can. "every frame".
        releases: stages whose results go before it runs: what is drawn next needs their memory.
        label: the name under which `PassTime` reports an idle stage; by default `name`.
        culled: why it is not run where no output needs it, if passes are to tell that.
    """

    name: str
    writes: tuple[str, ...]
    run: Callable[[Values], Any]
    reads: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    condition: Callable[[Values], str | None] | None = None
    reuse: str = "kept"
    releases: tuple[str, ...] = ()
    label: str = ""
    culled: str = ""

    @property
    def uses(self) -> tuple[str, ...]:
        """`reads` and `hints`."""
        return self.reads + self.hints


class Declared(Mapping[str, Any]):
    """The resources that a stage declares, None where there is nothing; no other can be read.

    LookupError: the name of another is asked for.
    """

    def __init__(self, stage: Stage, values: Values) -> None:
        self._stage, self._values = stage, values

    def __getitem__(self, name: str) -> Any:
        if name not in self._stage.uses:
            raise LookupError(
                f"stage {self._stage.name!r} asks for {name!r}, which it does not declare: expected one of "
                f"{', '.join(map(repr, self._stage.uses))}"
            )
        return self._values.get(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._stage.uses)

    def __len__(self) -> int:
        return len(self._stage.uses)


def results_of(stage: Stage, values: Values) -> tuple[Any, ...]:
    """Run a stage; return what it writes, in the order of `Stage.writes`."""
    result = stage.run(Declared(stage, values))
    return result if len(stage.writes) > 1 else (result,)


def run_in_order(stages: Sequence[Stage], values: Values) -> Values:
    """Run stages one after the other; return `values` and all that they write."""
    made = dict(values)
    for stage in stages:
        made.update(zip(stage.writes, results_of(stage, made), strict=True))
    return made


@dataclass(frozen=True, eq=False)
class Resource:
    """What is to be known of a resource beside its name.

    Attributes:
        name: as stages read and write it.
        given: whether the caller may bring it; the stage that writes it is then culled.
        key: of a given one, the value that tells whether it changed.
        by_value: whether one that a stage made counts as changed by its value, not by being new.
        absent: why stages that read it are idle where it is None; empty: they run all the same.
    """

    name: str
    given: bool = False
    key: Callable[[Any], object] = lambda value: value
    by_value: bool = False
    absent: str = ""


def writers_of(stages: Sequence[Stage]) -> dict[str, Stage]:
    """Return which stage writes each resource."""
    writers: dict[str, Stage] = {}
    names: set[str] = set()
    for stage in stages:
        if stage.name in names:
            raise ValueError(f"two stages are called {stage.name!r}: expected a name for each")
        names.add(stage.name)
        checks.choice(f"reuse of stage {stage.name!r}", stage.reuse, REUSE)
        for name in stage.writes:
            if name in writers:
                raise ValueError(f"stages {writers[name].name!r} and {stage.name!r} both write {name!r}: expected one")
            writers[name] = stage
    return writers


def ordered(
    stages: Sequence[Stage], writers: Mapping[str, Stage], resources: Mapping[str, Resource]
) -> tuple[Stage, ...]:
    """Return the stages in an order in which each comes after those whose results it reads."""
    after: dict[str, set[str]] = {}
    for stage in stages:
        for name in stage.reads:
            if name not in writers and not (name in resources and resources[name].given):
                raise ValueError(
                    f"stage {stage.name!r} reads {name!r}, which no stage writes and which is not "
                    f"among the given resources; stages write {', '.join(writers)}"
                )
        after[stage.name] = {writers[name].name for name in stage.uses if name in writers}
    order: list[Stage] = []
    waiting = list(stages)
    while waiting:
        done = {stage.name for stage in order}
        ready = next((stage for stage in waiting if after[stage.name] <= done), None)
        if ready is None:
            names = ", ".join(repr(stage.name) for stage in _cycle(waiting, after))
            raise ValueError(f"stages read what each other write, in a cycle: {names}")
        waiting.remove(ready)
        order.append(ready)
    return tuple(order)


def _cycle(waiting: Sequence[Stage], after: Mapping[str, set[str]]) -> list[Stage]:
    """Return stages that wait for each other, each for the one before."""
    by_name = {stage.name: stage for stage in waiting}
    path = [waiting[0]]
    while True:
        before = next(by_name[name] for name in sorted(after[path[-1].name]) if name in by_name)
        if before in path:
            return path[path.index(before) :][::-1]
        path.append(before)
