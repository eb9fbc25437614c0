"""Stage: a pass of a frame as a record of what it reads, what it writes and what runs it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Values = Mapping[str, Any]
"""Resources by name."""
WANTED = "wanted"
"""Name under which `Values` has the names of the resources that a run of the graph makes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage:
    """A stage of a frame.

    Attributes:
        name: of the stage, unique in its graph.
        reads: resources that its results are made of.
        hints: resources that change how much is computed and no bit of the result. A change of
            them is no reason to make the result again.
        writes: resources that it makes.
        foresees: resources of later stages: whether these will run changes what it makes.
        run: is called with the resources of `reads` and `hints`; returns the resource that it
            writes, or a tuple of all.
        condition: is called with the resources given by the caller, and their "outputs", the
            resources asked for; returns why the stage is idle, or None. An idle stage leaves None.
        on_demand: whether it runs anew for each stage that runs and reads it, and keeps by itself
            what it can. The results of other stages stay until what they read changes.
        releases: stages whose results go before it runs: it needs their memory.
        culled: reason in the table of passes where no output needs it; empty: it is not listed.
    """

    name: str
    writes: tuple[str, ...]
    run: Callable[[Declared], Any]
    reads: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    foresees: tuple[str, ...] = ()
    condition: Callable[[Values], str | None] | None = None
    on_demand: bool = False
    releases: tuple[str, ...] = ()
    culled: str = ""

    @property
    def uses(self) -> tuple[str, ...]:
        """`reads` and `hints`."""
        return self.reads + self.hints

    def results(self, values: Values) -> tuple[Any, ...]:
        """Run the stage; return what it writes, in the order of `writes`."""
        result = self.run(Declared(self, values))
        return result if len(self.writes) > 1 else (result,)


class Declared:
    """Resources that a stage declares, by name: None where there is nothing.

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

    def foresees(self, name: str) -> bool:
        """Return whether the stage that writes a resource, which this one foresees, runs or is reused."""
        if name not in self._stage.foresees:
            raise LookupError(
                f"stage {self._stage.name!r} asks whether {name!r} will be made: expected one of "
                f"{', '.join(map(repr, self._stage.foresees)) or 'none'}"
            )
        return name in self._values.get(WANTED, ())


def run_in_order(stages: Sequence[Stage], values: Values) -> Values:
    """Run stages one after the other; return `values` and all that they write."""
    made = dict(values)
    for stage in stages:
        made.update(zip(stage.writes, stage.results(made), strict=True))
    return made
