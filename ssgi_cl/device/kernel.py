"""A compiled kernel and how it is launched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ssgi_cl.core.errors import DeviceError, KernelBuildError
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arguments import Arguments
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.signature import Signature
from ssgi_cl.device.structs import Struct

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime


CPU_WIDTH = 32
"""Work-items of a work-group on CPUs. PoCL compiles a kernel for each width; frames of 320 x 240 to
1600 x 1200 take the same time within 3 % with 16, 32 and 64."""


class Kernel:
    """A compiled kernel. `run` sets all arguments anew, so callers may share it.

    Attributes:
        runtime: its device.
        name: as in its text.
        signature: what it takes.
        lanes: of a work-item.
        largest_group: work-items of a work-group at most; fewer than the device's where a kernel takes many registers.
        local_bytes: of local memory, which a work-group takes.
    """

    def __init__(
        self,
        runtime: Runtime,
        program: Any,
        name: str,
        source: str,
        text: str,
        macros: Mapping[str, int],
        structs: Sequence[Struct],
    ) -> None:
        cl = opencl()

        self.runtime = runtime
        self.name = name
        try:
            self._kernel = cl.Kernel(program, self.name)
        except cl.Error as error:  # PoCL 3.0 with 16 lanes: the build says nothing and fails here
            raise KernelBuildError(
                f"{source} has no kernel {self.name} on {runtime.info.label}, {runtime.variant}: {error}"
            ) from error
        self.lanes = macros["SSGI_LANES"]
        asked = cl.kernel_work_group_info
        self.largest_group: int = self._kernel.get_work_group_info(asked.WORK_GROUP_SIZE, runtime.device)
        self.local_bytes: int = self._kernel.get_work_group_info(asked.LOCAL_MEM_SIZE, runtime.device)
        self.signature = Signature.of(self._kernel, text)
        self._arguments = Arguments(self.signature, structs)
        self._kernel.set_arg_types(self._arguments.types)

    def run(
        self,
        size: Size,
        /,
        *,
        grid: Size | None = None,
        local: Size | None = None,
        region: Region | None = None,
        cell: Size | None = None,
        **arguments: Any,
    ) -> None:
        """Queue the kernel; its pass has its name, which is its file's stem.

        Args:
            size: (rows, columns), the kernel's own parameter `size`.
            grid: (rows, columns) of work-items; by default a work-item for each lane-wide piece of
                a row.
            local: (rows, columns) of a work-group; by default chosen for the device.
            region: pixels of the image that are to be computed; by default all. Those of a whole
                work-group are computed if any is.
            cell: (rows, columns) of pixels that a work-item has, for a region with a grid; by
                default a lane-wide piece of a row.
            arguments: by the names of the kernel's parameters: planes and arrays, numbers, packed
                structs; (rows, columns) for an int2 (columns, rows); None for memory that is
                `ssgi_optional`.

        Raises:
            TypeError: an argument is missing, unknown or of another type than the kernel's.
            DeviceError: the device has no room for work-groups of `local`.
        """
        first: Size | None = None
        rows, columns = grid or (size[0], -(-size[1] // self.lanes))
        if region is not None:
            first, (rows, columns) = region.cells(cell or (1, self.lanes))
        if rows == 0 or columns == 0:
            return
        if self._arguments.takes_size:
            arguments["size"] = size
        values = self._arguments.converted(arguments)
        if local is not None and local[0] * local[1] > self.largest_group:
            raise DeviceError(
                f"{self.runtime.info.label} runs {self.name} with work-groups of at most {self.largest_group} "
                f"work-items: expected {local[0] * local[1]}"
            )
        group = local or self._group(rows, columns if first is None else 1)
        work = (-(-columns // group[1]) * group[1], -(-rows // group[0]) * group[0])
        runtime = self.runtime
        runtime.touch()
        with runtime.lock:
            self._kernel.set_args(*values)
            event = opencl().enqueue_nd_range_kernel(
                runtime.launching,
                self._kernel,
                work,
                (group[1], group[0]),
                None if first is None else (first[1], first[0]),
            )
        runtime.record(self.name, event, work[0] * work[1])

    def _group(self, rows: int, columns: int) -> Size:
        if self.runtime.info.kind == "cpu" or self.runtime.info.kind == "":
            return (1, min(CPU_WIDTH, self.largest_group))
        group = (8, 8) if rows >= 8 else (1, 64)
        while group[0] * group[1] > self.largest_group:
            group = (-(-group[0] // 2), group[1]) if group[0] > 1 else (1, group[1] // 2)
        return group
