"""What a device has to have, what it may have, and its limits: asked by name, never assumed."""

from __future__ import annotations

import re
from typing import Any

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device.constants import SSGI_GROUP

VERSION = (1, 2)
"""Of OpenCL, and of its C: the least."""
LOCAL_BYTES = 8192
"""Of local memory, which the largest work-group of a kernel takes at most; OpenCL guarantees 32 KiB."""
CONSTANT_BYTES = 16384
"""Of constant memory: the tables and structs of a kernel; OpenCL guarantees 64 KiB."""
ARGUMENT_BYTES = 1024
"""Of the arguments of a kernel: what OpenCL guarantees."""
OPTIONAL = ("cl_khr_fp64", "cl_khr_int64_base_atomics", "cl_khr_subgroups", "cl_khr_command_buffer")
"""Extensions that reports name. No kernel uses any: sums are of float32 pairs, atomics of 32 bits."""


def facts(device: Any) -> dict[str, Any]:
    """Return what reports say of a PyOpenCL device, as JSON can hold it; sizes are bytes and elements."""
    extensions = device.extensions.split()
    return {
        "opencl": device.version.strip(),
        "opencl_c": device.opencl_c_version.strip(),
        "profile": device.profile.strip(),
        "memory": device.global_mem_size,
        "largest_allocation": device.max_mem_alloc_size,
        "local_memory": device.local_mem_size,
        "constant_memory": device.max_constant_buffer_size,
        "work_group": device.max_work_group_size,
        "image": [device.image2d_max_width, device.image2d_max_height] if device.image_support else None,
        "extensions": [name for name in OPTIONAL if name in extensions],
    }


def check(label: str, device: Any) -> None:
    """Raise DeviceError if a device lacks what every kernel needs; the message says what and how much.

    Args:
        label: of the device, for the message.
        device: PyOpenCL's.
    """
    for what, text in (("OpenCL", device.version), ("OpenCL C", device.opencl_c_version)):
        found = re.search(r"(\d+)\.(\d+)", text)
        if found is None or (int(found[1]), int(found[2])) < VERSION:
            raise DeviceError(
                f"{label} has {what} {found[0] if found else repr(text)}: expected 1.2 or later; install a newer driver"
            )
    if device.profile.strip() != "FULL_PROFILE":
        raise DeviceError(f"{label} has OpenCL's {device.profile.strip()}: expected FULL_PROFILE")
    for missing, what in (
        (not device.available, "is not available, as its driver says"),
        (not device.compiler_available, "has no compiler: install the driver's compiler"),
        (not device.endian_little, "is big-endian: expected little-endian"),
    ):
        if missing:
            raise DeviceError(f"{label} {what}")
    if device.max_work_group_size < SSGI_GROUP:
        raise DeviceError(
            f"{label} takes work-groups of at most {device.max_work_group_size} work-items: expected {SSGI_GROUP} or "
            "more (a variable such as POCL_MAX_WORK_GROUP_SIZE may limit it)"
        )
    for kind, has, least in (
        ("local memory", device.local_mem_size, LOCAL_BYTES),
        ("constant memory", device.max_constant_buffer_size, CONSTANT_BYTES),
        ("arguments of a kernel", device.max_parameter_size, ARGUMENT_BYTES),
    ):
        if has < least:
            raise DeviceError(f"{label} has {has} bytes of {kind}: expected {least} or more")
