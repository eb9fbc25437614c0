"""Device memory: lists of numbers, and planes of pixels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.active_region import Region, copy_region
from ssgi_cl.device.constants import SSGI_GUARD
from ssgi_cl.device.opencl import opencl

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

GUARD = SSGI_GUARD

Size = tuple[int, int]
"""(rows, columns)"""


def plane_shape(count: int, size: Size) -> tuple[int, int]:
    """Return (rows, floats in a row) of the memory of a plane."""
    # One row before, one after; a guard behind each.
    return count * size[0] + 2, (size[1] + 15) // 16 * 16 + GUARD


def plane_bytes(count: int, size: Size) -> int:
    """Return the size of the memory of a plane."""
    rows, pitch = plane_shape(count, size)
    return 4 * rows * pitch


@contextmanager
def map_memory(memory: DeviceArray | Plane, shape: tuple[int, ...], flags: int, dtype: Any) -> Iterator[NDArray[Any]]:
    """Give memory that the device shares with the host to the host."""
    queue = memory.runtime.queue
    view, _ = opencl().enqueue_map_buffer(queue, memory.buffer, flags, 0, shape, dtype)
    try:
        yield view
    finally:
        view.base.release(queue)


class DeviceArray:
    """A list of numbers in device memory."""

    def __init__(self, runtime: Runtime, values: NDArray[Any], *, fill: bool = True) -> None:
        self.runtime = runtime
        self.dtype = values.dtype
        self.count = values.size
        # Memory that is made with its contents waits for nothing that is queued.
        contents = np.ascontiguousarray(values) if fill and values.size else None
        size = max(values.nbytes, 4)
        if contents is not None and contents.nbytes < size:
            contents = np.resize(contents.view(np.uint8), size)
        self.buffer = runtime.allocate(size, self, contents)
        self._sent: Any = None  # holds what the device may still read

    def upload(self, values: NDArray[Any]) -> None:
        """Replace the contents; same dtype, at most the same number of elements."""
        self._copy(np.ascontiguousarray(values, self.dtype), wait=True)
        self._sent = None

    def send(self, values: NDArray[Any]) -> None:
        """As `upload`, but of a copy, which the device takes when it has done what was queued."""
        self._sent = self._copy(np.array(values, self.dtype, order="C"), wait=False)

    def fill(self, value: float) -> None:
        """Queue the pass that sets all elements to a value."""
        self.runtime.touch()
        size = self.count * self.dtype.itemsize
        pattern = self.dtype.type(value)
        event = opencl().enqueue_fill_buffer(self.runtime.queue, self.buffer, pattern, 0, size)
        self.runtime.record("clear", event)

    def _copy(self, values: NDArray[Any], wait: bool) -> Any:
        if values.size > self.count:
            raise ValueError(f"values has {values.size} elements: expected at most {self.count}")
        if not values.size:
            return None
        self.runtime.touch()
        return opencl().enqueue_copy(self.runtime.queue, self.buffer, values.ravel(), is_blocking=wait)

    def download(self) -> NDArray[Any]:
        """Return a copy of the contents."""
        values = np.empty(self.count, self.dtype)
        opencl().enqueue_copy(self.runtime.queue, values, self.buffer, is_blocking=True)
        return values

    @contextmanager
    def mapped(self) -> Iterator[NDArray[Any]]:
        """Give the contents to the host to be read, without a copy where memory is shared."""
        if self.runtime.shares_memory:
            with map_memory(self, (self.count,), opencl().map_flags.READ, self.dtype) as memory:
                yield memory
        else:
            yield self.download()

    def argument(self) -> Any:
        """Return what a kernel takes."""
        return self.buffer


class Plane:
    """`count` images of the same size in device memory, float32.

    Layout: kernels/common/gbuffer.clh. On a device that shares the host's memory, uploads and
    downloads are one copy between numpy's array and the mapped memory, and `view` is none at all.

    Raises:
        DeviceError: kernels read images, and the device has none so large.
        DeviceMemoryError: there is no room.
    """

    def __init__(self, runtime: Runtime, count: int, size: Size, outside: float) -> None:
        self._describe(runtime, count, size, outside)
        bytes_ = self._rows * self.pitch * 4
        self.buffer = runtime.allocate(bytes_, self)
        opencl().enqueue_fill_buffer(runtime.queue, self.buffer, np.float32(outside), 0, bytes_)

    def _describe(self, runtime: Runtime, count: int, size: Size, outside: float) -> None:
        self.runtime, self.count, self.size, self.outside = runtime, count, size, outside
        self._rows, self.pitch = plane_shape(count, size)
        self._image_shape = runtime.image_shape(self._rows, self.pitch)
        self._image: Any = None
        self._image_is_current = False

    @contextmanager
    def _mapped(self, *, write: bool = False) -> Iterator[NDArray[np.float32]]:
        """Give the whole memory [rows, pitch] to the host; with `write` it is written back at the end."""
        cl = opencl()
        queue, shape = self.runtime.queue, (self._rows, self.pitch)
        if self.runtime.shares_memory:
            flags = cl.map_flags.READ | cl.map_flags.WRITE if write else cl.map_flags.READ
            with map_memory(self, shape, flags, np.float32) as memory:
                yield memory
            return
        memory = np.empty(shape, np.float32)
        if write and self._image is None:
            memory[...] = self.outside
        else:
            cl.enqueue_copy(queue, memory, self.buffer, is_blocking=True)
        yield memory
        if write:
            cl.enqueue_copy(queue, self.buffer, memory, is_blocking=True)

    def _images(self, memory: NDArray[np.float32]) -> NDArray[np.float32]:
        rows, columns = self.size
        inner = memory[1 : 1 + self.count * rows]
        return inner.reshape(self.count, rows, self.pitch)[:, :, :columns]

    def upload(self, values: NDArray[np.float32]) -> None:
        """Replace the contents by `values` [count, rows, columns], any strides."""
        self.runtime.touch()
        self._image_is_current = False
        with self._mapped(write=True) as memory:
            np.copyto(self._images(memory), values)

    def download(self, out: NDArray[np.float32] | None = None, region: Region | None = None) -> NDArray[np.float32]:
        """Return a copy [count, rows, columns], written to `out` if given (any strides).

        Outside of `region` all pixels of an image are the same.
        """
        if out is None:
            self.runtime.memory.require_host(4 * self.count * self.size[0] * self.size[1])
            out = np.empty((self.count, *self.size), np.float32)
        beyond = None if region is None else region.beyond(self.size)
        with self._mapped() as memory:
            images = self._images(memory)
            if beyond is not None:
                copy_region(np.moveaxis(images, 0, -1), np.moveaxis(out, 0, -1), region, beyond)
            else:
                # One by one: numpy is slow where strides are in different order.
                for target, image in zip(out, images, strict=True):
                    np.copyto(target, image)
        return out

    def copy_image(self, index: int, source: Plane, count: int = 1, first: int = 0) -> None:
        """Queue a copy of the images of `source` from `first` on, of the same size, to those from `index` on."""
        if source.size != self.size:
            raise ValueError(f"source has size {source.size}: expected {self.size}")
        size = self.size[0] * self.pitch * 4
        self.runtime.touch()
        self._image_is_current = False
        row = self.pitch * 4
        places = {"byte_count": count * size, "src_offset": row + first * size, "dst_offset": row + index * size}
        event = opencl().enqueue_copy(self.runtime.queue, self.buffer, source.buffer, **places)
        self.runtime.record("copy", event)

    @property
    def _memory(self) -> tuple[Any, int]:
        """The whole buffer that the plane lies in, and where in it, in bytes."""
        return self.buffer, 0

    @property
    def _owner(self) -> object:
        """The object that the memory of the image is counted for."""
        return self

    def written(self) -> None:
        """Note that a kernel is about to write to this plane."""
        self._image_is_current = False

    def argument(self) -> Any:
        """Return what a kernel reads: the buffer, or an image with the same contents."""
        if self._image_shape is None:
            return self.buffer
        cl = opencl()

        rows, columns = self._image_shape
        if self._image is None:
            layout = cl.ImageFormat(cl.channel_order.R, cl.channel_type.FLOAT)
            flags = cl.mem_flags.READ_ONLY
            self.runtime.take(rows * columns * 4, self._owner)
            self._image = cl.create_image(self.runtime.context, flags, layout, (columns, rows))
        if not self._image_is_current:
            # Rows that are too many for an image lie to the right of the first.
            for number, first in enumerate(range(0, self._rows, rows)):
                buffer, start = self._memory
                event = cl.enqueue_copy(
                    self.runtime.queue,
                    self._image,
                    buffer,
                    offset=start + first * self.pitch * 4,
                    origin=(number * self.pitch, 0),
                    region=(self.pitch, min(self._rows - first, rows)),
                )
                self.runtime.record("copy to image", event)
            self._image_is_current = True
        return self._image
