"""Progress of long work: told to a function, or shown as a bar in terminals and notebooks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from ssgi_cl.core.errors import shown

Told = Callable[[float], object]
"""A function that is called with the share done, in [0, 1]; it grows, and ends at 1."""
Progress = Told | bool | None
"""Such a function, True for a bar, or False or None for nothing."""
ToldSteps = Callable[[str, float], object]
"""A function that is called with what is under way and the share of it that is done."""


class _Show(Protocol):
    """Shows a share, and what is under way where that changes."""

    def __call__(self, share: float, text: str = ...) -> object: ...


@contextmanager
def told(progress: Progress, what: str) -> Iterator[Told | None]:
    """Give the function that long work is to call, or None if nobody wants to know.

    Args:
        progress: as a public function got it. True shows a bar on standard error in terminals, a line of text in
            notebooks, and nothing elsewhere.
        what: is under way, in words.

    Raises:
        TypeError: `progress` is anything else.
    """
    if progress is None or progress is False:
        yield None
    elif progress is True:
        with _bar(what) as tell:
            yield tell
    elif callable(progress):
        yield progress
    else:
        raise TypeError(
            f"progress is {shown(progress)}: expected True for a bar, a function of the share done, or None"
        )


@contextmanager
def told_steps(progress: ToldSteps | bool | None, what: str) -> Iterator[ToldSteps | None]:
    """As `told`, of work in steps that have names."""
    if progress is True:
        with _bar(what) as show:
            yield lambda text, share: show(share, text)
        return
    with told(progress, what) as tell:  # type: ignore[arg-type]  # it is checked there, and not called
        yield tell  # type: ignore[misc]


def part_of(tell: Told | None, low: float, high: float) -> Told | None:
    """Return the function that is told the share of a part of the work, from `low` to `high` of the whole."""
    return None if tell is None else lambda share: tell(low + (high - low) * share)


class Preparing:
    """Tells the share done while kernels are compiled, of which nobody knows how many there will be.

    Call it after each. The share starts at 0 and stays below `MOST`.

    Attributes:
        share: told last; 0 if nothing was compiled.
    """

    MOST = 0.5
    HALF = 16
    """Programs after which half of that is reached; a whole frame has some fifty."""

    def __init__(self, tell: Told | None) -> None:
        self._tell = tell
        self._count = 0
        self.share = 0.0
        if tell is not None:
            tell(0.0)

    def __call__(self) -> None:
        self._count += 1
        self.share = self.MOST * self._count / (self._count + self.HALF)
        if self._tell is not None:
            self._tell(self.share)


@contextmanager
def _bar(what: str) -> Iterator[_Show]:
    from rich.console import Console  # imports take time that who shows nothing need not spend
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    if console.is_jupyter:
        # Rich's own bar warns there without ipywidgets.
        line = _Line(what)
        try:
            yield line
        finally:
            print(file=sys.stdout)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(escape(what), total=1.0)
        yield lambda share, text=what: bar.update(task, completed=share, description=escape(text))


class _Line:
    """A line of text with the whole percents, written over itself."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._shown = ""

    def __call__(self, share: float, text: str = "") -> None:
        line = f"{text or self._what} {int(100.0 * share):3} %"
        if line != self._shown:
            print(f"\r{line:{len(self._shown)}}", end="", flush=True, file=sys.stdout)
            self._shown = line
