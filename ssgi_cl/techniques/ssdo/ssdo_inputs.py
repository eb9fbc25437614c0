"""What callers of directional occlusion give, in device memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime


def view_on_device(view: GBuffer | DeviceGBuffer, number: int, runtime: Runtime) -> DeviceGBuffer:
    """Return what a auxiliary camera sees in device memory of its own."""
    if isinstance(view, GBuffer):
        return on_device(view, runtime, place=number + 1)
    if not isinstance(view, DeviceGBuffer):
        raise TypeError(f"auxiliary_views[{number}] is {type(view).__name__}: expected GBuffer or DeviceGBuffer")
    return view


def uploaded_radiance(radiance: ArrayLike, device: DeviceGBuffer) -> Plane:
    """Return the plane of what surfaces send; layers that the array lacks send nothing."""
    given = checks.as_array("radiance", radiance)
    flat = given.reshape(-1, *given.shape[-2:]) if given.ndim == 4 else given
    values = checks.plane("radiance", flat, channels=3, low=0.0, unit="W m^-2 sr^-1")
    shape = given.shape if given.ndim == 4 else (1, *given.shape)
    if shape[1:] != (*device.whole, 3) or shape[0] not in (1, device.layers):
        raise ValueError(
            f"radiance has shape {given.shape}: expected {(*device.whole, 3)}, or with "
            f"{device.layers} layers in front, as the depth"
        )
    plane: Plane = device.runtime.prepared(
        ("ssdo radiance", device.whole, device.layers), lambda: device.runtime.plane(3 * device.layers, device.whole)
    )
    images = np.zeros((3 * device.layers, *device.whole), np.float32)
    images[: 3 * shape[0]] = np.moveaxis(values.reshape(shape), -1, 1).reshape(-1, *device.whole)
    plane.upload(images)
    return plane
