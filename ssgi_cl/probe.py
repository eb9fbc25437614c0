"""Look at the devices of one driver: `python -m ssgi_cl.probe [PLATFORM DEVICE FORM ...]`.

Without arguments it lists the devices; with them it times forms of the kernels on one device. One
JSON object a line. Run by `ssgi_cl.drivers` in a process of its own, which a driver may bring down.
"""

from __future__ import annotations

import json
import sys

import numpy as np

SIZE = (300, 400)
REPEATS = 15


def list_devices() -> None:
    """Print every device that the loaded drivers have."""
    import pyopencl as cl

    try:
        platforms = cl.get_platforms()
    except cl.LogicError:
        return  # the loader has no platform at all
    for p, platform in enumerate(platforms):
        for d, device in enumerate(platform.get_devices()):
            name = "PoCL" if "pocl" in platform.version.lower() else platform.name.strip()
            kind = device.type
            entry = {
                "platform": p,
                "device": d,
                "label": f"{name} {device.driver_version}: {device.name.strip()}",
                "kind": "cpu"
                if kind & cl.device_type.CPU
                else "gpu"
                if kind & cl.device_type.GPU
                else "accelerator",
                "units": device.max_compute_units,
            }
            print(json.dumps(entry), flush=True)


def time_forms(platform: int, device: int, names: list[str]) -> None:
    """Print the speed of each named form on one device, or why it does not run."""
    from ssgi_cl.drivers import FORMS, DeviceInfo
    from ssgi_cl.errors import SsgiError
    from ssgi_cl.runtime import Runtime

    for name in names:
        form = next(form for form in FORMS if str(form) == name)
        speed: float | str
        try:
            runtime = Runtime(DeviceInfo("", platform, device, "this device", "", 0), form)
            kernel = runtime.kernel("probe/probe_gather.cl")
            depth = runtime.plane(1, SIZE)
            depth.upload(np.ones((1, *SIZE), np.float32))
            result = runtime.plane(1, SIZE)
            milliseconds = []
            for _ in range(REPEATS):
                with runtime.frame():
                    kernel.run("probe", SIZE, reads=[depth], writes=[result])
                    milliseconds.append(runtime.times()[-1].ms)  # after a copy to an image
            reads = SIZE[0] * SIZE[1] * 16
            # The fastest run: what else the machine does only ever slows one down.
            speed = round(reads / min(milliseconds) / 1e3, 1)
        except SsgiError as error:
            speed = str(error).splitlines()[0]
        print(json.dumps({"form": name, "speed": speed}), flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 3:
        time_forms(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    else:
        list_devices()
