"""The OpenCL driver of a process, one alone, and its devices."""

from __future__ import annotations

import os
from typing import Any

from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import requirements
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant, pocl_cache
from ssgi_cl.device.drivers.caches import replaced_caches
from ssgi_cl.device.opencl import listed_device, opencl

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


def loaded_driver() -> str | None:
    """Return the driver that this process uses, if it uses one."""
    return _loaded_driver


def load_driver(info: DeviceInfo) -> None:
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


def usable_device(info: DeviceInfo, variant: KernelVariant) -> Any:
    """Return the device of the loaded driver; DeviceError if it can't run the variant."""
    device = listed_device(info)
    if device is None:
        raise DeviceError(
            f"{info.label}: the driver does not list this device as it is set up now; "
            "`ssgi devices --refresh` looks again"
        )
    if variant.storage == "image" and not device.image_support:
        raise DeviceError(f"{info.label} has no images: use storage 'buffer'")
    requirements.check(info.label, device)
    return device
