"""PyOpenCL, imported when a device is opened: the driver must be chosen before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ssgi_cl.device.drivers.pocl_cpu import name_processor

if TYPE_CHECKING:
    from ssgi_cl.device.drivers.info import DeviceInfo


def opencl() -> Any:
    """Return PyOpenCL, imported when a device is opened and no sooner: it loads the drivers.

    Untyped, as its own annotations lack calls that it takes.
    """
    import pyopencl

    return pyopencl


def described(platform: Any, device: Any) -> dict[str, Any]:
    """Return label, kind and number of units of a PyOpenCL device, as `DeviceInfo` has them."""
    cl = opencl()

    name = "PoCL" if "pocl" in platform.version.lower() else platform.name.strip()
    types = {cl.device_type.CPU: "cpu", cl.device_type.GPU: "gpu"}
    return {
        "label": f"{name} {device.driver_version}: {device.name.strip()}",
        "kind": next((word for bit, word in types.items() if device.type & bit), "accelerator"),
        "units": device.max_compute_units,
    }


def listed_device(info: DeviceInfo) -> Any | None:
    """Return the PyOpenCL device that is described, or None if the driver does not list it there.

    A record of another configuration of the driver or the machine describes other devices. Without
    the driver's name in `info`, platform and device number alone count.
    """
    cl = opencl()

    try:
        platform = cl.get_platforms()[info.platform]
        device = platform.get_devices()[info.device]
    except (IndexError, cl.Error):
        return None
    if info.driver:
        found = described(platform, device)
        if found != {"label": info.label, "kind": info.kind, "units": info.units}:
            return None
    name_processor(device)
    return device
