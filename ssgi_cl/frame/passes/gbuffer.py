"""Pass: the G-buffer, what the camera sees."""

from __future__ import annotations

from collections.abc import Callable

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import CAMERA, GBUFFER, SCENE
from ssgi_cl.frame.stage import Stage, Values
from ssgi_cl.rasterize.raster.view import device_scene


def gbuffer(build: Build, look: Callable[[DeviceGBuffer], None] | None = None) -> Stage:
    """Return the pass that draws the G-buffer.

    Args:
        build: what it is prepared for.
        look: queues what needs normals in world space, whose memory goes to others then; or None.
    """
    runtime, rasterizer = build.runtime, build.rasterizer
    regions = rasterizer.regions

    def run(r: Values) -> DeviceGBuffer:
        parts = scene_parts(r[SCENE])
        # What is seen through may lie beyond the region of what is not.
        rasterizer.regions = regions and parts.blended is None
        seen: DeviceGBuffer = rasterizer.render(device_scene(parts.solid, runtime), r[CAMERA])
        if seen.region is not None:
            rows, columns = seen.region.rows, seen.region.columns
            runtime.skip("region", f"nothing is seen outside of {columns} x {rows} pixels", 0.0)
        seen.derive()
        if look is not None:
            look(seen)
        seen.release_world()
        return seen

    return Stage(name="G-buffer", reads=(SCENE, CAMERA), writes=(GBUFFER,), run=run, releases=("ssdo",))
