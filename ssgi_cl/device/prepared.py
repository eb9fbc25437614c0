"""Results of earlier calls in device memory, kept while there is room."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from ssgi_cl.core.errors import DeviceMemoryError

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

MOST_PREPARED = 256
"""Results that are kept at most: their memory on the host is not counted."""

T = TypeVar("T")


@dataclass
class _Kept:
    """A result, and the number of the call that used it last."""

    value: Any
    call: int


class PreparedResults:
    """Results that calls of the library left for later ones; see `Runtime.prepared`.

    Attributes:
        calls: number of the call of the library that runs now.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self.calls = 0
        self._kept: dict[object, _Kept] = {}
        self._within_bounds: tuple[int, int, int] | None = None  # state in which nothing must go
        self._following: set[object] = set()

    def clear(self) -> None:
        """Let all go."""
        self._kept.clear()

    def pop(self, key: object) -> None:
        """Let a result go that is kept."""
        del self._kept[key]

    def with_capacity(self, take: Callable[[], T]) -> T:
        """Return what `take` returns, tried again each time after the oldest of what earlier calls
        left was let go."""
        while True:
            try:
                return take()
            except DeviceMemoryError:
                if not self.let_go():
                    raise

    def let_go(self) -> bool:
        """Let go what was not used for the longest time; return False if this call used all."""
        before = self._runtime.memory.used
        for key in tuple(self._kept):
            prepared = self._kept.get(key)
            if prepared is not None and prepared.call < self.calls:
                del self._kept[key], prepared
                if self._runtime.memory.used == before:
                    gc.collect()  # its parts may refer to each other
                return True
        return self._runtime.transient.let_go(self.calls)

    def get(self, key: object, make: Callable[[], Any], of: object | None) -> Any:
        """Return what is kept for `key`, or what `make` returns now, see `Runtime.prepared`."""
        if self._runtime.memory.counting:
            return make()
        with self._runtime.lock:
            if not self._runtime.in_call:
                self.calls += 1
            kept = self._kept.pop(key, None)
            if kept is None:
                with self._runtime.memory.keeping():
                    kept = _Kept(self._made(make), self.calls)
                if of is not None and key not in self._following:
                    weakref.finalize(of, self._follow, key).atexit = False
                    self._following.add(key)
            kept.call = self.calls
            self._kept[key] = kept
            self.bound()
            return kept.value

    def bound(self) -> None:
        """Let go what was not used for the longest time while more is kept than may be."""
        memory = self._runtime.memory
        while self._within_bounds != (state := (memory.taken, memory.keep, len(self._kept))):
            if memory.kept <= memory.keep and len(self._kept) <= MOST_PREPARED:
                self._within_bounds = state
            elif not self.let_go():
                return

    def _follow(self, key: object) -> None:
        self._following.discard(key)
        self._kept.pop(key, None)

    def _made(self, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except DeviceMemoryError:
            self.clear()  # all that nobody holds is free now
        gc.collect()
        try:
            return make()
        except DeviceMemoryError as error:
            needed = self._runtime.memory.needed(make)
            raise DeviceMemoryError(
                f"{error}; at least {needed / 2**20:.1f} MiB are needed in all: take a smaller size, fewer "
                "layers or less overscan"
            ) from error
