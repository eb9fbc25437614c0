"""PyOpenCL, imported when a device is opened: the driver must be chosen before."""

from __future__ import annotations

from typing import Any


def opencl() -> Any:
    """Return PyOpenCL, imported when a device is opened and no sooner: it loads the drivers.

    Untyped, as its own annotations lack calls that it takes.
    """
    import pyopencl

    return pyopencl
