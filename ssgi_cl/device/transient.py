"""Device memory that passes share: what one needs from its first use to its last, others use after.

All passes run in order on one queue, so memory may go to the next pass as soon as the last one that
reads it is queued.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ssgi_cl.device.active_region import PreviousRegion, Region
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.transient_chunks import ALIGNMENT, Chunk, Layout, Piece

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime


@dataclass(eq=False)
class _Image:
    """A copy of a plane's contents as kernels read them.

    Attributes:
        image: of the driver, None until it is made.
        user: weak reference to the plane that has it.
    """

    image: Any = None
    user: weakref.ref[Any] | None = None


class TransientPlane(Plane):
    """A plane whose memory others get as soon as nothing refers to it any more.

    Attributes:
        background: for each image its value in pixels where nothing is.
    """

    def __init__(
        self, memory: TransientMemory, piece: Piece, count: int, size: Size, outside: float, background: Sequence[float]
    ) -> None:
        self._describe(memory.runtime, count, size, outside)
        self.background = tuple(background)
        self._pool = memory
        self._piece = piece
        self.buffer = piece.buffer
        self._own_image: _Image | None = None

    def within(self, region: Region | None) -> Region | None:
        """Return `region`, outside of which all pixels are set to the background, if it is one."""
        if region is not None:
            self.clear()
        return region

    def clear(self) -> None:
        """Queue what sets all pixels to the background."""
        self._pool.clear(self._piece, self.count, self.size, self.outside, self.background)
        self.written()

    def argument(self) -> Any:
        """Return what a kernel reads: the buffer, or an image with the same contents."""
        if self._image_shape is None:
            return self.buffer
        if self._own_image is None:
            self._own_image = self._pool.image(self._image_shape, self)
            self._image = self._own_image.image
        self._own_image.image = super().argument()
        return self._own_image.image

    @property
    def _memory(self) -> tuple[Any, int]:
        # PoCL 3 crashes where a part of a buffer is copied to an image.
        return self._piece.chunk.buffer, self._piece.start

    @property
    def _owner(self) -> object:
        return self._own_image


class TransientArray(DeviceArray):
    """An array whose memory others get as soon as nothing refers to it any more."""

    def __init__(self, runtime: Runtime, piece: Piece, count: int, dtype: type[np.generic]) -> None:
        self.runtime, self.count, self.dtype = runtime, count, np.dtype(dtype)
        self._piece = piece
        self.buffer = piece.buffer
        self._sent: Any = None


class TransientMemory:
    """Gives planes and arrays out for as long as anything refers to them.

    They come with any contents; planes have their outside value round every image. What a stage of
    a frame keeps stays its own as long as it keeps the object; what a call that failed had taken
    is free when its exception is gone.

    Args:
        runtime: the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self._chunks: list[Chunk] = []
        self._images: dict[Size, list[_Image]] = {}
        self._borders: dict[float, DeviceArray] = {}
        # For tests: whether memory is ever given out twice, and whether it is NaN when it is.
        self._sharing = True
        self._spoiling = False

    @property
    def size(self) -> int:
        """Bytes that it has, given out or not."""
        return sum(chunk.size for chunk in self._chunks)

    @property
    def held(self) -> int:
        """Bytes that it has with what it fills guards from."""
        return self.size + sum(values.count * 4 for values in self._borders.values())

    @property
    def used(self) -> int:
        """Bytes of these that are given out."""
        return sum(chunk.used for chunk in self._chunks)

    def plane(self, count: int, size: Size, outside: float = 0.0, background: Sequence[float] | None = None) -> Plane:
        """Return memory for `count` images; their `background` is the outside value by default."""
        if self.runtime.memory.counting:
            return self.runtime.plane(count, size, outside)
        rows, pitch = plane_shape(count, size)
        with self.runtime.lock:
            layout = rows, pitch, size[1], outside
            piece = self._free(4 * rows * pitch, layout)
            plane = TransientPlane(self, piece, count, size, outside, background or (outside,) * count)
            piece.user = weakref.ref(plane)
            self._border(piece, layout)
            return plane

    def reserve(self, size: int) -> None:
        """See that there is memory for `size` bytes that will be given out together.

        Raises:
            DeviceMemoryError: there is no room.
        """
        memory = self.runtime.memory
        if memory.counting:
            before = max(self.size, memory.reserved)
            memory.reserved = max(before, size)
            memory.count(memory.reserved - before)
            return
        with self.runtime.lock:
            missing = size - self.size
            if missing <= 0 or not self._sharing:
                return
            # In one piece with what is free, which is of more use so.
            free = [chunk for chunk in self._chunks if chunk.free]
            wanted = missing + sum(chunk.size for chunk in free)
            if wanted > memory.largest:
                free, wanted = [], min(missing, memory.largest)
            self.runtime.finish()  # what is queued may use what goes
            for chunk in free:
                self._drop(chunk)
            free.clear()
            self._new(-(-wanted // ALIGNMENT) * ALIGNMENT)

    def array(self, count: int, dtype: type[np.generic]) -> DeviceArray:
        """Return memory for `count` elements (at least one)."""
        return self._array(count, dtype, None)

    def images(self, count: int, size: Size) -> DeviceArray:
        """Return the memory of a plane whose outside value is 0 as an array of float32."""
        rows, pitch = plane_shape(count, size)
        return self._array(rows * pitch, np.float32, (rows, pitch, size[1], 0.0))

    def _array(self, count: int, dtype: type[np.generic], layout: Layout | None) -> DeviceArray:
        if self.runtime.memory.counting:
            return self.runtime.empty(count, dtype)
        count = max(count, 1)
        with self.runtime.lock:
            piece = self._free(max(count * np.dtype(dtype).itemsize, 4), layout)
            array = TransientArray(self.runtime, piece, count, dtype)
            piece.user = weakref.ref(array)
            if layout is not None:
                self._border(piece, layout)
            return array

    def image(self, shape: Size, user: Plane) -> _Image:
        """Return an image of such a shape, which may not be made yet, for as long as `user` lives."""
        images = self._images.setdefault(shape, [])
        for image in images:
            if image.user is None or image.user() is None:
                break
        else:
            image = _Image()
            images.append(image)
        image.user = weakref.ref(user)
        return image

    def let_go(self, before: int) -> bool:
        """Give the memory back to the driver that was free for longest, if it was not used since
        the call number `before`; return whether there was any."""
        free = [chunk for chunk in self._chunks if chunk.free and chunk.call < before]
        if not free:
            return False
        self._drop(min(free, key=lambda chunk: chunk.call))
        self._images.clear()
        return True

    def _free(self, size: int, layout: Layout | None) -> Piece:
        """Return a piece of the least gap that fits, in a new chunk if there is none."""
        size = -(-size // ALIGNMENT) * ALIGNMENT
        chunks = self._chunks if self._sharing else []
        gaps = [(room, start, chunk) for chunk in chunks for start, room in chunk.gaps() if room >= size]
        room, start, chunk = min(gaps, key=lambda gap: gap[:2], default=(0, 0, None))
        if chunk is None:
            chunk = self._grown(size)
            start, room = 0, chunk.size
        self.runtime.touch()
        piece = chunk.take(start, room, size, layout)
        chunk.call = self.runtime.calls
        if self._spoiling:
            piece.layout = None
            self._fill(piece.buffer, np.nan, 0, size)
        return piece

    def _drop(self, chunk: Chunk) -> None:
        self._chunks.remove(chunk)
        chunk.pieces = []  # which refer to it in turn

    def _grown(self, size: int) -> Chunk:
        """Return a new chunk of at least `size` bytes, in place of free ones that are too small."""
        dropped = 0
        chunk: Chunk | None
        self.runtime.finish()  # what is queued may use what goes
        for chunk in sorted(self._chunks, key=lambda chunk: -chunk.size):
            if chunk.free and (dropped < size or not self._sharing):
                self._drop(chunk)
                dropped += chunk.size
        # As much as before, so that a second frame finds all that it needs.
        wanted = max(size, dropped) if self._sharing else size
        return self._new(wanted if wanted <= self.runtime.memory.largest else size)

    def _new(self, size: int) -> Chunk:
        with self.runtime.memory.keeping(False):  # it is bounded by the largest frame
            chunk = Chunk(self.runtime, size)
        chunk.call = self.runtime.calls
        self._chunks.append(chunk)
        return chunk

    def clear(self, piece: Piece, count: int, size: Size, outside: float, background: Sequence[float]) -> None:
        """Queue what sets the images of a plane to their background."""
        rows, pitch = plane_shape(count, size)
        if all(value == outside for value in background):
            self._fill(piece.buffer, outside, 0, 4 * rows * pitch, "clear")
            return
        image = 4 * size[0] * pitch
        for number, value in enumerate(background):
            self._fill(piece.buffer, value, 4 * pitch + number * image, image, "clear")
        piece.layout = None
        self._border(piece, (rows, pitch, size[1], outside))

    def _border(self, piece: Piece, layout: Layout) -> None:
        """Queue what sets the guards of a plane to its outside value, unless they are."""
        if piece.layout == layout:
            return
        piece.layout = None
        rows, pitch, columns, outside = layout
        wide = 4 * (pitch - columns)
        for row in (0, rows - 1):
            self._fill(piece.buffer, outside, 4 * row * pitch, 4 * pitch)
        values = self._border_values(outside, rows * (pitch - columns))
        # In the whole chunk: PoCL 3 crashes where rectangles of a part of a buffer are copied.
        row, column = divmod(piece.start + 4 * columns, 4 * pitch)
        source = {"src_origin": (0, 0), "src_pitches": (wide,)}
        target = {"dst_origin": (column, row), "dst_pitches": (4 * pitch,), "region": (wide, rows)}
        opencl().enqueue_copy(self.runtime.queue, piece.chunk.buffer, values.buffer, **source, **target)
        piece.layout = layout

    def _border_values(self, outside: float, count: int) -> DeviceArray:
        """Return so many times the outside value, in device memory."""
        values = self._borders.get(outside)
        if values is None or values.count < count:
            self._borders.pop(outside, None)
            with self.runtime.memory.keeping(False):
                values = self.runtime.array(np.full(count, outside, np.float32))
            self._borders[outside] = values
        return values

    def _fill(self, buffer: Any, value: float, start: int, size: int, name: str | None = None) -> None:
        self.runtime.touch()
        event = opencl().enqueue_fill_buffer(self.runtime.queue, buffer, np.float32(value), start, size)
        if name is not None:
            self.runtime.record(name, event)


class Target:
    """The output of a pass: a plane of its own that keeps its contents, or a transient one.

    Args:
        runtime: the device.
        count, size, outside: of the plane.
        kept: whether the plane is this object's own: the same in every call, and what is outside
            the region of a call keeps its background. Else it lives as long as somebody refers to
            it.
    """

    def __init__(self, runtime: Runtime, count: int, size: Size, outside: float = 0.0, *, kept: bool = True) -> None:
        self.runtime, self.count, self.size, self.outside = runtime, count, size, outside
        self._plane = runtime.plane(count, size, outside) if kept else None
        self._previous = PreviousRegion()

    @contextmanager
    def over(
        self, region: Region | None, *, background: Sequence[float] | None = None
    ) -> Iterator[tuple[Plane, Region | None]]:
        """Give the plane, and where in it a pass works that shows anything in `region` alone.

        `background` is the value of each image beyond, the outside value by default.
        """
        if self._plane is not None:
            with self._previous.over(region) as over:
                yield self._plane, over
            return
        plane = self.runtime.transient.plane(self.count, self.size, self.outside, background)
        yield plane, plane.within(region) if isinstance(plane, TransientPlane) else region


@dataclass(frozen=True, eq=False)
class ImageParts:
    """Images of one size that are made some at a time, so that they need not be there together.

    Attributes:
        count: of all images.
        size: (rows, columns) of each.
        complete: whether `parts` has every image; those that it lacks are 0.
        parts: the number of the first image of each part and the part, each done with before the
            next is asked for.
    """

    count: int
    size: Size
    complete: bool
    parts: Iterator[tuple[int, Plane]]


def background_of(plane: Plane) -> tuple[float, ...] | None:
    """Return the value of each image of a transient plane where nothing is, None of others."""
    return plane.background if isinstance(plane, TransientPlane) else None
