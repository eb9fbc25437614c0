"""Chunks of device memory whose pieces planes and arrays have one after the other."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

Layout = tuple[int, int, int, float]
"""Rows, floats in a row, columns of pixels, outside value."""


ALIGNMENT = 4096
"""Bytes of which starts of pieces are multiples; devices need at most this."""


class Piece:
    """A part of a chunk, and the plane or array that has it or had it last.

    Attributes:
        chunk: that it is a part of.
        start, size: bytes.
        buffer: of the driver.
        user: weak reference to the plane or array that has it, dead if it is free.
        layout: of the plane whose guards it holds, None if it holds none.
    """

    def __init__(self, chunk: Chunk, start: int, size: int) -> None:
        self.chunk, self.start, self.size = chunk, start, size
        self.user: weakref.ref[Any] | None = None
        self.layout: Layout | None = None
        self.buffer = chunk.part(start, size)

    @property
    def free(self) -> bool:
        return self.user is None or self.user() is None

    @property
    def end(self) -> int:
        return self.start + self.size


class Chunk:
    """Device memory in one piece.

    Attributes:
        size: bytes.
        pieces: given out now, or before and not written over since.
        call: number of the library's call that used it last.
    """

    def __init__(self, runtime: Runtime, size: int) -> None:
        self.size = size
        self.pieces: list[Piece] = []
        self.call = 0
        self.buffer = runtime.allocate(size, self)
        self._parts: dict[tuple[int, int], Any] = {}

    def part(self, start: int, size: int) -> Any:
        """Return a part of the buffer, kept as long as the chunk: what is queued may use it."""
        if (start, size) not in self._parts:
            self._parts[start, size] = self.buffer.get_sub_region(start, size)
        return self._parts[start, size]

    @property
    def free(self) -> bool:
        return all(piece.free for piece in self.pieces)

    @property
    def used(self) -> int:
        return sum(piece.size for piece in self.pieces if not piece.free)

    def gaps(self) -> Iterator[tuple[int, int]]:
        """Give start and size of each part that is free."""
        start = 0
        for piece in sorted((p for p in self.pieces if not p.free), key=lambda p: p.start):
            if piece.start > start:
                yield start, piece.start - start
            start = piece.end
        if start < self.size:
            yield start, self.size - start

    def take(self, start: int, room: int, size: int, layout: Layout | None) -> Piece:
        """Return a piece of a gap, the one with the wanted guards if there is one."""
        for piece in self.pieces:
            inside = start <= piece.start and piece.end <= start + room
            if piece.free and inside and (piece.size, piece.layout) == (size, layout):
                break
        else:
            piece = Piece(self, start, size)
        self.pieces = [p for p in self.pieces if p.end <= piece.start or p.start >= piece.end] + [piece]
        return piece
