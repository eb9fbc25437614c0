"""Narrowing search: spread over a box, look closer round the best, end with steps along axes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ssgi_cl.core.sampling import r_points

Values = dict[str, Any]
Cost = tuple[float, ...]

LOGARITHMIC = 8.0
"""Ranges of numbers > 0 whose ends have at least this ratio are searched by ratio."""


@dataclass(frozen=True)
class Axis:
    """One parameter: a range of numbers, or some values.

    Attributes:
        name: of the parameter.
        low, high: the range, if there are no `values`.
        values: what it may be; numbers are in ascending order and have neighbours, others don't.
        whole: integers only.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    values: tuple[Any, ...] = ()
    whole: bool = False

    @property
    def ordered(self) -> bool:
        """Whether values that lie close together do about the same."""
        return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in self.values)

    @property
    def step(self) -> float:
        """Distance of neighbours in [0, 1]; 0 where there is always one between."""
        if self.values:
            return 1.0 / len(self.values)
        return 1.0 / (self.high - self.low + 1.0) if self.whole else 0.0

    def at(self, u: float) -> Any:
        """Return the value at u in [0, 1]."""
        u = min(max(u, 0.0), 1.0)
        if self.values:
            return self.values[min(int(u * len(self.values)), len(self.values) - 1)]
        if self.whole:
            # Each integer has an equal share.
            return min(int(self.low + u * (self.high - self.low + 1.0)), int(self.high))
        if self._logarithmic:
            return float(self.low * (self.high / self.low) ** u)
        return float(self.low + u * (self.high - self.low))

    def place(self, value: Any) -> float:
        """Return the u of a value; of a number that is none of `values`, the nearest one's."""
        if self.values and self.ordered:
            nearest = min(range(len(self.values)), key=lambda i: abs(self.values[i] - value))
            return (nearest + 0.5) / len(self.values)
        if self.values:
            return (self.values.index(value) + 0.5) / len(self.values)
        if self.whole:
            return float((value - self.low + 0.5) / (self.high - self.low + 1.0))
        if self._logarithmic:
            return float(math.log(value / self.low) / math.log(self.high / self.low))
        return float((value - self.low) / (self.high - self.low))

    @property
    def _logarithmic(self) -> bool:
        return self.low > 0.0 and self.high >= LOGARITHMIC * self.low


def spread(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Return [count, dimensions] evenly spread points of the unit cube (R sequence, Roberts 2018)."""
    start = 0.5 + seed * 0.6180339887498949 * np.arange(1, dimensions + 1)
    return np.asarray(np.mod(start + r_points(0, count, dimensions), 1.0))


class Narrowing:
    """A search over some axes for the least cost; deterministic if the costs are.

    Args:
        axes: what is varied.
        cost: what is minimised, compared as tuples; None for what is not allowed.
        seed: chooses the points of the first round.
    """

    def __init__(self, axes: Sequence[Axis], cost: Callable[[Values], Cost | None], seed: int = 0) -> None:
        self._axes = axes
        self._cost = cost
        self._seed = seed
        self._tried: dict[tuple[Any, ...], tuple[Cost | None, Values]] = {}

    def ranked(self) -> list[Values]:
        """Return what was tried and is allowed, the best first."""
        allowed = [(cost, values) for cost, values in self._tried.values() if cost is not None]
        return [values for _, values in sorted(allowed, key=lambda pair: pair[0])]

    def attempt(self, values: Mapping[str, Any]) -> Cost | None:
        """Return the cost of a point, found out unless it is known."""
        key = tuple(values[axis.name] for axis in self._axes)
        if key not in self._tried:
            self._tried[key] = self._cost(dict(values)), dict(values)
        return self._tried[key][0]

    def survey(self, points: int) -> None:
        """Try points all over the box."""
        for place in spread(points, len(self._axes), self._seed):
            self.attempt({axis.name: axis.at(u) for axis, u in zip(self._axes, place, strict=True)})

    def closer(self, width: float, points: int, keep: int) -> None:
        """Try points round each of the best `keep`, within boxes of `width` of the whole.

        What has no order is taken from one of them.
        """
        best = self.ranked()[:keep]
        offsets = spread(points * len(best), len(self._axes), self._seed + 1)
        for index, place in enumerate(offsets):
            centre = best[index % len(best)]
            values = {}
            for axis, u in zip(self._axes, place, strict=True):
                if axis.ordered:
                    values[axis.name] = axis.at(axis.place(centre[axis.name]) + (u - 0.5) * max(width, 2.0 * axis.step))
                else:
                    values[axis.name] = best[int(u * len(best))][axis.name]
            self.attempt(values)

    def descend(self, width: float = 0.25, halvings: int = 5) -> None:
        """Step from the best along one axis at a time, by `width` and then by halves of it."""
        if not self.ranked():
            return
        here = self.ranked()[0]
        for _ in range(halvings):
            better = True
            while better:
                better = False
                for axis in self._axes:
                    for value in _neighbours(axis, here[axis.name], width):
                        cost = self.attempt({**here, axis.name: value})
                        known = self.attempt(here)
                        if cost is not None and known is not None and cost < known:
                            here, better = {**here, axis.name: value}, True
            width *= 0.5


def narrow(
    axes: Sequence[Axis],
    cost: Callable[[Values], Cost | None],
    *,
    start: Sequence[Mapping[str, Any]] = (),
    rounds: int = 4,
    points: int = 64,
    keep: int = 5,
    seed: int = 0,
) -> list[Values]:
    """Search for the least cost and return what was tried and is allowed, the best first.

    Args:
        axes, cost, seed: see `Narrowing`.
        start: points that are tried before all others.
        rounds: >= 1; the first is all over the box, each further one halves the box round the best.
        points: of the first round; the others have two thirds of it.
        keep: how many of the best are looked at closer.
    """
    search = Narrowing(axes, cost, seed)
    for values in start:
        search.attempt(values)
    search.survey(points)
    for number in range(1, rounds):
        search.closer(0.5**number, max(1, points * 2 // (3 * keep)), keep)
    search.descend()
    return search.ranked()


def _neighbours(axis: Axis, value: Any, width: float) -> list[Any]:
    if not axis.ordered:
        return [other for other in axis.values if other != value]
    place = axis.place(value)
    step = max(width, axis.step)
    both = (axis.at(place - step), axis.at(place + step))
    return [other for other in both if other != value]
