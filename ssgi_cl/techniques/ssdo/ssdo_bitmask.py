"""Visibility bitmask of SSDO: directional occlusion and one-bounce light from slices, and closed surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.params import Prepared, param
from ssgi_cl.device.arrays import DeviceArray, Plane, Size, plane_shape
from ssgi_cl.device.gbuffer import VIEW_ROTATION, DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.device.transient import ImageParts, Target
from ssgi_cl.techniques.ao.bitmask import ENDS
from ssgi_cl.techniques.ao.slices import SLICES, SliceParams, SliceScan, check_shape
from ssgi_cl.techniques.direct.sky import SKY_SIZE, Sky
from ssgi_cl.techniques.source import Source

OWN = Struct("SsdoBitmaskParams", floats("back", *ROTATION))

MOST_LAYERS = 31
"""Limit of the layers in which `paired_layers` finds pairs: one bit of an int for each."""


@dataclass(frozen=True, kw_only=True)
class SsdoBitmaskParams(SliceParams):
    """Parameters of directional occlusion and one-bounce light from a visibility bitmask."""

    taps: int = param(20, "depths read on either side of a slice", low=1, high=64)
    tap_power: float = param(1.0, "taps lie at u^tap_power of the radius, u evenly spread", low=0.1, high=8.0)
    thickness: float = param(
        0.0,
        "of surfaces, along the view ray; that of each pixel where the G-buffer has it",
        low=0.0,
        high=1e3,
        unit="radii",
        shape=bool,
    )
    end: str = param(
        "thickness", "where thick surfaces end: there, or at the next depth layer if that is nearer", choices=ENDS
    )
    back: float = param(
        0.0,
        "radiance of a surface's side that the camera does not see, where a receiver sees it",
        low=0.0,
        high=1.0,
        unit="of the other side's",
    )
    cones: int = param(
        8,
        "directions of each slice in which an environment's image, and the occlusion of bent normals, is looked up",
        low=1,
        high=16,
    )
    bent_normals: bool = param(False, "also find the mean unoccluded direction of each pixel")


class SsdoBitmask(Prepared[SsdoBitmaskParams]):
    """Directional occlusion and one-bounce light from a visibility bitmask, prepared for one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the camera's image.
        params: see `SsdoBitmaskParams`; those of the blur are ignored.
        margin: (rows, columns) by which the G-buffers exceed it on every side.
        layers: depth layers of the G-buffers.
        masks: whether `masks` is needed, for auxiliary cameras.

    Attributes:
        size: (rows, columns) of the results, as `params.resolution` says.
        masks: int32, the covered sectors of the last call, as a plane of `params.slices` images of
            `size`: bit s of each element is sector s, counted from the second side's tangent plane.
            As many images follow of the covered sectors whose sender is seen from the side averted
            from the camera, and so sends nothing. 0 where nothing is. None without the argument.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: SsdoBitmaskParams | None = None,
        margin: Size = (0, 0),
        layers: int = 1,
        *,
        masks: bool = False,
    ) -> None:
        self.runtime = runtime
        self._params = params or SsdoBitmaskParams()
        self._shape = (size, margin, layers)
        self._scan = SliceScan(runtime, size, self.params, margin, layers)
        self.size = self._scan.size
        self.masks: DeviceArray | None = None
        if masks:
            rows, pitch = plane_shape(2 * self.params.slices, self.size)
            self.masks = runtime.array(np.zeros(rows * pitch, np.int32))

    def _set(self, params: SsdoBitmaskParams) -> None:
        self._scan.params = params

    def run(
        self,
        gbuffer: DeviceGBuffer,
        source: Source,
        *,
        radiance: Plane | ImageParts | None = None,
        sky: Sky | None = None,
    ) -> Plane:
        """Queue the passes; return A and irradiance, of `size`.

        Args:
            gbuffer: of the size, margin and layers this was prepared for.
            source: the same, or it reduced to `size`.
            radiance: of the visible surfaces, images 3 layer + channel of the G-buffer's whole
                size, W m^-2 sr^-1, 0 where nothing is; None for no bounce. As many images of the
                averted sides may follow; without them, the parameter `back` counts.
            sky: its image lights the unoccluded directions; None for none. Its `constant` is left
                to the caller, who needs only A for it.

        Returns:
            A, 1 where nothing is; with `bent_normals` 3 images of the bend of the normal, in view
            space; 3 of the sky's irradiance, W/m^2, if it has an image; 3 of the bounce's if
            `radiance` is given; 0 where nothing is.

        Raises:
            ValueError: the G-buffer or the radiance has another shape.
        """
        check_shape(gbuffer, *self._shape)
        scan, layers = self._scan, gbuffer.layers
        counts = (3 * layers, 6 * layers)
        if radiance is not None and (radiance.count not in counts or radiance.size != gbuffer.whole):
            raise ValueError(
                f"radiance has {radiance.count} images of {radiance.size}: expected {counts[0]} or "
                f"{counts[1]} of {gbuffer.whole}"
            )
        lookup = None if sky is None else sky.map
        facing = paired_layers(gbuffer)
        sides = None if facing is None else scan.sorted(facing, gbuffer.region)
        inv_depth, slopes = scan.inv_depth(gbuffer, gbuffer.thickness), scan.slopes(gbuffer)
        sent = None if radiance is None else scan.sorted(radiance, gbuffer.region)
        bent = self.params.bent_normals
        count = 1 + 3 * (lookup is not None) + 3 * (sent is not None) + 3 * bent
        macros = {
            **scan.macros(thick=0 if gbuffer.thickness is None else gbuffer.thickness.count, reads_thickness=True),
            "SLICES_NEXT": ENDS.index(self.params.end),
            "BITMASK_THICK": int(gbuffer.thickness is not None or self.params.thickness > 0.0),
            "BITMASK_BOUNCE": int(radiance is not None),
            "BITMASK_BACKS": int(radiance is not None and radiance.count == counts[1]),
            "BITMASK_CONES": 0 if lookup is None else self.params.cones,
            "BITMASK_BENT": self.params.cones * bent,
            "BITMASK_KEPT": int(self.masks is not None),
            "BITMASK_SIDES": int(sides is not None),
            "SKY_SIZE": SKY_SIZE,
        }
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        own = {"back": self.params.back, **rotation_values(camera.view[:3, :3].T)}
        region = gbuffer.seen_every(scan.step)
        values = {"thickness": self.params.thickness}
        packed, packed_own = scan.packed(source, values), OWN.pack(own)
        kernel = self.runtime.kernel("ssdo/ssdo_bitmask.cl", macros, (CAMERA, SLICES, OWN))
        result = Target(self.runtime, count, self.size, 1.0, kept=False)
        with result.over(region, background=(1.0, *(0.0,) * (count - 1))) as (light, over):
            if region is not None and self.masks is not None:
                self.masks.fill(0)
            for strip in scan.strips(over):
                kernel.run(
                    self.size,
                    grid=scan.grid,
                    region=strip,
                    cell=(1, 1),
                    inv_depth=inv_depth,
                    normal=source.normal,
                    table=scan.table,
                    slopes=slopes,
                    sky=lookup,
                    sent=sent,
                    sides=sides,
                    light=light,
                    kept=self.masks,
                    camera=source.camera_struct,
                    params=packed,
                    own=packed_own,
                )
        return light


def paired_layers(gbuffer: DeviceGBuffer) -> Plane | None:
    """Queue the pass that pairs the layers of closed surfaces by the direction of their normals.

    The result is kept with the contents of the G-buffer, whose world-space normals are not needed
    afterwards. Normals that were turned to the camera before they were given make no pairs.

    Args:
        gbuffer: with the contents drawn or uploaded.

    Returns:
        An image for each layer, as kernels/ssdo/ssdo_sides.cl defines it; None unless there are
        several layers, all with normals.
    """
    layers, runtime = gbuffer.layers, gbuffer.runtime
    if not 1 < layers == gbuffer.attributes <= MOST_LAYERS:
        return None
    camera = gbuffer.camera
    assert camera is not None  # noqa: S101  a filled G-buffer has one
    kernel = runtime.kernel("ssdo/ssdo_sides.cl", {"SIDES_LAYERS": layers}, (VIEW_ROTATION,))
    if gbuffer.sides is None:
        with Target(runtime, layers, gbuffer.whole, kept=False).over(gbuffer.region) as (sides, over):
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
    return gbuffer.sides
