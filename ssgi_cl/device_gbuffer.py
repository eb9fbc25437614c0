"""A G-buffer in device memory, in the form that kernels read."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ssgi_cl.camera import Camera
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.memory import Plane, Size
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import (
    CAMERA,
    ROTATION,
    Struct,
    camera_values,
    floats,
    rotation_values,
)

VIEW_ROTATION = Struct("GbufferRotation", floats(*ROTATION))


class DeviceGBuffer:
    """A G-buffer that stays on the device from frame to frame.

    Attributes:
        size: (rows, columns) of the camera's image and of every result.
        margin: (rows, columns) by which the planes exceed it on every side.
        depth: `layers` images, scene units; INFINITY where nothing is.
        linear: 1 / depth (orthographic: depth); INFINITY where nothing is.
        normal: 3 images, view space, facing the viewer; 0 where nothing is.
        normal_world: 3 images, as given.
        albedo, emission: 3 images each.
        thickness: 1 image, scene units, or None if the contents have none.
        camera: the camera of the current contents; `camera_struct` is what kernels get.
    """

    def __init__(
        self, runtime: Runtime, size: Size, *, layers: int = 1, margin: Size = (0, 0)
    ) -> None:
        self.runtime = runtime
        self.size = size
        self.margin = margin
        self.layers = layers
        self.whole = (size[0] + 2 * margin[0], size[1] + 2 * margin[1])
        self.depth = runtime.plane(layers, self.whole, math.inf)
        self.linear = runtime.plane(1, self.whole, math.inf)
        self.normal = runtime.plane(3, self.whole)
        self.normal_world = runtime.plane(3, self.whole)
        self.albedo = runtime.plane(3, self.whole)
        self.emission = runtime.plane(3, self.whole)
        self.emits = False
        self.thickness: Plane | None = None
        self._thickness: Plane | None = None
        self.camera: Camera | None = None
        self.camera_struct: Any = None
        self._kernels = [
            runtime.kernel(
                "gbuffer/gbuffer_normals.cl", {"GBUFFER_GIVEN": given}, (CAMERA, VIEW_ROTATION)
            )
            for given in (0, 1)
        ]

    def upload(self, gbuffer: GBuffer) -> None:
        """Replace the contents by a G-buffer of the same size, margin and number of layers."""
        shape = (gbuffer.size, gbuffer.margin, gbuffer.layers)
        if shape != (self.size, self.margin, self.layers):
            raise ValueError(
                f"the G-buffer has size, margin and layers {shape}: expected "
                f"{(self.size, self.margin, self.layers)}"
            )
        depth = np.asarray(gbuffer.depth)
        self.depth.upload(depth.reshape(self.layers, *self.whole))
        normal = gbuffer.first("normal")
        if normal is not None:
            self.normal_world.upload(np.moveaxis(normal, -1, 0))
        albedo = gbuffer.first("albedo")
        self.albedo.upload(
            np.full((3, *self.whole), 0.8, np.float32)
            if albedo is None
            else np.moveaxis(albedo, -1, 0)
        )
        emission = gbuffer.first("emission")
        self.emits = emission is not None
        if emission is not None:
            self.emission.upload(np.moveaxis(emission, -1, 0))
        thickness = gbuffer.first("thickness")
        if thickness is not None:
            self._thickness = self._thickness or self.runtime.plane(1, self.whole)
            self._thickness.upload(thickness[None])
        self.thickness = None if thickness is None else self._thickness
        self.set_camera(gbuffer.camera)
        with self.runtime.frame():
            self.derive(given=normal is not None)

    def set_camera(self, camera: Camera) -> None:
        """Note the camera that saw the contents."""
        self.camera = camera
        self.camera_struct = CAMERA.pack(camera_values(camera, self.margin))

    def derive(self, *, given: bool = True) -> None:
        """Queue the pass that makes `linear` and `normal` from `depth` and `normal_world`."""
        camera = self.camera
        if camera is None:
            raise ValueError("the device G-buffer has no camera: call set_camera or upload first")
        self._kernels[given].run(
            "view normals",
            self.whole,
            reads=[self.depth, self.normal_world],
            writes=[self.linear, self.normal],
            values=[self.camera_struct, VIEW_ROTATION.pack(rotation_values(camera.view[:3, :3]))],
        )


def on_device(gbuffer: GBuffer | DeviceGBuffer, runtime: Runtime | None) -> DeviceGBuffer:
    """Return the G-buffer in device memory, uploaded unless it is there already.

    Memory for uploads is kept by the runtime and used again for G-buffers of the same size.
    """
    if isinstance(gbuffer, DeviceGBuffer):
        return gbuffer
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer or DeviceGBuffer")
    runtime = runtime or Runtime.open()
    key = (DeviceGBuffer, gbuffer.size, gbuffer.margin, gbuffer.layers)
    device: DeviceGBuffer = runtime.prepared(
        key,
        lambda: DeviceGBuffer(
            runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin
        ),
    )
    device.upload(gbuffer)
    return device
