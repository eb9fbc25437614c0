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

from ssgi_cl.device.active_region import Trace, Window
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.opencl import opencl

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

_Layout = tuple[int, int, int, float]
"""Rows, floats in a row, columns of pixels, outside value."""


class _Block:
    """A piece of device memory, and what used it last.

    Attributes:
        size: bytes.
        buffer: of the driver.
        user: weak reference to the plane or array that has it, dead if it is free.
        layout: of the plane whose guards it holds, None if it holds none.
        images: copies of its contents as kernels read them, by their shape.
        call: number of the library's call that used it last.
    """

    def __init__(self, runtime: Runtime, size: int) -> None:
        self.size = size
        self.user: weakref.ref[Any] | None = None
        self.layout: _Layout | None = None
        self.images: dict[Size, Any] = {}
        self.call = 0
        self.buffer = runtime.allocate(size, self)

    @property
    def free(self) -> bool:
        return self.user is None or self.user() is None


class TransientPlane(Plane):
    """A plane whose memory others get as soon as nothing refers to it any more.

    Attributes:
        background: for each image its value in pixels where nothing is.
    """

    def __init__(
        self, memory: TransientMemory, block: _Block, count: int, size: Size, outside: float,
        background: Sequence[float],
    ) -> None:
        runtime = memory.runtime
        self.runtime = runtime
        self.count = count
        self.size = size
        self.outside = outside
        self.background = tuple(background)
        self._rows, self.pitch = plane_shape(count, size)
        self._image_shape = runtime.image_shape(self._rows, self.pitch)
        self._memory = memory
        self._block = block
        self.buffer = block.buffer
        self._image: Any = None
        self._image_is_current = False

    def within(self, window: Window | None) -> Window | None:
        """Return `window`, outside of which all pixels are set to the background, if it is one."""
        if window is not None:
            self.clear()
        return window

    def clear(self) -> None:
        """Queue what sets all pixels to the background."""
        self._memory.clear(self._block, self.count, self.size, self.outside, self.background)
        self.written()

    def argument(self) -> Any:
        """Return what a kernel reads: the buffer, or an image with the same contents."""
        if self._image_shape is None:
            return self.buffer
        if self._image is None:
            self._image = self._block.images.get(self._image_shape)
        image = super().argument()
        self._block.images[self._image_shape] = image
        return image

    @property
    def _owner(self) -> object:
        return self._block


class TransientArray(DeviceArray):
    """An array whose memory others get as soon as nothing refers to it any more."""

    def __init__(
        self, runtime: Runtime, block: _Block, count: int, dtype: type[np.generic]
    ) -> None:
        self.runtime = runtime
        self.dtype = np.dtype(dtype)
        self.count = count
        self._block = block
        self.buffer = block.buffer
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
        self._blocks: list[_Block] = []
        self._borders: dict[float, DeviceArray] = {}
        # For tests: whether memory is ever given out twice, and whether it is NaN when it is.
        self._sharing = True
        self._spoiling = False

    @property
    def size(self) -> int:
        """Bytes that it has, given out or not."""
        return sum(block.size for block in self._blocks)

    @property
    def used(self) -> int:
        """Bytes of these that are given out."""
        return sum(block.size for block in self._blocks if not block.free)

    def plane(
        self, count: int, size: Size, outside: float = 0.0,
        background: Sequence[float] | None = None,
    ) -> Plane:
        """Return memory for `count` images; their `background` is the outside value by default."""
        if self.runtime.memory.counting:
            return self.runtime.plane(count, size, outside)
        rows, pitch = plane_shape(count, size)
        with self.runtime.lock:
            layout = rows, pitch, size[1], outside
            block = self._free(4 * rows * pitch, layout)
            plane = TransientPlane(
                self, block, count, size, outside, background or (outside,) * count
            )
            block.user = weakref.ref(plane)
            self._border(block, layout)
            return plane

    def array(self, count: int, dtype: type[np.generic]) -> DeviceArray:
        """Return memory for `count` elements (at least one)."""
        return self._array(count, dtype, None)

    def images(self, count: int, size: Size) -> DeviceArray:
        """Return the memory of a plane whose outside value is 0 as an array of float32."""
        rows, pitch = plane_shape(count, size)
        return self._array(rows * pitch, np.float32, (rows, pitch, size[1], 0.0))

    def _array(
        self, count: int, dtype: type[np.generic], layout: _Layout | None
    ) -> DeviceArray:
        if self.runtime.memory.counting:
            return self.runtime.empty(count, dtype)
        count = max(count, 1)
        with self.runtime.lock:
            block = self._free(max(count * np.dtype(dtype).itemsize, 4), layout)
            array = TransientArray(self.runtime, block, count, dtype)
            block.user = weakref.ref(array)
            if layout is None:
                block.layout = None
            else:
                self._border(block, layout)
            return array

    def zero(self, array: DeviceArray) -> None:
        """Queue what sets all of an array to 0."""
        self._fill(array.buffer, 0.0, 0, array.count * array.dtype.itemsize, "clear")

    def let_go(self, before: int) -> bool:
        """Give the memory back to the driver that was free for longest, if it was not used since
        the call number `before`; return whether there was any."""
        free = [block for block in self._blocks if block.free and block.call < before]
        if not free:
            return False
        self._blocks.remove(min(free, key=lambda block: block.call))
        return True

    def oldest(self) -> int | None:
        """Return the number of the call that last used what was free for longest."""
        return min((block.call for block in self._blocks if block.free), default=None)

    def _free(self, size: int, layout: _Layout | None) -> _Block:
        """Return the least block that fits; a free one that is too small makes room for a new one.
        """
        free = [block for block in self._blocks if block.free] if self._sharing else []
        fitting = [block for block in free if block.size >= size]
        if fitting:
            block = min(fitting, key=lambda block: (block.size, block.layout != layout))
            self.runtime.touch()
            if self._spoiling:
                block.layout = None
                self._fill(block.buffer, np.nan, 0, block.size // 4 * 4)
        else:
            if not self._sharing:
                self._blocks = [block for block in self._blocks if not block.free]
            elif free:
                self._blocks.remove(max(free, key=lambda block: block.size))
                free.clear()
            with self.runtime.memory.keeping():
                block = _Block(self.runtime, size)
            self._blocks.append(block)
        block.call = self.runtime.calls
        return block

    def clear(
        self, block: _Block, count: int, size: Size, outside: float, background: Sequence[float]
    ) -> None:
        """Queue what sets the images of a plane to their background."""
        rows, pitch = plane_shape(count, size)
        if all(value == outside for value in background):
            self._fill(block.buffer, outside, 0, 4 * rows * pitch, "clear")
            return
        image = 4 * size[0] * pitch
        for number, value in enumerate(background):
            self._fill(block.buffer, value, 4 * pitch + number * image, image, "clear")
        block.layout = None
        self._border(block, (rows, pitch, size[1], outside))

    def _border(self, block: _Block, layout: _Layout) -> None:
        """Queue what sets the guards of a plane to its outside value, unless they are."""
        if block.layout == layout:
            return
        cl = opencl()

        block.layout = None
        rows, pitch, columns, outside = layout
        wide = 4 * (pitch - columns)
        for row in (0, rows - 1):
            self._fill(block.buffer, outside, 4 * row * pitch, 4 * pitch)
        values = self._border_values(outside, rows * (pitch - columns))
        cl.enqueue_copy(
            self.runtime.queue, block.buffer, values.buffer,
            src_origin=(0, 0), dst_origin=(4 * columns, 0), region=(wide, rows),
            src_pitches=(wide,), dst_pitches=(4 * pitch,),
        )
        block.layout = layout

    def _border_values(self, outside: float, count: int) -> DeviceArray:
        """Return so many times the outside value, in device memory."""
        values = self._borders.get(outside)
        if values is None or values.count < count:
            self._borders.pop(outside, None)
            values = self.runtime.array(np.full(count, outside, np.float32))
            self._borders[outside] = values
        return values

    def _fill(
        self, buffer: Any, value: float, start: int, size: int, name: str | None = None
    ) -> None:
        cl = opencl()

        self.runtime.touch()
        event = cl.enqueue_fill_buffer(self.runtime.queue, buffer, np.float32(value), start, size)
        if name is not None:
            self.runtime.record(name, event)


class Target:
    """Where a pass writes: a plane of its own that keeps its contents, or a transient one.

    Args:
        runtime: the device.
        count, size, outside: of the plane.
        kept: whether the plane is this object's own: the same in every call, and what is outside
            the window of a call keeps its background. Else it lives as long as somebody refers to
            it.
    """

    def __init__(
        self, runtime: Runtime, count: int, size: Size, outside: float = 0.0, *,
        kept: bool = True,
    ) -> None:
        self.runtime = runtime
        self.count = count
        self.size = size
        self.outside = outside
        self._plane = runtime.plane(count, size, outside) if kept else None
        self._trace = Trace()

    @contextmanager
    def over(
        self, window: Window | None, *, background: Sequence[float] | None = None
    ) -> Iterator[tuple[Plane, Window | None]]:
        """Give the plane, and where in it a pass works that shows anything in `window` alone.

        `background` is the value of each image beyond, the outside value by default.
        """
        if self._plane is not None:
            with self._trace.over(window) as over:
                yield self._plane, over
            return
        plane = self.runtime.transient.plane(self.count, self.size, self.outside, background)
        yield plane, plane.within(window) if isinstance(plane, TransientPlane) else window


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

