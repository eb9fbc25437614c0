"""Timer of a subject, with a reference beside it so that changes of the machine's speed cancel."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.tuning.calibration import GatherLoad
from ssgi_cl.tuning.case import Subject

STEADY = 0.1
"""Two halves of a measurement agree if their ratios to the reference differ by at most this."""
BUSY = 1.3
"""Times its fastest: if the reference is slower, something else keeps the machine busy."""
TRIES = 3
"""Measurements of a subject before it is called unsteady."""
FEWEST, MOST = 6, 60
"""Repetitions; as many of them as fit into the time that is given, both even."""
MOST_REPEATS = 32
"""Of a short subject, in one of the repetitions."""
WARM_UP = 2
LONG_MS = 300.0
"""A subject that takes longer is run once to warm up and `LONG_RUNS` times to be measured: where
its memory lies hardly matters to it, and short interruptions don't."""
LONG_RUNS = 4


@dataclass(frozen=True)
class Spread:
    """Median and quartiles of what was measured repeatedly."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Return those of at least two values."""
        low, _, high = statistics.quantiles(values, n=4, method="inclusive")
        return cls(statistics.median(values), low, high)


@dataclass(frozen=True)
class Timing:
    """Times of a subject.

    Attributes:
        wall_ms: from the call until the work is finished: what is compared.
        device_ms: by the device's clock, all passes; None for what doesn't run there.
        ratio: wall time over that of the reference run just before.
        runs: repetitions measured.
        unsteady: why the median may be off by more than the quartiles tell; empty if it is not.
        passes: name -> median milliseconds of each pass on the device.
        skipped: name -> why a pass was not needed.
    """

    wall_ms: Spread
    device_ms: Spread | None
    ratio: Spread
    runs: int
    unsteady: str
    passes: dict[str, float]
    skipped: dict[str, str]


_NO_TIME = Spread(0.0, 0.0, 0.0)
UNTIMED = Timing(_NO_TIME, None, _NO_TIME, 0, "", {}, {})
"""Of what is no program."""


class Stopwatch:
    """Times subjects on one device, each repetition next to one of the reference.

    Args:
        runtime: the device.
        seconds: about how long a subject is repeated.
        runs: repetitions in place of those that fit into `seconds`; at least 4, even.
    """

    def __init__(self, runtime: Runtime, seconds: float = 1.0, runs: int | None = None) -> None:
        self._runtime = runtime
        self._seconds = seconds
        self._runs = runs
        self._reference = Subject(run=GatherLoad(runtime).run)
        self.reference_ms: list[float] = []
        for _ in range(WARM_UP + FEWEST):
            self.reference_ms.append(self._once(self._reference)[1])

    def time(self, subject: Subject, again: Callable[[], Subject] | None = None) -> Timing:
        """Return what a subject takes; measured again, up to 3 times, if it is unsteady.

        A short one is repeated until it takes about as long as the reference: what interrupts
        either now and then then slows both alike.

        Args:
            subject: what is run.
            again: makes the same anew, which the second half of the runs then takes: where its
                memory happens to lie may matter, and then the halves differ.
        """
        took = self._warmed_up(subject)
        if took > LONG_MS:
            again = None
        repeats = min(MOST_REPEATS, max(1, round(min(self.reference_ms) / took)))
        if subject.setup is not None:
            repeats = 1
        least = FEWEST if took <= LONG_MS else LONG_RUNS
        took = 1e-3 * (took * repeats + min(self.reference_ms))
        runs = self._runs or min(MOST, max(least, 2 * int(0.5 * self._seconds / took)))
        for _ in range(TRIES):
            other = subject
            if again is not None:
                other = again()
                self._warmed_up(other)
            timing = self._measure((subject, other), runs, repeats)
            if not timing.unsteady:
                break
        return timing

    def _warmed_up(self, subject: Subject) -> float:
        """Run a subject some times; return the wall clock's milliseconds of the last one."""
        for _ in range(WARM_UP):
            _, took, _, _ = self._once(subject)
            if took > LONG_MS:
                break
        return took

    def _once(self, subject: Subject, repeats: int = 1) -> tuple[float, float, dict[str, float], dict[str, str]]:
        """Return milliseconds of device and wall clock, passes and skips: of one of the repeats."""
        if subject.setup is not None:
            subject.setup()
        with self._runtime.frame():
            start = time.perf_counter()
            for _ in range(repeats):
                subject.run()
            self._runtime.finish()
            wall = 1e3 * (time.perf_counter() - start) / repeats
            times = self._runtime.times()
        passes: dict[str, float] = {}
        for entry in times:
            if not entry.skipped:
                passes[entry.name] = passes.get(entry.name, 0.0) + entry.ms / repeats
        skipped = {entry.name: entry.skipped for entry in times if entry.skipped}
        return sum(passes.values()), wall, passes, skipped

    def _measure(self, halves: tuple[Subject, Subject], runs: int, repeats: int) -> Timing:
        device, wall, ratio, beside = [], [], [], []
        passes: dict[str, list[float]] = {}
        skipped: dict[str, str] = {}
        for index in range(runs):
            subject = halves[2 * index // runs]
            beside.append(self._once(self._reference)[1])
            on_device, on_wall, parts, skipped = self._once(subject, repeats)
            device.append(on_device)
            wall.append(on_wall)
            ratio.append(on_wall / beside[-1])
            for name, ms in parts.items():
                passes.setdefault(name, []).append(ms)
        self.reference_ms += beside
        return Timing(
            wall_ms=Spread.of(wall),
            device_ms=Spread.of(device) if subject.on_device else None,
            ratio=Spread.of(ratio),
            runs=runs,
            unsteady=disagreement(ratio) or busyness(beside, min(self.reference_ms)),
            passes={name: statistics.median(values) for name, values in passes.items()},
            skipped=skipped,
        )


def disagreement(ratios: Sequence[float]) -> str:
    """Return how the first half of some ratios differs from the second; empty if it hardly does."""
    half = len(ratios) // 2
    first, second = statistics.median(ratios[:half]), statistics.median(ratios[half:])
    apart = abs(first - second) / max(min(first, second), 1e-9)  # a kept frame takes no time
    if apart <= STEADY:
        return ""
    return f"its two halves differ by {100.0 * apart:.0f} % in the ratio to the reference"


def busyness(reference_ms: Sequence[float], fastest_ms: float) -> str:
    """Return how much slower than its fastest the reference was; empty if hardly."""
    slower = statistics.median(reference_ms) / fastest_ms
    if slower <= BUSY:
        return ""
    return f"the machine was busy: the reference took {slower:.1f} times its fastest time"
