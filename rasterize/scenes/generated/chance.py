"""Random numbers of a generated scene: the same for the same kind and seed, on every machine."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ..scatter import Doubles, unit_numbers

T = TypeVar("T")


class Chance:
    """A stream of random numbers that depends on a kind and a seed only.

    Args:
        kind: name of a kind of scene.
        seed: >= 0.
    """

    def __init__(self, kind: str, seed: int) -> None:
        digest = hashlib.sha256(f"{kind}-{seed}".encode()).digest()
        self._bits = np.random.PCG64(int.from_bytes(digest[:16], "little"))

    def uniforms(self, low: float, high: float, *shape: int) -> Doubles:
        """Return [*shape] numbers in [low, high)."""
        return low + (high - low) * unit_numbers(self._bits, *shape)

    def uniform(self, low: float, high: float) -> float:
        """Return a number in [low, high)."""
        return float(self.uniforms(low, high, 1)[0])

    def whole(self, low: int, high: int) -> int:
        """Return an integer from low to high, both included."""
        return min(int(self.uniform(low, high + 1)), high)

    def yes(self, probability: float) -> bool:
        """Return True with a probability in [0, 1]."""
        return self.uniform(0.0, 1.0) < probability

    def pick(self, options: Sequence[T]) -> T:
        """Return one of the options, all equally likely."""
        return options[self.whole(0, len(options) - 1)]

    def some(self, options: Sequence[T], count: int) -> list[T]:
        """Return `count` of the options, or all if there are fewer, in random order."""
        order = np.argsort(self.uniforms(0.0, 1.0, len(options)), kind="stable")
        return [options[index] for index in order[:count]]
