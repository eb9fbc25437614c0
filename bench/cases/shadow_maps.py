"""Shadow maps by their size."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, light_cameras
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context


class ShadowMaps(Own):
    """The reflective shadow map of the first light; the setting is its size in texels."""

    SETTINGS = ("512", "1024")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the light's renderer ready."""
        size = count_of(setting, "texels along a side", 16, 8192)
        if not context.punctual_lights:
            raise ValueError(f"{context.view.name} has no light: expected at least one")
        punctual_light = context.punctual_lights[0]
        scene = device_scene(context.view.scene, context.runtime)
        cameras = light_cameras(punctual_light, context.view.scene.bounds, size)
        renderer = RsmRenderer(context.runtime, size)
        depth = context.runtime.plane(len(cameras), (size, size), math.inf)

        def run() -> None:
            for image, camera in enumerate(cameras):
                renderer.render(scene, punctual_light, camera)
                renderer.write_depth(depth, image)

        return Subject(run=run, note=f"{type(punctual_light).__name__}, {len(cameras)} face(s)")


FAMILIES: Mapping[str, Family] = {"rsm": ShadowMaps()}
