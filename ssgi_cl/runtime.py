"""The runtime: one device with its queue, programs and memory, and the time of every pass."""

from __future__ import annotations

import hashlib
import os
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import drivers, image_limits, sources
from ssgi_cl.driver_caches import replaced_caches
from ssgi_cl.drivers import DeviceInfo, Form
from ssgi_cl.errors import DeviceError, DeviceMemoryError, KernelBuildError
from ssgi_cl.image_limits import ImageLimits
from ssgi_cl.kernel import Kernel, check_groups
from ssgi_cl.memory import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.opencl import opencl
from ssgi_cl.room import Room, outline
from ssgi_cl.structs import Struct


@dataclass(frozen=True)
class PassTime:
    """A pass that ran, or was skipped.

    Attributes:
        name: of the pass.
        ms: milliseconds on the device; 0 if skipped.
        skipped: why it was not run; empty if it ran.
        saved: milliseconds that this saves by estimate: what the pass took when it last ran; 0 if
            that is not known.
    """

    name: str
    ms: float
    skipped: str = ""
    saved: float = 0.0


class Runtime:
    """A device, opened. Make one with `Runtime.open` and use it from one thread at a time.

    Attributes:
        info: the device.
        form: the build of the kernels that it gets.
        room: the device's memory, how much of it is in use, and limits that may be lowered.
        short_header: whether programs declare built-in functions by common/builtins.clh alone.
        allocated_bytes, builds: device memory taken and programs compiled so far, in all.
    """

    def __init__(self, info: DeviceInfo, form: Form) -> None:
        cl = opencl()

        self.info = info
        self.form = form
        self.allocated_bytes = 0
        self.builds = 0
        device = cl.get_platforms()[info.platform].get_devices()[info.device]
        if form.storage == "image" and not device.image_support:
            raise DeviceError(f"{info.label} has no images: use storage 'buffer'")
        self.context = cl.Context([device])
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.shares_memory = bool(device.host_unified_memory) and info.kind != "gpu"
        self.device = device
        check_groups(info.label, device)
        self._image_limits = ImageLimits.of(device) if form.storage == "image" else None
        self.room = Room(info.label, device.global_mem_size, device.max_mem_alloc_size)
        self.short_header = device.platform.name == "Portable Computing Language"
        self._programs: dict[str, Any] = {}
        self._kernels: dict[tuple[Any, ...], Kernel] = {}
        self._prepared: dict[object, Any] = {}
        self._events: list[tuple[str, Any]] = []
        self._skips: list[tuple[int, PassTime]] = []
        self._parts: list[tuple[str, int, int]] = []
        self._costs: dict[str, float] = {}
        self._depth = 0

    @classmethod
    def open(
        cls, name: str | None = None, *, lanes: int | None = None, storage: str | None = None
    ) -> Runtime:
        """Return the runtime of a device; the same object for the same arguments.

        Args:
            name: words that the device's label holds, such as "pocl", "pocl 3.1" or "nvidia";
                by default the variable SSGI_CL_DEVICE, and without it the fastest device found.
            lanes, storage: force a build of the kernels (1, 8 or 16; "buffer" or "image") in
                place of the fastest on this device.

        Raises:
            DeviceError: no such device (the message lists all), or another driver is in use in
                this process already.
        """
        name = name or os.environ.get("SSGI_CL_DEVICE") or None
        info = drivers.choose(name)
        form = info.best
        assert form is not None  # noqa: S101  choose() returns usable devices only
        if lanes is not None or storage is not None:
            form = Form(form.lanes if lanes is None else lanes, storage or "buffer")
            reason = info.speeds.get(str(form))
            if isinstance(reason, str):
                raise DeviceError(f"{info.label} cannot run {form}: {reason}")
        key = (info.driver, info.platform, info.device, form, os.environ.get(image_limits.VARIABLE))
        runtime = _OPENED.get(key)
        if runtime is None:
            _load_driver(info)
            runtime = _OPENED[key] = cls(info, form)
        return runtime

    def __repr__(self) -> str:
        return f"<Runtime {self.info.label}, {self.form}>"

    # ---- memory

    def plane(self, count: int, size: Size, outside: float = 0.0) -> Plane:
        """Return new device memory for `count` images; see kernels/common/gbuffer.clh."""
        if self.room.counting:
            rows, pitch = plane_shape(count, size)
            self.room.take(rows * pitch * 4)
            plane: Plane = outline(
                runtime=self, count=count, size=size, outside=outside, pitch=pitch
            )
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
        if self.room.counting:
            return self.empty(values.size, values.dtype.type)
        return DeviceArray(self, values)

    def empty(self, count: int, dtype: type[np.generic]) -> DeviceArray:
        """Return new device memory for `count` elements (at least one), not initialised."""
        if self.room.counting:
            self.room.take(max(count, 1) * np.dtype(dtype).itemsize)
            array: DeviceArray = outline(
                runtime=self, dtype=np.dtype(dtype), count=max(count, 1)
            )
            return array
        return DeviceArray(self, np.empty(max(count, 1), dtype), fill=False)

    def allocate(self, size: int, owner: object) -> Any:
        """Return a new buffer of `size` bytes, which lives as long as `owner`.

        Raises:
            DeviceMemoryError: there is no room; the driver was not asked unless it said so.
        """
        cl = opencl()

        self.take(size, owner)
        flags = cl.mem_flags.READ_WRITE
        if self.shares_memory:
            flags |= cl.mem_flags.ALLOC_HOST_PTR
        try:
            return cl.Buffer(self.context, flags, size)
        except cl.Error as error:
            raise DeviceMemoryError(
                f"{self.info.label}: the driver has no room for {size / 2**20:.1f} MiB more "
                f"({error}); {self.room}"
            ) from error

    def take(self, size: int, owner: object) -> None:
        """Count `size` bytes as taken while `owner` lives; DeviceMemoryError if they don't fit."""
        self.room.take(size)
        self.allocated_bytes += size
        weakref.finalize(owner, self.room.give_back, size).atexit = False

    def prepared(self, key: object, make: Callable[[], Any]) -> Any:
        """Return what `make` returned for `key` before, or its result now (kept: 64 latest).

        Raises:
            DeviceMemoryError: there is no room for it, even with nothing else kept; the message
                says how much it needs.
        """
        if self.room.counting:
            return make()
        value = self._prepared.pop(key, None)
        if value is None:
            value = self._made(make)
            if len(self._prepared) >= 64:
                self._prepared.pop(next(iter(self._prepared)))
        self._prepared[key] = value
        return value

    def _made(self, make: Callable[[], Any]) -> Any:
        try:
            return make()
        except DeviceMemoryError:
            self._prepared.clear()  # all that nobody holds is free now
        try:
            return make()
        except DeviceMemoryError as error:
            needed = self.room.needed(make)
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
        if self.room.counting:
            stand_in: Kernel = outline()
            return stand_in
        key = (path, tuple(sorted((macros or {}).items())), tuple(structs), most_lanes)
        kernel = self._kernels.get(key)
        if kernel is None:
            text = sources.flatten(path, "\n".join(struct.text for struct in structs))
            name = path.rsplit("/", 1)[-1].removesuffix(".cl")
            kernel = self._kernel(name, f"kernels/{path}", text, macros or {}, most_lanes)
            self._kernels[key] = kernel
        return kernel

    def kernel_from_text(
        self,
        name: str,
        text: str,
        macros: Mapping[str, int] | None = None,
        structs: Sequence[Struct] = (),
    ) -> Kernel:
        """Return the kernel called `name` in `text`, which may include files of kernels/.

        The rest is as in `kernel`.
        """
        prelude = "\n".join(struct.text for struct in structs)
        flat = sources.flatten_text(text, name, prelude)
        return self._kernel(name, f"kernel text {name!r}", flat, macros or {})

    def _kernel(
        self, name: str, source: str, text: str, macros: Mapping[str, int], most_lanes: int = 16
    ) -> Kernel:
        limits = self._image_limits
        options = [
            "-cl-std=CL1.2",
            f"-DSSGI_LANES={min(self.form.lanes, most_lanes)}",
            f"-DSSGI_IMAGES={int(self.form.storage == 'image')}",
            *([f"-DSSGI_IMAGE_ROWS={limits.rows}"] if limits else []),
            *(f"-D{macro}={value}" for macro, value in sorted(macros.items())),
        ]
        key = hashlib.sha256("\0".join([text, *options]).encode()).hexdigest()
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._build(source, text, options)
        return Kernel(self, program, name, source)

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
                    f"{source} does not compile on {self.info.label} with "
                    f"{' '.join(options)}:\n{error}"
                ) from error
        self.short_header = False  # this version needs the full one
        return program

    # ---- time

    @contextmanager
    def frame(self, costs: dict[str, float] | None = None) -> Iterator[Self]:
        """Collect the passes within; frames inside a frame belong to it.

        `costs` is the caller's memory of what passes and parts took, in ms by name: `times` brings
        it up to date, and what is skipped is estimated from it.
        """
        if self._depth == 0:
            self._events, self._skips, self._parts = [], [], []
            self._costs = {} if costs is None else costs
        self._depth += 1
        try:
            yield self
        finally:
            self._depth -= 1

    def times(self) -> list[PassTime]:
        """Return the passes of the latest frame, in order; waits for those still running."""
        if self._events:
            self._events[-1][1].wait()
        ran = [PassTime(name, event.profile.end * 1e-6 - event.profile.start * 1e-6)
               for name, event in self._events]
        taken: dict[str, list[float]] = {}
        for p in ran:
            taken.setdefault(p.name, []).append(p.ms)
        whole: dict[str, list[float]] = {}
        for name, first, end in self._parts:
            whole.setdefault(name, []).append(sum(p.ms for p in ran[first:end]))
        for name, times in {**taken, **whole}.items():
            self._costs[name] = sum(times) / len(times)
        for position, skip in reversed(self._skips):
            ran.insert(position, skip)
        return ran

    def record(self, name: str, event: Any) -> None:
        """Add a pass to the current frame."""
        self._events.append((name, event))

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Note that the passes within make up a part of the frame, which may be skipped as one."""
        first = len(self._events)
        yield
        self._parts.append((name, first, len(self._events)))

    def skip(self, name: str, why: str, saved: float | None = None) -> None:
        """Note in the current frame that a pass or part was not needed.

        By default it saves what it took when it last ran.
        """
        cost = self._costs.get(name, 0.0) if saved is None else saved
        self._skips.append((len(self._events), PassTime(name, 0.0, why, cost)))

    def finish(self) -> None:
        """Wait for the device."""
        self.queue.finish()


_NO_HEADER = "-D_OPENCL_H_"
"""The include guard of Clang's opencl-c.h, which PoCL 3 includes in every program."""

_OPENED: dict[tuple[Any, ...], Runtime] = {}
_loaded_driver: str | None = None


def _load_driver(info: DeviceInfo) -> None:
    """Make the loader see this driver alone, which only works before its first use."""
    global _loaded_driver
    if _loaded_driver is None:
        asked = os.environ.get("OCL_ICD_VENDORS")
        os.environ["OCL_ICD_VENDORS"] = info.driver
        os.environ |= replaced_caches()
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
