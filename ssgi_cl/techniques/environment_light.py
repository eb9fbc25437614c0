"""Light of environments on a G-buffer that a caller has: what the functions of the techniques for it share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.direct.shadow_maps import checked_lights


def lit_by_environments(
    technique: Any,
    params: Any,
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    scene: Scene,
    runtime: Runtime | None,
) -> NDArray[np.float32]:
    """Return irradiance [rows, columns, 3] in W/m^2, from a class of technique with these parameters.

    Raises:
        TypeError, ValueError: lights, scene or G-buffer of the wrong type, or an empty one.
    """
    lights = checked_lights(lights, None)
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene")
    device = on_device(gbuffer, runtime)
    if device.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    runtime = device.runtime
    made = runtime.prepared((technique, device.size, params.shape()), lambda: technique(runtime, device.size, params))
    with runtime.frame():
        plane = made.run(device, lights, scene=scene)
        if plane is None:
            return np.zeros((*device.size, 3), np.float32)
        return np.ascontiguousarray(np.moveaxis(plane.download(), 0, -1))
