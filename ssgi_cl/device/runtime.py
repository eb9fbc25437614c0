"""The runtime: one device with its queue, programs and memory, and the time of every pass."""

from __future__ import annotations

import gc
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import kind_among, of_kind
from ssgi_cl.core.errors import DeviceError, DeviceMemoryError
from ssgi_cl.core.gbuffer_batch import image_by_image, images_in
from ssgi_cl.core.keywords import check_keywords
from ssgi_cl.device import drivers, image_limits, requirements
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.beside import SecondQueue
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.drivers.probe_timer import speed_in_use
from ssgi_cl.device.image_limits import ImageLimits
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.memory import DeviceMemory, outline
from ssgi_cl.device.opencl import described, listed_device, opencl
from ssgi_cl.device.prepared import PreparedResults
from ssgi_cl.device.process import check_not_forked, load_driver, loaded_driver, usable_device
from ssgi_cl.device.programs import Programs
from ssgi_cl.device.shared import channels_first, strided, unpack
from ssgi_cl.device.structs import Struct
from ssgi_cl.device.timing import FrameLog
from ssgi_cl.device.transient import TransientMemory

P = ParamSpec("P")
T = TypeVar("T")


class Runtime:
    """A device, opened. Make one with `Runtime.open`.

    Threads may share it: functions and `Renderer` run one after the other, see `exclusively`, and
    each thread has frames of its own. An object of a technique, a G-buffer or an array in device
    memory is for one thread at a time. A process that was forked after a device was opened can't
    use it: start such processes by "spawn".

    Attributes:
        info: the device.
        variant: the kernel variant that it gets: lanes and storage.
        context: of PyOpenCL, which its memory belongs to.
        memory: the device's memory: how much is in use, the most that was, and limits.
        transient: the memory that passes share.
        queue: in which all is done in order; `launching` is that which kernels go to.
        second: for kernels that run beside those of the queue.
        programs: what it has compiled.
        lock: held by what another thread's work on this device must not come between.
        image_limits: of images, where kernels read those.
        allocated_bytes: device memory taken so far, in all.
        frame, times, times_if_done, part, skip: the functions of `FrameLog`: passes of a frame and their times.
        kernel_from_text: as `Programs.kernel_from_text`.
    """

    def __init__(self, info: DeviceInfo, variant: KernelVariant, context: Any = None) -> None:
        cl = opencl()
        self.info = info
        self.variant = variant
        self.allocated_bytes = 0
        self.device = device = usable_device(info, variant) if context is None else context.devices[0]
        self.context = cl.Context([device]) if context is None else context
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.launching = self.queue
        self.second = SecondQueue(self)
        self.shares_memory = bool(device.host_unified_memory) and info.kind != "gpu"
        self.image_limits = ImageLimits.of(device) if variant.storage == "image" else None
        self.memory = DeviceMemory(
            info.label, device.global_mem_size, device.max_mem_alloc_size, on_host=self.shares_memory
        )
        self.programs = Programs(self, short_header=device.platform.name == "Portable Computing Language")
        self.transient = TransientMemory(self)
        self._prepared = PreparedResults(self)
        self._log = log = FrameLog()
        self.frame, self.part, self.skip = log.frame, log.part, log.skip
        self.times, self.times_if_done = log.times, log.times_if_done
        self.kernel_from_text = self.programs.kernel_from_text
        self.lock = threading.RLock()
        self._depth = 0  # of calls within calls, in the thread that has the lock
        self._working = False
        self._touched = False

    @classmethod
    def open(
        cls, name: str | None = None, *, lanes: int | None = None, storage: str | None = None, keep: int | None = None
    ) -> Runtime:
        """Return the runtime of a device; the same object for the same arguments.

        Args:
            name: words that the device's label holds, such as "pocl", "pocl 3.1" or "nvidia";
                by default the variable SSGI_CL_DEVICE, and without it the fastest device found.
            lanes, storage: force a build of the kernels (1, 8 or 16; "buffer" or "image") in
                place of the fastest on this device.
            keep: most bytes of device memory that calls keep for later ones, in all; what was not
                used for the longest time goes first. By default a quarter of `memory.limit`, or
                what an earlier call set.

        Raises:
            TypeError, ValueError: `keep` is no whole number, or below 0.
            DeviceError: no such device (the message lists all), another driver is in use in
                this process already, or the process was forked after a device was opened.
        """
        check_not_forked()
        if keep is not None:
            keep = checks.integer("keep", keep, low=0, high=1 << 62, unit="bytes")
        with _OPENING:
            runtime = cls._opened(name or os.environ.get("SSGI_CL_DEVICE"), lanes, storage)
        if keep is not None:
            runtime.memory.keep = keep
        return runtime

    @classmethod
    def _opened(cls, name: str | None, lanes: int | None, storage: str | None) -> Runtime:
        info, variant = drivers.choose_variant(name, lanes, storage, loaded_driver())
        key = (info.driver, info.platform, info.device, variant, os.environ.get(image_limits.VARIABLE))
        runtime = _OPENED.get(key)
        if runtime is None:
            load_driver(info)
            if listed_device(info) is None:  # the record is of another configuration
                drivers.look_again(Path(info.driver))
                info, variant = drivers.choose_variant(name, lanes, storage, loaded_driver())
                load_driver(info)
            runtime = _OPENED[key] = cls(info, variant)
            drivers.confirm(info, variant, lambda: speed_in_use(cls(info, variant)))
        return runtime

    @classmethod
    def in_context(cls, context: Any, *, lanes: int | None = None, storage: str = "buffer") -> Runtime:
        """Return a new runtime in a caller's `pyopencl.Context`, so that memory can be shared.

        It has the context's first device and a queue of its own. Keep it for all frames: what it compiled and
        prepared goes with it.

        Args:
            context: of one driver; PyOpenCL has loaded all of them by then, so that two with an LLVM of their own may
                clash.
            lanes, storage: the form of the kernels; by default 1 lane on GPUs and 8 on processors, which is not timed.

        Raises:
            DeviceError: the device lacks what kernels need.
        """
        check_not_forked()
        device = context.devices[0]
        info = DeviceInfo("", 0, 0, **described(device.platform, device))
        requirements.check(info.label, device)
        if storage == "image" and not device.image_support:
            raise DeviceError(f"{info.label} has no images: use storage 'buffer'")
        narrow = info.kind != "cpu" or storage == "image"
        return cls(info, KernelVariant((1 if narrow else 8) if lanes is None else lanes, storage), context)

    def copy_to(self, plane: Plane, target: Any, *, wait_for: Sequence[Any] | None = None) -> Any:
        """Queue a copy of a result to a caller's device memory, and return the event after which it is there.

        Args:
            plane: what a prepared technique returned.
            target: pyopencl.array.Array, pyopencl.Buffer (C-contiguous) or DLPack array of an OpenCL device, float32,
                [rows, columns], or with several images [rows, columns, images].
            wait_for: events of other queues after which it may be written.

        Raises:
            TypeError, ValueError: it is no such memory, or of another shape.
            DeviceError: it is of another context.
        """
        cl = opencl()
        shape = plane.size if plane.count == 1 else (*plane.size, plane.count)
        array = strided(self, "target", target, shape, written=True)
        array = array.stacked() if plane.count == 1 else channels_first(array)
        if wait_for:
            cl.enqueue_barrier(self.queue, wait_for=list(wait_for))
        unpack(plane, array)
        self.queue.flush()
        return cl.enqueue_marker(self.queue)

    def __repr__(self) -> str:
        return f"<Runtime {self.info.label}, {self.variant}>"

    # ---- who uses it

    def exclusively(self, work: Callable[[], T]) -> T:
        """Return what `work` returns, run while no other thread's work runs on this device.

        If it ends in an exception, be it Ctrl-C, after it changed anything on the device, nothing
        that is kept for later calls is trusted any more: the next call makes it anew.
        """
        check_not_forked()
        # Attributes are set in this function and in this order, and not in context managers of
        # Python, so that an interrupt finds no gap between them.
        with self.lock:
            before = self._depth
            if before == 0:
                if self._working and self._touched:
                    self._prepared.clear()
                self._prepared.calls += 1
                self._touched = False
                self._working = True
            frames = self._log.depth
            self._depth = before + 1
            try:
                result = work()
            finally:
                self._depth = before
                self._log.depth = frames
            if before == 0:
                self._working = False
                self._prepared.bound()  # passes may have taken more than what was prepared
            return result

    @property
    def in_call(self) -> bool:
        """Whether a call of the library runs now, see `exclusively`."""
        return self._depth > 0

    @property
    def calls(self) -> int:
        """Number of the call of the library that runs now."""
        return self._prepared.calls

    def touch(self) -> None:
        """Note that something on the device is about to change.

        Raises:
            DeviceError: this process was forked after the device was opened.
        """
        check_not_forked()
        self._touched = True

    # ---- memory

    def plane(self, count: int, size: Size, outside: float = 0.0) -> Plane:
        """Return new device memory for `count` images; see kernels/common/gbuffer.clh."""
        if self.memory.counting:
            rows, pitch = plane_shape(count, size)
            self.memory.count(rows * pitch * 4)
            return outline(Plane, runtime=self, count=count, size=size, outside=outside, pitch=pitch)
        return Plane(self, count, size, outside)

    def image_shape(self, rows: int, pitch: int) -> Size | None:
        """Return (rows, columns) of the image that holds `rows` rows of `pitch` float32.

        None where kernels read buffers.

        Raises:
            DeviceError: the device has no image so large.
        """
        return None if self.image_limits is None else self.image_limits.shape(self.info.label, rows, pitch)

    def array(self, values: NDArray[Any]) -> DeviceArray:
        """Return new device memory that holds a copy of `values` (at least one element)."""
        if self.memory.counting:
            return self.empty(values.size, values.dtype.type)
        return DeviceArray(self, values)

    def empty(self, count: int, dtype: type[np.generic]) -> DeviceArray:
        """Return new device memory for `count` elements (at least one), not initialised."""
        if self.memory.counting:
            self.memory.count(max(count, 1) * np.dtype(dtype).itemsize)
            return outline(DeviceArray, runtime=self, dtype=np.dtype(dtype), count=max(count, 1))
        return DeviceArray(self, np.empty(max(count, 1), dtype), fill=False)

    def allocate(self, size: int, owner: object, contents: NDArray[Any] | None = None) -> Any:
        """Return a new buffer of `size` bytes, which lives as long as `owner`.

        `contents` are copied to it: as many bytes, C-contiguous; without, it holds anything.

        Raises:
            DeviceMemoryError: there is no room, even without what earlier calls left; the driver
                was not asked unless it said so.
        """
        cl = opencl()
        self.touch()
        flags = cl.mem_flags.READ_WRITE
        if self.shares_memory:
            flags |= cl.mem_flags.ALLOC_HOST_PTR
        if contents is not None:
            flags |= cl.mem_flags.COPY_HOST_PTR

        def allocated() -> Any:
            try:
                return cl.Buffer(self.context, flags, size, hostbuf=contents)
            except cl.Error as error:
                raise DeviceMemoryError(
                    f"{self.info.label}: the driver has no room for {size / 2**20:.1f} MiB more "
                    f"({error}); {self.memory}"
                ) from error

        with self.lock:
            self.take(size, owner)
            return self._prepared.with_capacity(allocated)

    def take(self, size: int, owner: object) -> None:
        """Count `size` bytes as taken while `owner` lives; DeviceMemoryError if they don't fit."""
        self.memory.check_piece(size)  # which nothing that is let go changes
        self._prepared.with_capacity(lambda: self.memory.take(size, owner))
        self.allocated_bytes += size

    def require(self, size: int, what: str) -> None:
        """Raise DeviceMemoryError unless `size` bytes more fit, `what` says what for.

        What earlier calls left goes first where it stands in the way.
        """
        if self.memory.counting:
            return self.memory.count(size)
        with self.lock:
            return self._prepared.with_capacity(lambda: self.memory.require(size, what))

    def prepared(self, key: object, make: Callable[[], Any], *, of: object | None = None) -> Any:
        """Return what `make` returned for `key` before, or its result now.

        It is kept for later calls, while there is room: beyond `memory.keep` bytes what was not
        used for the longest time is let go, though never what the current call uses.

        Args:
            key: what tells results apart.
            make: is called if nothing is kept.
            of: with what the result goes if it dies, such as a scene.

        Raises:
            DeviceMemoryError: there is no room for it, even with nothing else kept; the message
                says how much it needs.
        """
        return self._prepared.get(key, make, of)

    def forget(self) -> None:
        """Let go of all that calls keep for later ones, see `prepared`; compiled programs stay."""
        with self.lock:
            self._prepared.clear()
            gc.collect()  # parts of results may refer to each other

    # ---- programs

    def kernel(
        self,
        path: str,
        macros: Mapping[str, int] | None = None,
        structs: Sequence[Struct] = (),
        *,
        most_lanes: int = 16,
    ) -> Kernel:
        """Return a kernel of a file in kernels/, see `Programs.kernel`."""
        return self.programs.kernel(path, macros, structs, most_lanes=most_lanes)

    def small_groups(self, items: int) -> Size | None:
        """Return work-groups of so few work-items for a processor, whose cores share them evenly; a GPU chooses."""
        return None if self.info.kind == "gpu" else (1, items)

    @property
    def builds(self) -> int:
        """Programs compiled so far, in all."""
        return self.programs.builds

    # ---- time

    def record(self, name: str, event: Any, items: int = 0) -> None:
        """Add a pass to the current frame, a kernel's with the number of its work-items."""
        self._log.events.append((name, event, items))

    @property
    def noted(self) -> int:
        """Place in `times` of the next pass of this thread's frame."""
        return len(self._log.events) + len(self._log.skips)

    def finish(self) -> None:
        """Wait for the device."""
        self.queue.finish()
        self.second.finish()


def serialised(function: Callable[P, T]) -> Callable[P, T]:
    """Make a function run alone on the device of `runtime` or of an argument, or the default one.

    Its results are of the kind of the arrays that it was given (`array_kinds`), and for each image of a
    batch of G-buffers (`gbuffer_batch`).
    """

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        check_keywords(function, kwargs)
        given = (kwargs.get("runtime"), *(getattr(value, "runtime", None) for value in args))
        runtime = next((r for r in given if isinstance(r, Runtime)), None) or Runtime.open()

        def work() -> T:
            with runtime.memory.keeping():
                images = images_in(args, kwargs)
                if images is None:
                    return function(*args, **kwargs)
                result: T = image_by_image(function, images, args, kwargs)
                return result

        result: T = of_kind(runtime.exclusively(work), kind_among((*args, *kwargs.values())))
        return result

    return call


_OPENED: dict[tuple[Any, ...], Runtime] = {}
_OPENING = threading.RLock()
