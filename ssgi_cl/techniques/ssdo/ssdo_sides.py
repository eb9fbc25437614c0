"""Which sides of depth layers nobody sees: the inner ones of what is closed."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import VIEW_ROTATION, DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import rotation_values
from ssgi_cl.device.transient import Target

MOST_LAYERS = 31
"""A bit each in an int."""


class Sides:
    """Finds the layers that bound something closed, by which way the mesh's normals point.

    Normals that were turned to the camera before, as a G-buffer of somebody else's may have them,
    say nothing.

    Args:
        runtime: the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime

    def run(self, gbuffer: DeviceGBuffer) -> Plane | None:
        """Queue the pass; return an image for each layer, see kernels/ssdo/ssdo_sides.cl.

        None unless there are several layers, and all have normals. Found once for the contents of
        a G-buffer, whose normals in world space are not needed after.
        """
        layers = gbuffer.layers
        if not 1 < layers == gbuffer.attributes <= MOST_LAYERS:
            return None
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        kernel = self.runtime.kernel("ssdo/ssdo_sides.cl", {"SIDES_LAYERS": layers}, (VIEW_ROTATION,))
        if gbuffer.sides is not None:
            return gbuffer.sides
        target = Target(self.runtime, layers, gbuffer.whole, kept=False)
        with target.over(gbuffer.region) as (sides, over):
            kernel.run(
                gbuffer.whole,
                region=over,
                depth=gbuffer.depth,
                normal=gbuffer.normal,
                given=gbuffer.normal_world,
                sides=sides,
                rotation=VIEW_ROTATION.pack(rotation_values(camera.view[:3, :3])),
            )
        gbuffer.sides = sides
        return sides
