"""Bound and outcome of tuning."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ssgi_cl.core.atomic import replacement
from ssgi_cl.core.errors import SsgiError
from ssgi_cl.core.params import Params
from ssgi_cl.device.arrays import Size
from ssgi_cl.tuning.search import Cost
from ssgi_cl.tuning.trials import Trial

ROUGHNESS = 1.1
"""A time measured roughly may be too great by this factor."""


class TuneError(SsgiError, ValueError):
    """Nothing that was tried keeps the bound; the message says what came closest."""


class Bound:
    """The limit that is asked for: it orders trials, and tells when a trial's error need not be known."""

    def __init__(self, budget_ms: float | None, max_error: float | None) -> None:
        self.budget_ms = budget_ms
        self.max_error = max_error
        self.best: Cost | None = None

    @property
    def limit_ms(self) -> float:
        """Beyond it nothing can be the best."""
        if self.budget_ms is not None:
            return self.budget_ms
        return self.best[1] if self.best is not None and self.best[0] == 0.0 else math.inf

    def kept_by(self, trial: Trial) -> bool:
        """Return whether a trial keeps it."""
        if trial.error is None:
            return False
        if self.budget_ms is not None:
            return trial.ms <= self.budget_ms
        return self.max_error is not None and trial.error <= self.max_error

    def nearly_kept_by(self, trial: Trial) -> bool:
        """Return whether a trial of which the time is known roughly may keep it."""
        if self.budget_ms is None:
            return self.kept_by(trial)
        return trial.error is not None and trial.ms <= ROUGHNESS * self.budget_ms

    def rank(self, trial: Trial) -> Cost:
        """Return what is minimised, whether or not the bound is kept."""
        error = math.inf if trial.error is None else trial.error
        return (error, trial.ms) if self.budget_ms is not None else (trial.ms, error)

    def cost(self, trial: Trial) -> Cost:
        """Return (0, what is minimised) where the bound is kept, else (1, what keeps it from it).

        Where the time is bound, time decides between equal errors, and the other way round.
        """
        first, second = self.rank(trial)
        return (0.0, first, second) if self.kept_by(trial) else (1.0, second, first)

    def unreachable(self, tried: Sequence[Trial], metric: str) -> str:
        """Return the message for when no trial keeps it."""
        if self.budget_ms is not None:
            fastest = min(tried, key=lambda trial: trial.ms)
            setting = ", ".join(f"{name}={value!r}" for name, value in fastest.parameters.items())
            return (
                f"budget_ms is {self.budget_ms:g}: nothing is as fast; the fastest of "
                f"{len(tried)} trials, {setting}, takes {fastest.ms:.3g} ms"
            )
        lowest = min((t.error for t in tried if t.error is not None), default=math.inf)
        return (
            f"max_error is {self.max_error:g}: nothing is as good; the best of {len(tried)} "
            f"trials has {metric} {lowest:.3g}"
        )


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """The outcome of `tune`, with all that it depends on.

    Attributes:
        technique: key in `TECHNIQUES`.
        budget_ms, max_error: the bound, one of the two.
        metric: what the error is: its geometric mean over all views.
        best: the parameters found; a radius in it is the default's, not the scenes'.
        parameters: those of `best` that were varied or fixed.
        ms: device time of a picture, mean over the views, milliseconds.
        error: of `best`.
        tried: every point measured.
        scenes: name, digest, radius and views (eye, target) of each scene tuned on.
        size: (rows, columns).
        layers, overscan: of the G-buffers.
        device, variant: what the times are of.
        truth: how the truth was made.
        date: UTC, ISO 8601.
        version: of the library.
    """

    technique: str
    budget_ms: float | None
    max_error: float | None
    metric: str
    best: Params
    parameters: Mapping[str, Any]
    ms: float
    error: float
    tried: tuple[Trial, ...]
    scenes: tuple[Mapping[str, Any], ...]
    size: Size
    layers: int
    overscan: float
    device: str
    variant: str
    truth: Mapping[str, Any]
    date: str
    version: str

    def front(self) -> list[Trial]:
        """Return the points of which none other is both faster and better, the fastest first."""
        return front(self.tried)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all of it as JSON, whole or not at all.

        Raises:
            OSError: the file can't be written.
        """
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        del values["best"]
        values["tried"] = [dataclasses.asdict(trial) for trial in self.tried]
        document = {"format": "ssgi-tuning 1", **values}
        with replacement(path) as file:
            file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def front(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials of which none other is both faster and better, the fastest first."""
    known = sorted((trial for trial in trials if trial.error is not None), key=lambda trial: (trial.ms, trial.error))
    result: list[Trial] = []
    least = math.inf
    for trial in known:
        if trial.error is not None and trial.error < least:
            result.append(trial)
            least = trial.error
    return result
