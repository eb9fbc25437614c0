"""The time of every pass of a frame."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ssgi_cl.device.opencl import opencl


@dataclass(frozen=True)
class PassTime:
    """A pass that ran, or was skipped.

    Attributes:
        name: of the pass.
        ms: milliseconds on the device, from begin to end, of those that run beside others with the time that these
            take; 0 if skipped.
        skipped: why it was not run; empty if it ran.
        saved: milliseconds that this saves by estimate: what the pass took when it last ran; 0 if
            that is not known.
        items: work-items of the kernel; 0 of copies, and of what was skipped.
    """

    name: str
    ms: float
    skipped: str = ""
    saved: float = 0.0
    items: int = 0


class FrameLog(threading.local):
    """The passes of a thread's current frame."""

    def __init__(self) -> None:
        self.events: list[tuple[str, Any, int]] = []
        self.skips: list[tuple[int, PassTime]] = []
        self.parts: list[tuple[str, int, int]] = []
        self.costs: dict[str, float] = {}
        self.depth = 0

    @contextmanager
    def frame(self, costs: dict[str, float] | None = None) -> Iterator[None]:
        """Collect this thread's passes within; frames inside a frame belong to it.

        `costs` is the caller's memory of what passes and parts took, in ms by name: `times` brings
        it up to date, and what is skipped is estimated from it.
        """
        if self.depth == 0:
            self.events, self.skips, self.parts = [], [], []
            self.costs = {} if costs is None else costs
        self.depth += 1
        try:
            yield
        finally:
            self.depth -= 1

    def times(self) -> list[PassTime]:
        """Return the passes of the latest frame, in order; waits for those still running."""
        if self.events:
            opencl().wait_for_events([event for _, event, _ in self.events])  # those of the second queue, too
        ran = [
            PassTime(name, event.profile.end * 1e-6 - event.profile.start * 1e-6, items=items)
            for name, event, items in self.events
        ]
        taken: dict[str, list[float]] = {}
        for p in ran:
            taken.setdefault(p.name, []).append(p.ms)
        whole: dict[str, list[float]] = {}
        for name, first, end in self.parts:
            whole.setdefault(name, []).append(sum(p.ms for p in ran[first:end]))
        for name, times in {**taken, **whole}.items():
            self.costs[name] = sum(times) / len(times)
        for position, skip in reversed(self.skips):
            ran.insert(position, skip)
        return ran

    def times_if_done(self) -> list[PassTime] | None:
        """Return `times` if the device is done with the latest frame, else None; waits for nothing."""
        if self.events:
            latest = self.events[-1][1]
            latest.command_queue.flush()  # what is never sent never ends
            if latest.command_execution_status > opencl().command_execution_status.COMPLETE:
                return None
        return self.times()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Note that the passes within make up a part of the frame, which may be skipped as one."""
        first = len(self.events)
        yield
        self.parts.append((name, first, len(self.events)))

    def skip(self, name: str, why: str, saved: float | None = None) -> None:
        """Note in the current frame that a pass or part was not needed.

        By default it saves what it took when it last ran.
        """
        cost = self.costs.get(name, 0.0) if saved is None else saved
        self.skips.append((len(self.events), PassTime(name, 0.0, why, cost)))
