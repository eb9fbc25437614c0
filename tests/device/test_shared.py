"""Device memory of callers: read and written without a way through the host."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import arrays, gbuffer, shared
from ssgi_cl.device import runtime as runtime_module
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.shared import DLTensor
from ssgi_cl.rasterize.scenes import cornell_box

SIZE = (37, 50)


@pytest.fixture(scope="module")
def drawn(runtime: Runtime) -> gi.GBuffer:
    made = cornell_box()
    return gi.rasterize.gbuffer(made.scene, made.camera(SIZE[1], SIZE[0]), runtime=runtime)


def host(drawn: gi.GBuffer) -> dict[str, np.ndarray]:
    names = ("depth", "normal", "albedo")
    return {name: np.ascontiguousarray(getattr(drawn, name), np.float32).squeeze() for name in names}


class Exported:
    """A peer whose arrays are OpenCL buffers, with DLPack."""

    def __init__(
        self, buffer: Any, shape: tuple[int, ...], *, device: int = 4, bits: int = 32, offset: int = 0
    ) -> None:
        self._shape = (ctypes.c_int64 * len(shape))(*shape)
        self.buffer, self.tensor = buffer, DLTensor()
        self.tensor.data = buffer.int_ptr
        self.tensor.device.type, self.tensor.ndim, self.tensor.byte_offset = device, len(shape), offset
        self.tensor.dtype.code, self.tensor.dtype.bits, self.tensor.dtype.lanes = 2, bits, 1
        self.tensor.shape = self._shape

    def __dlpack_device__(self) -> tuple[int, int]:
        return 4, 0

    def __dlpack__(self) -> Any:
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
        return new(ctypes.addressof(self.tensor), b"dltensor", None)


def as_array(runtime: Runtime, values: np.ndarray) -> Any:
    import pyopencl.array as cl_array

    return cl_array.to_device(runtime.queue, values)


def as_strided_array(runtime: Runtime, values: np.ndarray) -> Any:
    """Of which only every other row is the array's."""
    return as_array(runtime, np.repeat(values, 2, axis=0))[::2]


def as_buffer(runtime: Runtime, values: np.ndarray) -> Any:
    import pyopencl as cl

    return cl.Buffer(runtime.context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=values)


def as_image(runtime: Runtime, values: np.ndarray) -> Any:
    import pyopencl as cl

    if values.ndim == 3:
        values = np.dstack([values, np.zeros(SIZE, np.float32)])
    order = cl.channel_order.R if values.ndim == 2 else cl.channel_order.RGBA
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    form = cl.ImageFormat(order, cl.channel_type.FLOAT)
    return cl.create_image(runtime.context, flags, form, (SIZE[1], SIZE[0]), hostbuf=np.ascontiguousarray(values))


def as_dlpack(runtime: Runtime, values: np.ndarray) -> Any:
    return Exported(as_buffer(runtime, np.ascontiguousarray(values)), values.shape)


@pytest.mark.parametrize("made", [as_array, as_strided_array, as_buffer, as_image, as_dlpack])
def test_a_gbuffer_of_device_memory_has_the_bits_of_one_of_the_host(
    runtime: Runtime, drawn: gi.GBuffer, made: Any
) -> None:
    given = host(drawn)
    wanted, found = (gi.DeviceGBuffer(runtime, SIZE) for _ in range(2))
    wanted.upload(gi.GBuffer(camera=drawn.camera, **given))
    found.take(drawn.camera, **{name: made(runtime, values) for name, values in given.items()})
    for name in ("depth", "linear", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(found, name).download(), getattr(wanted, name).download())


def test_layers_and_margin_are_those_of_the_gbuffer(runtime: Runtime, rng: np.random.Generator) -> None:
    margin, whole = (2, 3), (SIZE[0] + 4, SIZE[1] + 6)
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), width=SIZE[1], height=SIZE[0])
    depth = np.sort(rng.uniform(1.0, 2.0, (2, *whole)), axis=0).astype(np.float32)
    albedo = rng.uniform(0.0, 1.0, (2, *whole, 3)).astype(np.float32)
    device = gi.DeviceGBuffer(runtime, SIZE, layers=2, margin=margin, attributes=2)
    device.take(camera, as_array(runtime, depth), albedo=as_array(runtime, albedo))
    np.testing.assert_array_equal(device.depth.download(), depth)
    np.testing.assert_array_equal(device.albedo.download().reshape(2, 3, *whole), np.moveaxis(albedo, -1, 1))


def test_what_no_surface_has_counts_as_nothing(runtime: Runtime) -> None:
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), width=5, height=1)
    depth = np.array([[1.0, 0.0, -1.0, np.nan, np.inf]], np.float32)
    albedo = np.full((1, 5, 3), np.nan, np.float32)
    device = gi.DeviceGBuffer(runtime, (1, 5))
    device.take(camera, as_array(runtime, depth), albedo=as_array(runtime, albedo))
    np.testing.assert_array_equal(device.depth.download()[0, 0], [1.0, np.inf, np.inf, np.inf, np.inf])
    assert not device.albedo.download().any()


def test_a_loop_of_frames_brings_nothing_to_the_host_or_from_it(
    runtime: Runtime, drawn: gi.GBuffer, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pyopencl as cl

    given = {name: as_array(runtime, values) for name, values in host(drawn).items()}
    ao = as_array(runtime, np.zeros(SIZE, np.float32))
    device, gtao = gi.DeviceGBuffer(runtime, SIZE), gi.Gtao(runtime, SIZE, gi.GtaoParams(radius=0.3))
    wanted = gi.gtao(drawn, radius=0.3, runtime=runtime)
    transfers: list[str] = []

    class Counted:
        """PyOpenCL, of which what moves numbers between host and device is counted."""

        def __getattr__(self, name: str) -> Any:
            found = getattr(cl, name)
            if name not in ("enqueue_copy", "enqueue_map_buffer", "enqueue_map_image", "Buffer"):
                return found

            def call(*args: Any, **kwargs: Any) -> Any:
                hosted = any(isinstance(value, np.ndarray) for value in (*args, *kwargs.values()))
                if hosted or name.startswith("enqueue_map"):
                    transfers.append(name)
                return found(*args, **kwargs)

            return call

    def frame() -> None:
        device.take(drawn.camera, **given)
        runtime.copy_to(gtao.run(device), ao)

    frame()  # makes what later frames keep
    counted = Counted()
    for module in (arrays, gbuffer, runtime_module, shared):
        monkeypatch.setattr(module, "opencl", lambda: counted)
    before = runtime.allocated_bytes
    for _ in range(3):
        frame()
    assert transfers == []
    assert runtime.allocated_bytes == before
    device.depth.download()
    assert transfers != [], "transfers are not counted"
    monkeypatch.undo()
    np.testing.assert_array_equal(ao.get(), wanted)


@pytest.mark.parametrize("made", [as_array, as_buffer, as_dlpack])
def test_results_of_several_images_have_channels_last(runtime: Runtime, rng: np.random.Generator, made: Any) -> None:
    values = rng.random((3, *SIZE)).astype(np.float32)
    plane = runtime.plane(3, SIZE)
    plane.upload(values)
    target = made(runtime, np.zeros((*SIZE, 3), np.float32))
    runtime.copy_to(plane, target).wait()
    found = np.empty((*SIZE, 3), np.float32)
    memory = target.base_data if hasattr(target, "base_data") else getattr(target, "buffer", target)
    import pyopencl as cl

    cl.enqueue_copy(runtime.queue, found, memory)
    np.testing.assert_array_equal(found, np.moveaxis(values, 0, -1))


def test_a_runtime_in_a_callers_context_shares_its_memory(runtime: Runtime, drawn: gi.GBuffer) -> None:
    import pyopencl as cl
    import pyopencl.array as cl_array

    context = cl.Context([runtime.device])
    queue, own = cl.CommandQueue(context), Runtime.in_context(context)
    given = {name: cl_array.to_device(queue, values) for name, values in host(drawn).items()}
    device = gi.DeviceGBuffer(own, SIZE)
    ready = cl.enqueue_marker(queue)
    device.take(drawn.camera, wait_for=[ready], **given).wait()
    ao = cl_array.empty(queue, SIZE, np.float32)
    cl.enqueue_barrier(queue, wait_for=[own.copy_to(gi.Gtao(own, SIZE, gi.GtaoParams(radius=0.3)).run(device), ao)])
    np.testing.assert_array_equal(ao.get(), gi.gtao(drawn, radius=0.3, runtime=runtime))
    with pytest.raises(DeviceError, match="depth is of another OpenCL context: make it in"):
        gi.DeviceGBuffer(runtime, SIZE).take(drawn.camera, given["depth"])


@pytest.mark.parametrize(
    ("value", "error", "said"),
    [
        (lambda rt: np.ones(SIZE, np.float32), TypeError, "depth is ndarray: expected pyopencl.array.Array"),
        (lambda rt: as_array(rt, np.ones(SIZE)), TypeError, "depth is of float64: expected float32"),
        (
            lambda rt: as_array(rt, np.ones((3, 4), np.float32)),
            ValueError,
            r"depth has shape \(3, 4\): expected \(37, 50\)",
        ),
        (lambda rt: as_buffer(rt, np.ones(7, np.float32)), ValueError, "depth has 28 bytes: expected 7400"),
        (lambda rt: as_image(rt, np.ones((*SIZE, 3), np.float32)), None, ""),
        (lambda rt: Exported(as_buffer(rt, np.ones(SIZE, np.float32)), SIZE, bits=16), TypeError, "DLPack's type"),
        (
            lambda rt: Exported(as_buffer(rt, np.ones(SIZE, np.float32)), SIZE, device=2),
            TypeError,
            "type 2: expected 4",
        ),
    ],
)
def test_other_memory_is_refused(runtime: Runtime, drawn: gi.GBuffer, value: Any, error: Any, said: str) -> None:
    device = gi.DeviceGBuffer(runtime, SIZE)
    if error is None:  # the first of four channels
        device.take(drawn.camera, value(runtime))
        assert (device.depth.download() == 1.0).all()
        return
    with pytest.raises(error, match=said):
        device.take(drawn.camera, value(runtime))


def test_an_image_is_not_written(runtime: Runtime) -> None:
    with pytest.raises(TypeError, match="results are written to those"):
        runtime.copy_to(runtime.plane(1, SIZE), as_image(runtime, np.ones(SIZE, np.float32)))
