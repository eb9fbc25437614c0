"""The rasteriser: G-buffers by layers, light maps by size, and layers of surfaces that are seen through."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import islice

from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.rasterize.raster import blended_layers, view
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.shadow_map import RsmRenderer, light_cameras
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import faded


def gbuffers(context: Context, setting: str) -> Subject:
    """Make a G-buffer with view normals ready; the setting is the number of depth layers."""
    layers = count_of(setting, "a number of layers", 1, view.MOST_LAYERS)
    rasterizer = Rasterizer(context.runtime, context.size, layers=layers)
    scene = device_scene(context.view.scene, context.runtime)

    def run() -> None:
        rasterizer.render(scene, context.camera)
        rasterizer.target.derive()

    return Subject(run=run)


def light_map(context: Context, setting: str) -> Subject:
    """Make the reflective shadow map of the first light ready; the setting is its size in texels."""
    size = count_of(setting, "texels along a side", 16, 8192)
    light = context.some_lights()[0]
    scene = device_scene(context.view.scene, context.runtime)
    cameras = light_cameras(light, context.view.scene.bounds, size)
    renderer = RsmRenderer(context.runtime, size)
    depth = context.runtime.plane(len(cameras), (size, size), math.inf)

    def run() -> None:
        for image, camera in enumerate(cameras):
            renderer.render(scene, light, camera)
            renderer.write_depth(depth, image)

    return Subject(run=run, note=f"{type(light).__name__}, {len(cameras)} face(s)")


def seen_through(context: Context, setting: str) -> Subject:
    """Make the scene ready as if half of each surface were there; the setting is the number of layers."""
    layers = count_of(setting, "a number of layers", 1, blended_layers.MOST_LAYERS)
    runtime, parts = context.runtime, scene_parts(faded(context.view.scene))
    assert parts.blended is not None  # noqa: S101  all of it is seen through
    solid, blended = device_scene(parts.solid, runtime), device_scene(parts.blended, runtime)
    opaque = Rasterizer(runtime, context.size)
    technique = blended_layers.BlendedLayers(runtime, context.size, matt=False)
    with runtime.frame():
        front = opaque.render(solid, context.camera)

    def run() -> None:
        with runtime.frame():
            for _ in islice(technique.drawn(blended, context.camera, front), layers):
                pass

    return Subject(run=run)


FAMILIES: Mapping[str, Family] = {
    "gbuffer": Family(gbuffers, ("1", "4")),
    "rsm": Family(light_map, ("512", "1024")),
    "blended-layers": Family(seen_through, ("1", "4")),
}
