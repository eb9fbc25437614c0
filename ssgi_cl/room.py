"""How much memory a device has, how much of it is taken, and how much something would take."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ssgi_cl.errors import DeviceMemoryError

_MEBI = 1 << 20


class Room:
    """The memory of a device, counted in bytes.

    What would not fit is refused before the driver is asked: drivers hand out more than there is
    and fail at the first kernel that uses it, or bring the process down.

    Attributes:
        limit: of all memory together; may be lowered.
        largest: of a single buffer; may be lowered.
        taken: in use now.
    """

    def __init__(self, label: str, limit: int, largest: int) -> None:
        self.label = label
        self.limit = limit
        self.largest = largest
        self.taken = 0
        self._counted: int | None = None

    @property
    def counting(self) -> bool:
        """Whether memory is only counted now, see `needed`."""
        return self._counted is not None

    def take(self, size: int) -> None:
        """Count `size` bytes more as in use.

        Raises:
            DeviceMemoryError: they don't fit.
        """
        if self._counted is not None:
            self._counted += size
            return
        if size > self.largest:
            raise DeviceMemoryError(
                f"{self.label}: no room for {size / _MEBI:.1f} MiB in one piece, which has at most "
                f"{self.largest / _MEBI:.1f} MiB"
            )
        if self.taken + size > self.limit:
            more = f"{size / _MEBI:.1f} MiB more"
            raise DeviceMemoryError(f"{self.label}: no room for {more}; {self}")
        self.taken += size

    def give_back(self, size: int) -> None:
        """Count `size` bytes less as in use."""
        self.taken -= size

    def needed(self, make: Callable[[], Any]) -> int:
        """Return how much `make` would take, called while nothing is allocated or compiled."""
        self._counted = 0
        try:
            make()
        finally:
            counted, self._counted = self._counted, None
        return counted

    def __str__(self) -> str:
        return f"{self.taken / _MEBI:.1f} of {self.limit / _MEBI:.1f} MiB are in use"


def outline(**about: Any) -> Any:
    """Return what stands for a plane, an array or a kernel while memory is only counted."""
    return _Outline(**about)


class _Outline:

    def __init__(self, **about: Any) -> None:
        self.buffer = None
        self.__dict__.update(about)

    def upload(self, values: Any) -> None:
        """Do nothing."""

    def run(self, *_: Any, **__: Any) -> None:
        """Do nothing."""

    def written(self) -> None:
        """Do nothing."""
