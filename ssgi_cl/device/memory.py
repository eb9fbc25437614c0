"""Memory of a device: its limit, what is in use, and what something would take."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Lock
from typing import Any, NoReturn, TypeVar, cast
from weakref import WeakKeyDictionary, finalize

from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.device import host_memory

T = TypeVar("T")

_MEBI = 1 << 20

KEPT_SHARE = 0.25
"""Of the limit, what `Runtime.prepared` may keep together unless `keep` says otherwise."""


@dataclass(eq=False)
class _Held:
    size: int
    kept: bool


class _Total:
    """Bytes that are held, without a look at each holder."""

    def __init__(self) -> None:
        self._bytes = 0
        self._lock = Lock()
        # Objects die at any moment, in the midst of a sum too: what they held is subtracted later.
        self._freed: deque[_Held] = deque()

    def add(self, size: int) -> None:
        with self._lock:
            self._bytes += size

    def watch(self, owner: object, held: _Held) -> None:
        """Subtract what is held once `owner` is gone."""
        finalize(owner, self._freed.append, held).atexit = False

    def __int__(self) -> int:
        with self._lock:
            while self._freed:
                self._bytes -= self._freed.popleft().size
            return self._bytes


class DeviceMemory:
    """The memory of a device, counted in bytes.

    What would not fit is refused before the driver is asked: drivers hand out more than there is
    and fail at the first kernel that uses it, or bring the process down. A device that shares the
    host's memory has what the host can spare, arrays of the host counted.

    Attributes:
        limit: of all memory together; may be lowered.
        largest: of a single buffer; may be lowered.
        keep: of what is kept for later calls; may be changed.
        peak: the most that was in use at a time.
    """

    def __init__(self, label: str, limit: int, largest: int, *, on_host: bool) -> None:
        self.label = label
        self._on_host = on_host
        self.limit = min(limit, host_memory.share()) if on_host else limit
        self.largest = largest
        self.keep = int(KEPT_SHARE * self.limit)
        self.peak = 0
        self._held: WeakKeyDictionary[object, _Held] = WeakKeyDictionary()
        self._total = _Total()
        self._keeping = False
        self._counted: int | None = None
        self.reserved = 0  # of transient memory, of what is counted
        self.taken = 0  # how often something was

    @property
    def used(self) -> int:
        """In use now."""
        return int(self._total)

    @property
    def kept(self) -> int:
        """Of these, what calls of the library keep for later ones, see `keeping`."""
        return sum(held.size for held in self._held.values() if held.kept)

    @contextmanager
    def keeping(self, kept: bool = True) -> Iterator[None]:
        """Count what is taken within as kept for later calls, or not."""
        before, self._keeping = self._keeping, kept
        try:
            yield
        finally:
            self._keeping = before

    @property
    def counting(self) -> bool:
        """Whether memory is only counted now, see `needed`."""
        return self._counted is not None

    def count(self, size: int) -> None:
        """Count `size` bytes more while `counting`."""
        assert self._counted is not None  # noqa: S101  asked before
        self._counted += size

    def take(self, size: int, owner: object) -> None:
        """Count `size` bytes more as in use while `owner` lives.

        Raises:
            DeviceMemoryError: they don't fit.
        """
        self.check_piece(size)
        self.require(size)
        held = self._held.get(owner)
        if held is None:
            held = self._held[owner] = _Held(0, self._keeping)
            self._total.watch(owner, held)
        held.size += size
        held.kept = self._keeping
        self._total.add(size)
        self.taken += 1
        self.peak = max(self.peak, self.used)

    def require(self, size: int, what: str = "") -> None:
        """Raise DeviceMemoryError unless `size` bytes more would fit; `what` says what for."""
        more = f"{size / _MEBI:.1f} MiB more"
        reason = f" {what}" if what else ""
        if self.used + size > self.limit:
            raise DeviceMemoryError(f"{self.label}: no room for {more}{reason}; {self}")
        if self._on_host:
            self.require_host(size, more + reason)

    def require_host(self, size: int, more: str = "") -> None:
        """Raise DeviceMemoryError unless an array of `size` bytes fits beside what the host has."""
        spare = host_memory.spare(size)
        if size > spare:
            more = more or f"a result of {size / _MEBI:.1f} MiB"
            raise DeviceMemoryError(
                f"{self.label}: no room for {more}; the host can spare {max(spare, 0) / _MEBI:.1f} MiB"
            )

    def check_piece(self, size: int) -> None:
        """Raise DeviceMemoryError if the device has no memory of `size` bytes in one piece."""
        if size > self.largest:
            raise DeviceMemoryError(
                f"{self.label}: no room for {size / _MEBI:.1f} MiB in one piece, which has at most "
                f"{self.largest / _MEBI:.1f} MiB"
            )

    def needed(self, make: Callable[[], Any]) -> int:
        """Return how much `make` would take, called while nothing is allocated or compiled.

        At least: what it takes after it has read results of the device is not known.
        """
        self._counted = 0
        self.reserved = 0
        try:
            with suppress(_UnknownResultError):
                make()
        finally:
            counted, self._counted = self._counted, None
        return counted

    def __str__(self) -> str:
        return f"{self.used / _MEBI:.1f} of {self.limit / _MEBI:.1f} MiB are in use"


def outline(kind: type[T], **about: Any) -> T:
    """Return what stands for a plane, an array or a kernel while memory is only counted."""
    return cast(T, _Outline(**about))


class _Outline:
    """A plane, an array or a kernel without memory, whose calls do nothing."""

    def __init__(self, **about: Any) -> None:
        self.buffer = None
        self.__dict__.update(about)

    def _nothing(self, *_: Any, **__: Any) -> None:
        pass

    upload = run = written = _nothing

    def download(self) -> NoReturn:
        raise _UnknownResultError


class _UnknownResultError(Exception):
    """Results are asked for while memory is only counted."""
