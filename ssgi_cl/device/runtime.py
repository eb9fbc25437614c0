"""The runtime: one device with its queue, programs and memory, and the time of every pass."""

from __future__ import annotations

import gc
import hashlib
import os
import threading
import time
import warnings
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.errors import DeviceError, DeviceMemoryError, KernelBuildError
from ssgi_cl.core.keywords import check_keywords
from ssgi_cl.device import drivers, image_limits, sources
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant, pocl_cache
from ssgi_cl.device.drivers.caches import replaced_caches
from ssgi_cl.device.drivers.probe_timer import speed_in_use
from ssgi_cl.device.image_limits import ImageLimits
from ssgi_cl.device.kernel import Kernel, check_groups
from ssgi_cl.device.memory import DeviceMemory, outline
from ssgi_cl.device.opencl import listed_device, opencl
from ssgi_cl.device.signature import ARGUMENT_INFO
from ssgi_cl.device.structs import Struct
from ssgi_cl.device.timing import FrameLog, PassTime
from ssgi_cl.device.transient import TransientMemory

MOST_PREPARED = 256
"""Results that `Runtime.prepared` keeps at most: their memory on the host is not counted."""

P = ParamSpec("P")
T = TypeVar("T")


@dataclass
class _Prepared:
    """What `Runtime.prepared` keeps, and the number of the call that used it last."""

    value: Any
    call: int


class Runtime:
    """A device, opened. Make one with `Runtime.open`.

    Threads may share it: functions and `Renderer` run one after the other, see `exclusively`, and
    each thread has frames of its own. An object of a technique, a G-buffer or an array in device
    memory is for one thread at a time. A process that was forked after a device was opened can't
    use it: start such processes by "spawn".

    Attributes:
        info: the device.
        variant: the kernel variant that it gets: lanes and storage.
        memory: the device's memory: how much is in use, the most that was, and limits.
        transient: the memory that passes share.
        lock: held by what another thread's work on this device must not come between.
        short_header: whether programs declare built-in functions by common/builtins.clh alone.
        allocated_bytes, builds: device memory taken and programs compiled so far, in all.
    """

    def __init__(self, info: DeviceInfo, variant: KernelVariant) -> None:
        cl = opencl()

        self.info = info
        self.variant = variant
        self.allocated_bytes = 0
        self.builds = 0
        device = listed_device(info)
        if device is None:
            raise DeviceError(
                f"{info.label}: the driver does not list this device as it is set up now; "
                "`ssgi devices --refresh` looks again"
            )
        if variant.storage == "image" and not device.image_support:
            raise DeviceError(f"{info.label} has no images: use storage 'buffer'")
        self.context = cl.Context([device])
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.shares_memory = bool(device.host_unified_memory) and info.kind != "gpu"
        self.device = device
        check_groups(info.label, device)
        self._image_limits = ImageLimits.of(device) if variant.storage == "image" else None
        self.memory = DeviceMemory(
            info.label, device.global_mem_size, device.max_mem_alloc_size, on_host=self.shares_memory
        )
        self.short_header = device.platform.name == "Portable Computing Language"
        self.transient = TransientMemory(self)
        self._programs: dict[str, Any] = {}
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._prepared: dict[object, _Prepared] = {}
        self._within_bounds: tuple[int, int, int] | None = None  # state in which nothing must go
        self._following: set[object] = set()
        self._log = FrameLog()
        self.lock = threading.RLock()
        self._calls = 0
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
            runtime = cls._opened(name, lanes, storage)
        if keep is not None:
            runtime.memory.keep = keep
        return runtime

    @classmethod
    def _opened(cls, name: str | None, lanes: int | None, storage: str | None) -> Runtime:
        name = name or os.environ.get("SSGI_CL_DEVICE") or None
        info, variant = _chosen(name, lanes, storage)
        key = (info.driver, info.platform, info.device, variant, os.environ.get(image_limits.VARIABLE))
        runtime = _OPENED.get(key)
        if runtime is None:
            _load_driver(info)
            if listed_device(info) is None:  # the record is of another configuration
                drivers.look_again(Path(info.driver))
                info, variant = _chosen(name, lanes, storage)
                _load_driver(info)
            runtime = _OPENED[key] = cls(info, variant)
            drivers.confirm(info, variant, lambda: speed_in_use(cls(info, variant)))
        return runtime

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
                self._calls += 1
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
                self._bound_kept()  # passes may have taken more than what was prepared
            return result

    @property
    def calls(self) -> int:
        """Number of the call of the library that runs now."""
        return self._calls

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
            plane: Plane = outline(runtime=self, count=count, size=size, outside=outside, pitch=pitch)
            return plane
        return Plane(self, count, size, outside)

    def image_shape(self, rows: int, pitch: int) -> Size | None:
        """Return (rows, columns) of the image that holds `rows` rows of `pitch` float32.

        None where kernels read buffers.

        Raises:
            DeviceError: the device has no image so large.
        """
        if self._image_limits is None:
            return None
        return self._image_limits.shape(self.info.label, rows, pitch)

    def array(self, values: NDArray[Any]) -> DeviceArray:
        """Return new device memory that holds a copy of `values` (at least one element)."""
        if self.memory.counting:
            return self.empty(values.size, values.dtype.type)
        return DeviceArray(self, values)

    def empty(self, count: int, dtype: type[np.generic]) -> DeviceArray:
        """Return new device memory for `count` elements (at least one), not initialised."""
        if self.memory.counting:
            self.memory.count(max(count, 1) * np.dtype(dtype).itemsize)
            array: DeviceArray = outline(runtime=self, dtype=np.dtype(dtype), count=max(count, 1))
            return array
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
            return self._with_capacity(allocated)

    def take(self, size: int, owner: object) -> None:
        """Count `size` bytes as taken while `owner` lives; DeviceMemoryError if they don't fit."""
        self.memory.check_piece(size)  # which nothing that is let go changes
        self._with_capacity(lambda: self.memory.take(size, owner))
        self.allocated_bytes += size

    def require(self, size: int, what: str) -> None:
        """Raise DeviceMemoryError unless `size` bytes more fit, `what` says what for.

        What earlier calls left goes first where it stands in the way.
        """
        if self.memory.counting:
            self.memory.count(size)
            return
        with self.lock:
            self._with_capacity(lambda: self.memory.require(size, what))

    def _with_capacity(self, take: Callable[[], T]) -> T:
        """Return what `take` returns, tried again each time after the oldest of what earlier calls
        left was let go."""
        while True:
            try:
                return take()
            except DeviceMemoryError:
                if not self._let_go():
                    raise

    def _let_go(self) -> bool:
        """Let go what was not used for the longest time; return False if this call used all."""
        before = self.memory.used
        for key in tuple(self._prepared):
            prepared = self._prepared.get(key)
            if prepared is not None and prepared.call < self._calls:
                del self._prepared[key], prepared
                if self.memory.used == before:
                    gc.collect()  # its parts may refer to each other
                return True
        return self.transient.let_go(self._calls)

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
        if self.memory.counting:
            return make()
        with self.lock:
            if self._depth == 0:
                self._calls += 1
            kept = self._prepared.pop(key, None)
            if kept is None:
                with self.memory.keeping():
                    kept = _Prepared(self._made(make), self._calls)
                if of is not None and key not in self._following:
                    weakref.finalize(of, self._follow, key).atexit = False
                    self._following.add(key)
            kept.call = self._calls
            self._prepared[key] = kept
            self._bound_kept()
            return kept.value

    def _bound_kept(self) -> None:
        """Let go what was not used for the longest time while more is kept than may be."""
        memory = self.memory
        while self._within_bounds != (state := (memory.taken, memory.keep, len(self._prepared))):
            if memory.kept <= memory.keep and len(self._prepared) <= MOST_PREPARED:
                self._within_bounds = state
            elif not self._let_go():
                return

    def _follow(self, key: object) -> None:
        self._following.discard(key)
        self._prepared.pop(key, None)

    def _made(self, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except DeviceMemoryError:
            self._prepared.clear()  # all that nobody holds is free now
        gc.collect()
        try:
            return make()
        except DeviceMemoryError as error:
            needed = self.memory.needed(make)
            raise DeviceMemoryError(
                f"{error}; {needed / 2**20:.1f} MiB are needed in all: take a smaller size, fewer "
                "layers or less overscan"
            ) from error

    # ---- programs

    def kernel(
        self,
        path: str,
        macros: Mapping[str, int] | None = None,
        structs: Sequence[Struct] = (),
        *,
        most_lanes: int = 16,
    ) -> Kernel:
        """Return a kernel, compiled unless the same text with the same options was before.

        Args:
            path: file in kernels/, such as "ssao/ssao.cl"; its stem is the kernel's name.
            macros: name -> integer, the switches and loop counts of that file.
            structs: definitions that the file needs.
            most_lanes: for kernels whose work is too narrow for more.

        Raises:
            KernelBuildError: the compiler refused it; the message has file:line in kernels/.
        """
        if self.memory.counting:
            stand_in: Kernel = outline()
            return stand_in
        key = (path, tuple(sorted((macros or {}).items())), tuple(structs), most_lanes)
        with self.lock:
            kernel = self._kernels.get(key)
            if kernel is None:
                check_not_forked()
                text = sources.flatten(path, "\n".join(struct.text for struct in structs))
                name = path.rsplit("/", 1)[-1].removesuffix(".cl")
                kernel = self._kernel(name, f"kernels/{path}", text, macros or {}, structs, most_lanes)
                self._kernels[key] = kernel
            return kernel

    def kernel_from_text(
        self, name: str, text: str, macros: Mapping[str, int] | None = None, structs: Sequence[Struct] = ()
    ) -> Kernel:
        """Return the kernel called `name` in `text`, which may include files of kernels/.

        The rest is as in `kernel`.
        """
        prelude = "\n".join(struct.text for struct in structs)
        flat = sources.flatten_text(text, name, prelude)
        return self._kernel(name, f"kernel text {name!r}", flat, macros or {}, structs)

    def _kernel(
        self,
        name: str,
        source: str,
        text: str,
        macros: Mapping[str, int],
        structs: Sequence[Struct],
        most_lanes: int = 16,
    ) -> Kernel:
        limits = self._image_limits
        defined = {
            "SSGI_LANES": min(self.variant.lanes, most_lanes),
            "SSGI_IMAGES": int(self.variant.storage == "image"),
            **({"SSGI_IMAGE_ROWS": limits.rows} if limits else {}),
            **dict(sorted(macros.items())),
        }
        # -w: PoCL's Clang prints how many warnings it had on stderr ("206 warnings generated."); the
        # lint reads them. Errors stay in the build log.
        options = ["-cl-std=CL1.2", "-w", ARGUMENT_INFO, *(f"-D{macro}={value}" for macro, value in defined.items())]
        key = hashlib.sha256("\0".join([text, *options]).encode()).hexdigest()
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._build(source, text, options)
        try:
            return Kernel(self, program, name, source, text, defined, structs)
        except KernelBuildError:
            # PoCL 3.0 takes an empty file of its cache for a program without kernels.
            if program.num_kernels or not pocl_cache.clear_damaged(since=time.time()):
                raise
        program = self._programs[key] = self._build(source, text, options)
        return Kernel(self, program, name, source, text, defined, structs)

    def _build(self, source: str, text: str, options: list[str]) -> Any:
        cl = opencl()

        self.builds += 1
        with warnings.catch_warnings():
            # Compilers report success in words; failures raise.
            warnings.simplefilter("ignore")
            if self.short_header:
                # PoCL 3 parses Clang's declarations of all built-in functions for every program:
                # 80 ms, where most of our kernels take 20. Ours are in common/builtins.clh.
                short = sources.flatten("common/builtins.clh") + text
                try:
                    return cl.Program(self.context, short).build(options=[*options, _NO_HEADER])
                except cl.RuntimeError:
                    pass  # the full header decides
            try:
                program = cl.Program(self.context, text).build(options=options)
            except cl.RuntimeError as error:
                raise KernelBuildError(
                    f"{source} does not compile on {self.info.label} with {' '.join(options)}:\n{error}"
                ) from error
        self.short_header = False  # this version needs the full one
        return program

    # ---- time

    def frame(self, costs: dict[str, float] | None = None) -> AbstractContextManager[None]:
        """Collect this thread's passes within, see `FrameLog.frame`."""
        return self._log.frame(costs)

    def times(self) -> list[PassTime]:
        """Return the passes of the latest frame, in order; waits for those still running."""
        return self._log.times()

    def record(self, name: str, event: Any) -> None:
        """Add a pass to the current frame."""
        self._log.events.append((name, event))

    def part(self, name: str) -> AbstractContextManager[None]:
        """Note that the passes within make up a part of the frame, which may be skipped as one."""
        return self._log.part(name)

    def skip(self, name: str, why: str, saved: float | None = None) -> None:
        """Note in the current frame that a pass or part was not needed, see `FrameLog.skip`."""
        self._log.skip(name, why, saved)

    @property
    def noted(self) -> int:
        """Number of passes that this thread's frame has so far, skipped ones counted: the place
        that the next one gets in `times`."""
        return len(self._log.events) + len(self._log.skips)

    def finish(self) -> None:
        """Wait for the device."""
        self.queue.finish()


def serialised(function: Callable[P, T]) -> Callable[P, T]:
    """Make a function of the library run alone on its device, see `Runtime.exclusively`.

    The device is that of `runtime`, or of an argument in device memory, or the default.
    """

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        check_keywords(function, kwargs)
        given = (kwargs.get("runtime"), *(getattr(value, "runtime", None) for value in args))
        runtime = next((r for r in given if isinstance(r, Runtime)), None) or Runtime.open()

        def work() -> T:
            with runtime.memory.keeping():
                return function(*args, **kwargs)

        return runtime.exclusively(work)

    return call


def _chosen(name: str | None, lanes: int | None, storage: str | None) -> tuple[DeviceInfo, KernelVariant]:
    """Return the device and the kernel variant that `Runtime.open` is asked for."""
    info = drivers.choose(name)
    variant = info.best
    assert variant is not None  # noqa: S101  choose() returns usable devices only
    if lanes is not None or storage is not None:
        variant = KernelVariant(variant.lanes if lanes is None else lanes, storage or "buffer")
        reason = info.speeds.get(str(variant))
        if isinstance(reason, str):
            raise DeviceError(f"{info.label} cannot run {variant}: {reason}")
    return info, variant


_NO_HEADER = "-D_OPENCL_H_"
"""The include guard of Clang's opencl-c.h, which PoCL 3 includes in every program."""

_OPENED: dict[tuple[Any, ...], Runtime] = {}
_OPENING = threading.RLock()
_loaded_driver: str | None = None
_forked = False


def _note_fork() -> None:
    global _forked
    _forked = _loaded_driver is not None


os.register_at_fork(after_in_child=_note_fork)


def check_not_forked() -> None:
    """Raise DeviceError if this process was forked after a device was opened.

    Drivers keep threads and locks that a fork does not copy: the first call would wait for ever.
    """
    if _forked:
        raise DeviceError(
            f"process {os.getpid()} was forked after its parent had opened an OpenCL device, which "
            "works in the parent alone: start processes that compute by "
            'multiprocessing.get_context("spawn"), or open the device after the fork'
        )


def _load_driver(info: DeviceInfo) -> None:
    """Make the loader see this driver alone, which only works before its first use."""
    global _loaded_driver
    if _loaded_driver is None:
        asked = os.environ.get("OCL_ICD_VENDORS")
        os.environ["OCL_ICD_VENDORS"] = info.driver
        os.environ |= replaced_caches()
        if "pocl" in info.label.lower():
            pocl_cache.guard()
        try:
            cl = opencl()

            cl.get_platforms()
        finally:
            if asked is None:
                del os.environ["OCL_ICD_VENDORS"]
            else:
                os.environ["OCL_ICD_VENDORS"] = asked
        _loaded_driver = info.driver
    elif _loaded_driver != info.driver:
        raise DeviceError(
            f"this process already uses the driver {_loaded_driver}; {info.label} needs "
            f"{info.driver}, and two drivers can clash in one process: use another process"
        )
