"""Smooth edges: several places of a pixel tell which surfaces it shows, each of which is shaded once."""

from __future__ import annotations

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.pixel_places import pixel_places
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.raster_view import STRUCTS, VIEW
from ssgi_cl.rasterize.raster.rasterizer import SUBPIXELS, Rasterizer


class SmoothEdges:
    """The mean radiance of places within each pixel, prepared for images of one size.

    Visibility is found at each place, in the way of coverage sampling (Young 2006, "Coverage Sampled
    Antialiasing"); a place has the radiance of the pixel of 3 x 3 that shows its surface (Jimenez et al. 2011,
    "Filtering Approaches for Real-Time Anti-Aliasing", has a survey of such reconstruction). Departs: the
    pixel is found by its triangle or tangent plane and material, and no sample is shaded. The mean is that of
    linear radiance, as a box filter has it, without weights against bright pixels: each result is a mean of
    radiances of 3 x 3 pixels, so that it exceeds none of them.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        places: within each pixel.

    Attributes:
        places: (right, down) from the centre, steps of 1/256 pixel; the centre first, though it may not be one of
            those that the mean is of.
    """

    def __init__(self, runtime: Runtime, size: Size, places: int) -> None:
        self.runtime, self.size = runtime, size
        steps = (pixel_places(places) * SUBPIXELS).round().astype(int) - SUBPIXELS // 2
        chosen = [(right, down) for right, down in steps.tolist()]
        self.places = ((0, 0), *(place for place in chosen if place != (0, 0)))
        self._rasterizer = Rasterizer(runtime, size, shaded=False, places=self.places)
        macros = {
            "SMOOTH_PLACES": len(self.places),
            "SMOOTH_STRIDE": self._rasterizer.stride,
            "SMOOTH_FIRST": int((0, 0) not in chosen),
        }
        self._kernel = runtime.kernel("filters/smooth_edges.cl", macros, STRUCTS, most_lanes=8)
        self._smooth = runtime.plane(3, size)

    def run(self, gbuffer: DeviceGBuffer, radiance: Plane, *, scene: DeviceScene, camera: Camera) -> Plane:
        """Queue the passes; return the smooth radiance, which is there until the next run.

        Args:
            gbuffer: the surfaces at pixel centres.
            radiance: 3 images, of these.
            scene: the surfaces.
            camera: what sees them.
        """
        seen = self._rasterizer.sampled(scene, camera)
        self._kernel.run(
            self.size,
            triangles=seen.triangles,
            depths=seen.depths,
            places=self._rasterizer.places,
            faces=scene.faces,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            radiance=radiance,
            smooth=self._smooth,
            whole=gbuffer.whole,
            camera=seen.camera,
            view=VIEW.pack(seen.view),
        )
        return self._smooth
