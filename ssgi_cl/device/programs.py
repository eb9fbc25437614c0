"""Programs of a device: kernels by file and switches, each text compiled once."""

from __future__ import annotations

import hashlib
import logging
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ssgi_cl.core.errors import KernelBuildError
from ssgi_cl.device import sources
from ssgi_cl.device.compiled import CompiledRecord
from ssgi_cl.device.drivers import KernelVariant, pocl_cache
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.memory import outline
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.process import check_not_forked
from ssgi_cl.device.signature import ARGUMENT_INFO
from ssgi_cl.device.structs import Struct

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime

_LOG = logging.getLogger("ssgi_cl")
COMPILING = logging.getLogger("ssgi_cl.compiling")
"""Gets a record when many programs are compiled for the first time; commands print it."""

MANY = 6
"""Programs never compiled before, in one process, from which on it is said that compiling takes a while: some
hundred milliseconds."""

_NO_HEADER = "-D_OPENCL_H_"
"""The include guard of Clang's opencl-c.h, which PoCL 3 includes in every program."""

OPTIONS = ("-cl-std=CL1.2", "-w")
"""Build options of every program. PoCL's Clang prints how many warnings it had on stderr ("206 warnings
generated."), hence -w; the lint reads them. Errors stay in the build log."""


def defines(
    variant: KernelVariant, macros: Mapping[str, int], image_rows: int | None = None, most_lanes: int = 16
) -> dict[str, int]:
    """Return what is defined in a program of a form: how it reads and how wide, and its own `macros`.

    `image_rows` are those of the device's images, where it reads images.
    """
    return {
        "SSGI_LANES": min(variant.lanes, most_lanes),
        "SSGI_IMAGES": int(variant.storage == "image"),
        **({"SSGI_IMAGE_ROWS": image_rows} if image_rows else {}),
        **dict(sorted(macros.items())),
    }


class Programs:
    """The compiled programs of a device.

    Attributes:
        builds: programs compiled so far.
        record: of programs that were compiled on this machine before.
        announced: whether it was said, or need not be said, that compiling takes a while.
        short_header: whether programs declare built-in functions by common/builtins.clh alone.
        kernels: (file, macros, structs, most lanes) -> kernel, of files in kernels/.
    """

    def __init__(self, runtime: Runtime, *, short_header: bool) -> None:
        self._runtime = runtime
        self.builds = 0
        self.record = CompiledRecord()
        self.announced = False
        self.short_header = short_header
        self.kernels: dict[tuple[Any, ...], Kernel] = {}
        self._programs: dict[str, Any] = {}
        self._watcher: Callable[[], object] | None = None

    @contextmanager
    def watched(self, watcher: Callable[[], object]) -> Iterator[None]:
        """Have `watcher` called after each program that is compiled meanwhile."""
        before, self._watcher = self._watcher, watcher
        try:
            yield
        finally:
            self._watcher = before

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
        if self._runtime.memory.counting:
            return outline(Kernel)
        key = (path, tuple(sorted((macros or {}).items())), tuple(structs), most_lanes)
        with self._runtime.lock:
            kernel = self.kernels.get(key)
            if kernel is None:
                check_not_forked()
                text = sources.flatten(path, "\n".join(struct.text for struct in structs))
                name = path.rsplit("/", 1)[-1].removesuffix(".cl")
                kernel = self._kernel(name, f"kernels/{path}", text, macros or {}, structs, most_lanes)
                self.kernels[key] = kernel
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
        limits = self._runtime.image_limits
        defined = defines(self._runtime.variant, macros, limits.rows if limits else None, most_lanes)
        options = [*OPTIONS, ARGUMENT_INFO, *(f"-D{macro}={value}" for macro, value in defined.items())]
        key = hashlib.sha256("\0".join([text, *options]).encode()).hexdigest()
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._noted(key, source, text, options)
        try:
            return Kernel(self._runtime, program, name, source, text, defined, structs)
        except KernelBuildError:
            # PoCL 3.0 takes an empty file of its cache for a program without kernels.
            if program.num_kernels or not pocl_cache.clear_damaged(since=time.time()):
                raise
        program = self._programs[key] = self._build(source, text, options)
        return Kernel(self._runtime, program, name, source, text, defined, structs)

    def _noted(self, key: str, source: str, text: str, options: list[str]) -> Any:
        """Build a program; say once that this takes a while, of many that are compiled for the first time."""
        info = self._runtime.info
        digest = hashlib.sha256(f"{info.driver}\0{info.label}\0{key}".encode()).hexdigest()
        if not self.announced and self.record.new >= MANY - 1 and not self.record.has(digest):
            self.announced = True
            COMPILING.info(
                "compiling kernels for %s, once: it takes up to a minute (`ssgi warmup` does it beforehand)", info.label
            )
        program = self._build(source, text, options)
        self.record.add(digest)
        if self._watcher is not None:
            self._watcher()
        return program

    def _build(self, source: str, text: str, options: list[str]) -> Any:
        cl = opencl()

        self.builds += 1
        _LOG.debug("compiling %s for %s", source, self._runtime.info.label)
        with warnings.catch_warnings():
            # Compilers report success in words; failures raise.
            warnings.simplefilter("ignore")
            if self.short_header:
                # PoCL 3 parses Clang's declarations of all built-in functions for every program:
                # 80 ms, where most of our kernels take 20. Ours are in common/builtins.clh.
                short = sources.flatten("common/builtins.clh") + text
                try:
                    return cl.Program(self._runtime.context, short).build(options=[*options, _NO_HEADER])
                except cl.RuntimeError:
                    pass  # the full header decides
            try:
                program = cl.Program(self._runtime.context, text).build(options=options)
            except cl.RuntimeError as error:
                raise KernelBuildError(
                    f"{source} does not compile on {self._runtime.info.label} with {' '.join(options)}:\n{error}"
                ) from error
        self.short_header = False  # this version needs the full one
        return program
