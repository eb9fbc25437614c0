"""Device memory of callers, read and written without a way through the host.

`pyopencl.array.Array`, `pyopencl.Buffer`, `pyopencl.Image` and DLPack arrays of OpenCL devices. Numbers are float32.
The caller owns the memory: nothing is kept of it but by what is queued. It has to be of the runtime's context; what
the caller's own queues write to it must be done, or given as events, before the library reads it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.opencl import opencl

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

DLPACK_OPENCL = 4
"""kDLOpenCL, the type of a device in DLPack."""
_FLOAT32 = (2, 32, 1)
"""Code, bits and lanes of DLPack."""


class _Borrowed(DeviceArray):
    """Memory of a caller as a kernel takes it."""

    def __init__(self, runtime: Runtime, buffer: Any, count: int) -> None:
        self.runtime, self.buffer, self.count = runtime, buffer, count
        self.dtype = np.dtype(np.float32)
        self._sent = None


@dataclass(frozen=True)
class Strided:
    """Numbers in device memory with a shape, any order of axes.

    Attributes:
        memory: of a buffer.
        first: number of the element 0.
        shape: of the array.
        steps: elements between neighbours along each axis.
    """

    memory: DeviceArray
    first: int
    shape: tuple[int, ...]
    steps: tuple[int, ...]

    def stacked(self) -> Strided:
        """Return it as the only one of an array of such."""
        return Strided(self.memory, self.first, (1, *self.shape), (0, *self.steps))


def is_shared(value: Any) -> bool:
    """Return whether a value is device memory of OpenCL that `strided` takes."""
    cl = opencl()
    if isinstance(value, cl.MemoryObject) or hasattr(value, "base_data"):
        return True
    return hasattr(value, "__dlpack_device__") and int(value.__dlpack_device__()[0]) == DLPACK_OPENCL


def strided(runtime: Runtime, name: str, value: Any, shape: Sequence[int], *, written: bool = False) -> Strided:
    """Return a caller's memory as an array of a shape.

    Args:
        runtime: whose context it has to be of.
        name: of the argument, for messages.
        value: pyopencl.array.Array, pyopencl.Buffer (C-contiguous), pyopencl.Image of float32 (one channel or four,
            of which those that `shape` has are read), or an object with __dlpack__ on an OpenCL device.
        shape: that it has to have.
        written: whether it will be written; images are read only.

    Raises:
        TypeError: it is none of these, or not of float32.
        ValueError: of another shape or size.
        DeviceError: of another context.
    """
    cl = opencl()
    wanted = tuple(shape)
    if hasattr(value, "base_data"):  # pyopencl.array.Array
        return _of_array(runtime, name, value, wanted)
    if isinstance(value, cl.Image):
        if written:
            raise TypeError(
                f"{name} is a pyopencl.Image: expected a buffer or an array, as results are written to those"
            )
        return _of_image(runtime, name, value, wanted)
    if isinstance(value, cl.MemoryObject):
        _check_context(runtime, name, value)
        if value.size < 4 * prod(wanted):
            raise ValueError(f"{name} has {value.size} bytes: expected {4 * prod(wanted)}, float32 of shape {wanted}")
        return Strided(_Borrowed(runtime, value, value.size // 4), 0, wanted, _contiguous(wanted))
    if is_shared(value):
        return _of_dlpack(runtime, name, value, wanted)
    raise TypeError(
        f"{name} is {type(value).__name__}: expected pyopencl.array.Array, pyopencl.Buffer, pyopencl.Image, or an "
        "array with DLPack on an OpenCL device"
    )


def pack(plane: Plane, source: Strided, *, to: int = 0, positive: bool = False) -> None:
    """Queue a copy of an array [images, rows, columns] to the images of a plane from number `to` on.

    NaN becomes the plane's outside value, with `positive` so does what is not above 0.
    """
    kernel = plane.runtime.kernel("gbuffer/gbuffer_pack.cl", {"PACK_COUNT": source.shape[0]}, most_lanes=1)
    places = _places(source)
    kernel.run(
        plane.size, source=source.memory, plane=plane, outside=plane.outside, positive=int(positive), to=to, **places
    )


def unpack(plane: Plane, target: Strided) -> None:
    """Queue a copy of the images of a plane to an array [images, rows, columns]."""
    kernel = plane.runtime.kernel("gbuffer/gbuffer_unpack.cl", {"PACK_COUNT": target.shape[0]}, most_lanes=1)
    kernel.run(plane.size, plane=plane, target=target.memory, **_places(target))


def channels_first(array: Strided) -> Strided:
    """Return a view [..., channels, rows, columns] of an array [..., rows, columns, channels]."""
    *lead, rows, columns, channels = range(len(array.shape))
    order = (*lead, channels, rows, columns)
    shape, steps = tuple(array.shape[axis] for axis in order), tuple(array.steps[axis] for axis in order)
    return Strided(array.memory, array.first, shape, steps)


def _places(array: Strided) -> dict[str, Any]:
    image, row, column = array.steps
    return {"first": array.first, "image": image, "row": row, "column": column}


def _contiguous(shape: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(prod(shape[axis + 1 :]) for axis in range(len(shape)))


def _check_context(runtime: Runtime, name: str, memory: Any) -> None:
    if memory.get_info(opencl().mem_info.CONTEXT) != runtime.context:
        raise DeviceError(
            f"{name} is of another OpenCL context: make it in runtime.context, or a runtime with "
            "Runtime.in_context(context)"
        )


def _check_shape(name: str, shape: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    if shape != wanted:
        raise ValueError(f"{name} has shape {shape}: expected {wanted}")


def _of_array(runtime: Runtime, name: str, value: Any, wanted: tuple[int, ...]) -> Strided:
    if value.dtype != np.float32:
        raise TypeError(f"{name} is of {value.dtype}: expected float32")
    _check_shape(name, tuple(value.shape), wanted)
    _check_context(runtime, name, value.base_data)
    if value.offset % 4 or any(step % 4 for step in value.strides):
        raise ValueError(f"{name} has strides {value.strides} from {value.offset}: expected multiples of 4 bytes")
    memory = _Borrowed(runtime, value.base_data, value.base_data.size // 4)
    return Strided(memory, value.offset // 4, wanted, tuple(step // 4 for step in value.strides))


def _of_image(runtime: Runtime, name: str, value: Any, wanted: tuple[int, ...]) -> Strided:
    """Return a copy of an image in a buffer of the device: kernels that read buffers can't read it."""
    cl = opencl()
    _check_context(runtime, name, value)
    layout = value.get_image_info(cl.image_info.FORMAT)
    channels = {cl.channel_order.R: 1, cl.channel_order.RGBA: 4}.get(layout.channel_order)
    if channels is None or layout.channel_data_type != cl.channel_type.FLOAT:
        raise TypeError(f"{name} is an image of {layout}: expected R or RGBA of FLOAT")
    rows, columns = value.height, value.width
    shape = (rows, columns) if len(wanted) == 2 else (rows, columns, min(channels, wanted[-1]))
    _check_shape(name, shape, wanted)
    # Not transient memory: PoCL 3 crashes where images are copied to a part of a buffer.
    count = rows * columns * channels
    copy = runtime.prepared((_of_image, name, count), lambda: runtime.empty(count, np.float32))
    cl.enqueue_copy(runtime.queue, copy.buffer, value, offset=0, origin=(0, 0), region=(columns, rows))
    steps = (columns * channels, channels, 1)
    return Strided(copy, 0, wanted, steps[: len(wanted)])


class _Device(ctypes.Structure):
    _fields_ = (("type", ctypes.c_int32), ("id", ctypes.c_int32))


class _Type(ctypes.Structure):
    _fields_ = (("code", ctypes.c_uint8), ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16))


class DLTensor(ctypes.Structure):
    """DLPack's description of an array, as its header has it; `data` of an OpenCL device is a cl_mem."""

    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device", _Device),
        ("ndim", ctypes.c_int32),
        ("dtype", _Type),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


def _of_dlpack(runtime: Runtime, name: str, value: Any, wanted: tuple[int, ...]) -> Strided:
    """Return what a capsule describes; it stays the peer's, which frees it with the capsule."""
    capsule = value.__dlpack__()
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    tensor = ctypes.cast(pointer(capsule, b"dltensor"), ctypes.POINTER(DLTensor)).contents
    if tensor.device.type != DLPACK_OPENCL:
        raise TypeError(f"{name} is on a DLPack device of type {tensor.device.type}: expected {DLPACK_OPENCL}, OpenCL")
    kind = (tensor.dtype.code, tensor.dtype.bits, tensor.dtype.lanes)
    if kind != _FLOAT32:
        raise TypeError(f"{name} has DLPack's type {kind}: expected {_FLOAT32}, float32")
    shape = tuple(tensor.shape[: tensor.ndim])
    _check_shape(name, shape, wanted)
    steps = tuple(tensor.strides[: tensor.ndim]) if tensor.strides else _contiguous(shape)
    if tensor.byte_offset % 4:
        raise ValueError(f"{name} begins at byte {tensor.byte_offset}: expected a multiple of 4")
    buffer = opencl().MemoryObject.from_int_ptr(tensor.data, retain=True)
    _check_context(runtime, name, buffer)
    return Strided(_Borrowed(runtime, buffer, buffer.size // 4), tensor.byte_offset // 4, shape, steps)
